# SPDX-License-Identifier: BSD-3-Clause
"""Turns the episodes of an experiment into what is compared: the values of a metric, by method and in pairs.

The one place that decides what an episode counts for that failed, timed out, broke or has no value:

- success: every episode that is not a success is a failure, a broken one too;
- any other metric that is no rate: an episode without success counts as worse than any value if the metric is one of
  the whole task (outside the mode `task`: whatever the metric), or if it has no value. In a mean it counts at the
  metric's limit, where the metric has one, and so does a value beyond the limit;
- a rate without a value, a metric that no episode has a value of, and a success without a value: missing. It is left
  out of the figures, and counted.

It also decides which episodes are independent: those that share what was drawn for a trial, a problem or a seed, are
one unit.
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

OUTSIDE = (EpisodeStatus.BROKEN, EpisodeStatus.INVALID)
"""Ends of episodes whose cause lies outside the methods where every episode of every method has one."""

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Observations:
    """A metric in a number of episodes.

    Attributes:
        values: Value in each episode for a mean, NaN where it has none, shape (n,).
        scores: Value in each episode for a rank: infinitely bad for a failure, NaN where it is missing, shape (n,).
        censored: Whether it counts at the limit, shape (n,).
        broken: Whether the episode is broken, shape (n,).
        units: Number of the independent unit of each episode, shape (n,).
    """

    values: Floats
    scores: Floats
    censored: Flags
    broken: Flags
    units: Integers

    def of(self, rows: Integers) -> Observations:
        """Returns the metric in some of the episodes, by their places."""
        return Observations(*(getattr(self, field.name)[rows] for field in dataclasses.fields(self)))


@dataclass(frozen=True, slots=True)
class Pairs:
    """A metric in pairs of episodes, none of them missing.

    Attributes:
        first: The first method's episodes.
        second: Those of the second, in the order of their partners.
        missing: How many pairs were left out because a value is missing.
        unmatched: How many episodes of either method have no partner.
        at_random: Whether the partners share nothing but the levels of the other factors.
    """

    first: Observations
    second: Observations
    missing: int
    unmatched: int
    at_random: bool

    def __len__(self) -> int:
        return len(self.first.values)

    @property
    def broken(self) -> Flags:
        """Returns whether an episode of each pair is broken."""
        return np.asarray(self.first.broken | self.second.broken)

    def kept(self, which: Flags) -> Pairs:
        """Returns some of the pairs."""
        places = np.flatnonzero(which)
        return dataclasses.replace(self, first=self.first.of(places), second=self.second.of(places))

    def of_complete_units(self) -> Pairs:
        """Returns the pairs of units that are finished: those with as many pairs as any unit has."""
        if not len(self):
            return self
        _, units, sizes = np.unique(self.first.units, return_inverse=True, return_counts=True)
        return self.kept(sizes[units] == sizes.max())

    def outcomes(self, better: Direction) -> Floats:
        """Returns 1 for each pair in which the first is better, -1 for the second, 0 for a tie; two failures tie."""
        sign = 1.0 if better is Direction.HIGHER else -1.0
        first, second = self.first.scores, self.second.scores
        return sign * ((first > second).astype(float) - (first < second))


def unit_means(values: Floats, units: Integers) -> tuple[Floats, Integers]:
    """Returns the mean value and the number of values of each unit."""
    _, places, sizes = np.unique(units, return_inverse=True, return_counts=True)
    return np.asarray(np.bincount(places, values) / sizes), sizes


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
        self._strata = _strata(results)
        self._units, self.unit_noun = _units(results, self._strata)
        trials = episodes["trial"].to_numpy(np.int64)
        self._keys = self._strata * (int(trials.max(initial=0)) + 1) + trials
        self.unit_count, self.trial_count = len(np.unique(self._units)), len(np.unique(self._keys))
        of_method = episodes[results.description.compared].to_numpy()
        self._rows = {method: np.flatnonzero(of_method == method) for method in methods_of(results)}
        for method, rows in self._rows.items():
            self._check_unique(method, rows)
        self._columns: dict[str, Observations] = {}

    def observations(self, metric: Metric, method: str) -> Observations:
        """Returns a metric in every finished episode of a method."""
        return self._column(metric).of(self._rows[method])

    def counts(self, metric: Metric, method: str) -> EpisodeCounts:
        """Returns how the episodes of a method ended and what became of them in the figures of a metric."""
        statuses = self._statuses[self._rows[method]]
        seen = self.observations(metric, method)
        present = ~np.isnan(seen.scores)

        def ended(status: EpisodeStatus) -> int:
            return int(np.sum(statuses == status.value))

        return EpisodeCounts(
            episodes=len(statuses),
            succeeded=ended(EpisodeStatus.SUCCEEDED),
            failed=ended(EpisodeStatus.FAILED) + ended(EpisodeStatus.INVALID),
            timed_out=ended(EpisodeStatus.TIMED_OUT),
            broken=ended(EpisodeStatus.BROKEN),
            counted=int(present.sum()),
            censored=int(seen.censored.sum()),
            missing=int((~present).sum()),
            units=len(np.unique(seen.units[present])),
        )

    def pairs(self, metric: Metric, first: str, second: str) -> Pairs:
        """Returns a metric in the pairs of two methods: same trial, same levels of the other factors.

        Where in the end no two episodes have the same trial and levels, those with the same levels are paired in order.
        """
        rows = self._rows[first], self._rows[second]
        keys = [self._keys[of_method] for of_method in rows]
        finished = len(self._succeeded) >= self.results.planned
        at_random = finished and not np.isin(keys[0], keys[1]).any()
        if at_random:
            keys = [_order_within(self._strata[of_method]) for of_method in rows]
        _, *places = np.intersect1d(keys[0], keys[1], assume_unique=True, return_indices=True)
        column = self._column(metric)
        sides = [column.of(of_method[place]) for of_method, place in zip(rows, places, strict=True)]
        count = len(sides[0].scores)
        found = Pairs(sides[0], sides[1], 0, len(rows[0]) + len(rows[1]) - 2 * count, at_random)
        found = found.kept(~np.isnan(sides[0].scores) & ~np.isnan(sides[1].scores))
        return dataclasses.replace(found, missing=count - len(found))

    def _column(self, metric: Metric) -> Observations:
        """Returns a metric in every episode."""
        if metric.name not in self._columns:
            self._columns[metric.name] = self._read(metric)
        return self._columns[metric.name]

    def _read(self, metric: Metric) -> Observations:
        count = len(self._succeeded)
        if metric.name == SUCCESS.name:
            values = self._succeeded.astype(float)
            return Observations(values, values, np.zeros(count, dtype=bool), self._broken, self._units)
        values = np.full(count, np.nan)
        if metric.name in self.results.episodes:
            values = pd.to_numeric(self.results.episodes[metric.name]).to_numpy(float).copy()
        values[~np.isfinite(values) | self._broken] = np.nan
        scores, failed = values.copy(), self._failed(values, metric)
        scores[failed] = -np.inf if metric.better is Direction.HIGHER else np.inf
        censored = np.zeros(count, dtype=bool)
        if metric.limit is not None:
            censored = failed | (values >= metric.limit if metric.better is Direction.LOWER else values <= metric.limit)
            values[censored] = metric.limit
        return Observations(values, scores, censored, self._broken, self._units)

    def _failed(self, values: Floats, metric: Metric) -> Flags:
        """Returns which episodes count as worse than any value."""
        if metric.kind is MetricKind.RATE or np.isnan(values).all():  # nothing reports it: the hold time, unshaken
            return np.zeros(len(values), dtype=bool)
        whole_episode = metric.component == "task" or self.results.description.mode != "task"
        return np.asarray(~self._succeeded & (whole_episode | np.isnan(values)))

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


def outside_reason(results: ExperimentResults) -> str:
    """Returns why nothing was measured: every episode of every method ended for a reason outside the methods, else "".

    Such reasons are a launch that died, a simulation that was never ready, a world that was changed from outside.
    """
    episodes = results.episodes
    if episodes.empty or not episodes["status"].isin([status.value for status in OUTSIDE]).all():
        return ""
    causes = episodes["cause"].astype(str).value_counts()
    return (
        "every episode of every method ended for a reason outside the methods, so nothing is compared; the most "
        f"frequent ({causes.iloc[0]:,} of {len(episodes):,}): {causes.index[0] or 'no cause was recorded'}"
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


def _strata(results: ExperimentResults) -> NDArray[np.int64]:
    """Returns the number of the combination of other factors' levels of each episode, shape (episodes,)."""
    strata = np.zeros(len(results.episodes), dtype=np.int64)
    for factor in other_factors(results):
        codes, levels = pd.factorize(results.episodes[factor.name])
        strata = strata * (len(levels) + 1) + codes
    return strata


def _units(results: ExperimentResults, strata: Integers) -> tuple[Integers, str]:
    """Returns the number of the independent unit of each episode, and what a unit is.

    A unit is what was drawn for a trial. Problems and seeds that are crossed: the coarser of the two. A problem that is
    the only one at its levels was not drawn.
    """
    episodes = results.episodes
    seeds = pd.factorize(episodes["seed"])[0].astype(np.int64)
    if "drawn_problem" in episodes:
        problems = pd.factorize(episodes["drawn_problem"])[0].astype(np.int64)
        of_levels = len(np.unique(np.stack([strata, problems]), axis=1).T)
        if of_levels > len(np.unique(strata)) and len(np.unique(problems)) <= len(np.unique(seeds)):
            return problems, "problem"
    return seeds, "scene" if results.description.mode in ("task", "grasps") else "seed"


def _order_within(strata: Integers) -> Integers:
    """Returns a key of each episode's levels and its place among those with the same levels."""
    places = pd.Series(strata).groupby(strata).cumcount().to_numpy(np.int64)
    return np.asarray(strata * (len(strata) + 1_000_000_000) + places)
