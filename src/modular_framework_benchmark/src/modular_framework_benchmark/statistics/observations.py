# SPDX-License-Identifier: BSD-3-Clause
"""Turns the episodes of an experiment into what is compared: the values of a metric, by method and in pairs.

The one place that decides what an episode counts for that failed, timed out, broke or has no value:

- success: every episode that is not a success is a failure, a broken one too;
- a metric with a limit: an episode without success and without a value counts at the limit, a value beyond the limit
  does too, and so does every episode without success if the metric is one of the whole task (outside the mode `task`:
  whatever the metric);
- any other metric, one that no episode has a value of, and a success without a value: missing. It is left out of the
  figures, and counted.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.records.experiment import Direction, Factor, Metric, MetricKind
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics.comparison import EpisodeCounts

SUCCESS = Metric("success", "task", MetricKind.RATE, Direction.HIGHER, description="The episode succeeded.")

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Observations:
    """A metric in a number of episodes.

    Attributes:
        values: Value in each episode, NaN where it has none, shape (n,).
        censored: Whether it counts at the limit, shape (n,).
        broken: Whether the episode is broken, shape (n,).
    """

    values: Floats
    censored: Flags
    broken: Flags


@dataclass(frozen=True, slots=True)
class Pairs:
    """A metric in pairs of episodes with the same scene and seed.

    Attributes:
        first: Values of the first method, shape (n,), none NaN.
        second: Those of the second.
        units: Number of the independent unit each pair belongs to, from 0, shape (n,): pairs of one seed are one unit.
        strata: Number of the combination of other factors' levels of each pair, shape (n,).
        broken: Whether an episode of the pair is broken, shape (n,).
        censored: How many of the episodes count at the limit.
        broken_episodes: How many of the episodes are broken.
        missing: How many pairs were left out because a value is missing.
        unmatched: How many episodes of either method have no partner.
    """

    first: Floats
    second: Floats
    units: NDArray[np.int64]
    strata: NDArray[np.int64]
    broken: Flags
    censored: int
    broken_episodes: int
    missing: int
    unmatched: int

    def without_broken(self) -> Pairs:
        """Returns the pairs of which neither episode is broken."""
        return dataclasses.replace(self._kept(~self.broken), broken_episodes=0)

    def of_complete_units(self) -> Pairs:
        """Returns the pairs of units that are finished: those with as many pairs as any unit has."""
        if not len(self.units):
            return self
        sizes = np.bincount(self.units)
        return self._kept(sizes[self.units] == sizes.max())

    def unit_differences(self) -> Floats:
        """Returns the mean difference of the pairs of each unit, first minus second, shape (units,)."""
        if not len(self.units):
            return np.zeros(0)
        return np.asarray(np.bincount(self.units, self.first - self.second) / np.bincount(self.units))

    def unit_strata(self) -> NDArray[np.int64]:
        """Returns the stratum of each unit, shape (units,); 0 where a unit has pairs of several strata."""
        count = len(np.unique(self.units))
        if count < len(self.units):
            return np.zeros(count, dtype=np.int64)
        strata = np.empty(count, dtype=np.int64)
        strata[self.units] = self.strata
        return strata

    def _kept(self, kept: Flags) -> Pairs:
        _, units = np.unique(self.units[kept], return_inverse=True)
        return dataclasses.replace(
            self,
            first=self.first[kept],
            second=self.second[kept],
            units=units.astype(np.int64),
            strata=self.strata[kept],
            broken=self.broken[kept],
        )


def metrics_of(results: ExperimentResults) -> tuple[Metric, ...]:
    """Returns the metrics that are compared: success first, then the others as they are listed."""
    described = results.description.metrics
    success = next((metric for metric in described if metric.name == SUCCESS.name), SUCCESS)
    return (success, *(metric for metric in described if metric.name != SUCCESS.name))


def methods_of(results: ExperimentResults) -> tuple[str, ...]:
    """Returns the methods, as the experiment lists them.

    Raises:
        ValueError: The compared factor is none of the experiment's.
    """
    return _factor(results, results.description.compared).levels


def other_factors(results: ExperimentResults) -> tuple[Factor, ...]:
    """Returns the factors beside the compared one."""
    return tuple(factor for factor in results.description.factors if factor.name != results.description.compared)


def restricted(results: ExperimentResults, factor: str, level: str) -> ExperimentResults:
    """Returns the results of the episodes with a level of a factor.

    Raises:
        ValueError: The experiment has no such factor.
    """
    _factor(results, factor)
    chosen = results.episodes[results.episodes[factor] == level]
    finished = len(results.episodes) >= results.planned
    return dataclasses.replace(results, episodes=chosen, planned=len(chosen) if finished else results.planned)


class EpisodeTable:
    """The finished episodes of an experiment, laid out once for all metrics and pairs of methods."""

    def __init__(self, results: ExperimentResults) -> None:
        """Reads the columns of the episodes.

        Args:
            results: The finished episodes.

        Raises:
            ValueError: The compared factor is none of the experiment's, or two episodes have the same method, levels
                and trial.
        """
        methods_of(results)
        self.results = results
        episodes = results.episodes
        self._succeeded = episodes["success"].to_numpy(bool)
        self._statuses = episodes["status"].to_numpy()
        self._broken = np.asarray(self._statuses == EpisodeStatus.BROKEN.value, dtype=bool)
        self._seeds = episodes["seed"].to_numpy()
        self._strata = _strata(results)
        trials = episodes["trial"].to_numpy(np.int64)
        self._keys = self._strata * (int(trials.max(initial=0)) + 1) + trials
        of_method = episodes[results.description.compared].to_numpy()
        self._rows = {method: np.flatnonzero(of_method == method) for method in methods_of(results)}
        for method, rows in self._rows.items():
            self._check_unique(method, rows)
        self._values: dict[str, tuple[Floats, Flags]] = {}

    def observations(self, metric: Metric, method: str) -> Observations:
        """Returns a metric in every finished episode of a method."""
        values, censored = self._column(metric)
        rows = self._rows[method]
        return Observations(values[rows], censored[rows], self._broken[rows])

    def counts(self, metric: Metric, method: str) -> EpisodeCounts:
        """Returns how the episodes of a method ended and what became of them in the figures of a metric."""
        statuses = self._statuses[self._rows[method]]
        seen = self.observations(metric, method)
        missing = int(np.isnan(seen.values).sum())

        def ended(status: EpisodeStatus) -> int:
            return int(np.sum(statuses == status.value))

        return EpisodeCounts(
            episodes=len(statuses),
            succeeded=ended(EpisodeStatus.SUCCEEDED),
            failed=ended(EpisodeStatus.FAILED) + ended(EpisodeStatus.INVALID),
            timed_out=ended(EpisodeStatus.TIMED_OUT),
            broken=ended(EpisodeStatus.BROKEN),
            counted=len(seen.values) - missing,
            censored=int(seen.censored.sum()),
            missing=missing,
        )

    def pairs(self, metric: Metric, first: str, second: str) -> Pairs:
        """Returns a metric in the pairs of two methods: same trial, same levels of the other factors."""
        rows = self._rows[first], self._rows[second]
        _, *places = np.intersect1d(self._keys[rows[0]], self._keys[rows[1]], assume_unique=True, return_indices=True)
        one, other = (side[place] for side, place in zip(rows, places, strict=True))
        values, censored = self._column(metric)
        complete = ~np.isnan(values[one]) & ~np.isnan(values[other])
        kept, kept_other = one[complete], other[complete]
        broken = np.stack([self._broken[kept], self._broken[kept_other]])
        return Pairs(
            first=values[kept],
            second=values[kept_other],
            units=np.unique(self._seeds[kept], return_inverse=True)[1].astype(np.int64),
            strata=self._strata[kept],
            broken=np.asarray(broken.any(axis=0)),
            censored=int(censored[kept].sum() + censored[kept_other].sum()),
            broken_episodes=int(broken.sum()),
            missing=len(one) - len(kept),
            unmatched=len(rows[0]) + len(rows[1]) - 2 * len(one),
        )

    def _column(self, metric: Metric) -> tuple[Floats, Flags]:
        """Returns the value of a metric in every episode, and whether it counts at the limit, shape (episodes,)."""
        if metric.name not in self._values:
            self._values[metric.name] = self._read(metric)
        return self._values[metric.name]

    def _read(self, metric: Metric) -> tuple[Floats, Flags]:
        if metric.name == SUCCESS.name:
            return self._succeeded.astype(float), np.zeros(len(self._succeeded), dtype=bool)
        values = np.full(len(self._succeeded), np.nan)
        if metric.name in self.results.episodes:
            values = pd.to_numeric(self.results.episodes[metric.name]).to_numpy(float).copy()
        values[~np.isfinite(values) | self._broken] = np.nan
        censored = _censored(values, self._succeeded, metric, self.results.description.mode)
        if metric.limit is not None:
            values[censored] = metric.limit
        return values, censored

    def _check_unique(self, method: str, rows: NDArray[np.int64]) -> None:
        _, places = np.unique(self._keys[rows], return_index=True)
        if len(places) == len(rows):
            return
        row = self.results.episodes.iloc[np.setdiff1d(rows, rows[places])[0]]
        names = [factor.name for factor in other_factors(self.results)] + ["trial"]
        found = ", ".join(f"{name}={row[name]}" for name in names)
        raise ValueError(
            f"two episodes of method {method} have {found}; an experiment has each combination and trial once"
        )


def pairs_of_methods(results: ExperimentResults) -> tuple[tuple[str, str], ...]:
    """Returns every pair of methods, as the experiment lists them."""
    return tuple(combinations(methods_of(results), 2))


def _factor(results: ExperimentResults, name: str) -> Factor:
    for factor in results.description.factors:
        if factor.name == name:
            return factor
    known = ", ".join(factor.name for factor in results.description.factors) or "none"
    raise ValueError(f"experiment '{results.description.name}' has no factor '{name}'; its factors are: {known}")


def _censored(values: Floats, succeeded: Flags, metric: Metric, mode: str) -> Flags:
    """Returns which episodes count at the metric's limit."""
    if metric.limit is None:
        return np.zeros(len(values), dtype=bool)
    beyond = values >= metric.limit if metric.better is Direction.LOWER else values <= metric.limit
    whole_episode = metric.component == "task" or mode != "task"
    measured = not np.isnan(values).all()  # else nothing reports it, such as the hold time without a shake
    return beyond | (~succeeded & (whole_episode | (np.isnan(values) & measured)))


def _strata(results: ExperimentResults) -> NDArray[np.int64]:
    """Returns the number of the combination of other factors' levels of each episode, shape (episodes,)."""
    strata = np.zeros(len(results.episodes), dtype=np.int64)
    for factor in other_factors(results):
        codes, levels = pd.factorize(results.episodes[factor.name])
        strata = strata * (len(levels) + 1) + codes
    return strata
