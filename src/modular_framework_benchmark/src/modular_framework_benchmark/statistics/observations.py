# SPDX-License-Identifier: BSD-3-Clause
"""Turns the episodes of an experiment into what is compared: the values of a metric, by method and in pairs.

The one place that decides what an episode counts for that failed, timed out, broke or has no value:

- success: every episode that is not a success is a failure, a broken one too;
- a metric with a limit: an episode without a value counts at the limit, a value beyond the limit does too, and so does
  every episode without success if the metric is one of the whole task (outside the mode `task`: whatever the metric);
- any other metric: an episode without a value is missing. It is left out of the figures, and counted.
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


def observations(results: ExperimentResults, metric: Metric, method: str) -> Observations:
    """Returns a metric in every finished episode of a method."""
    table = _table(results, metric)
    chosen = table[table["method"] == method]
    return Observations(
        chosen["value"].to_numpy(float), chosen["censored"].to_numpy(bool), chosen["broken"].to_numpy(bool)
    )


def episode_counts(results: ExperimentResults, metric: Metric, method: str) -> EpisodeCounts:
    """Returns how the episodes of a method ended and what became of them in the figures of a metric."""
    of_method = results.episodes[results.description.compared] == method
    statuses = results.episodes.loc[of_method, "status"].value_counts()
    seen = observations(results, metric, method)
    missing = int(np.isnan(seen.values).sum())
    return EpisodeCounts(
        episodes=int(of_method.sum()),
        succeeded=int(statuses.get(EpisodeStatus.SUCCEEDED.value, 0)),
        failed=int(statuses.get(EpisodeStatus.FAILED.value, 0)),
        timed_out=int(statuses.get(EpisodeStatus.TIMED_OUT.value, 0)),
        broken=int(statuses.get(EpisodeStatus.BROKEN.value, 0)),
        counted=len(seen.values) - missing,
        censored=int(seen.censored.sum()),
        missing=missing,
    )


def pairs_of_methods(results: ExperimentResults) -> tuple[tuple[str, str], ...]:
    """Returns every pair of methods, as the experiment lists them."""
    return tuple(combinations(methods_of(results), 2))


def pairs(results: ExperimentResults, metric: Metric, first: str, second: str) -> Pairs:
    """Returns a metric in the pairs of two methods: same trial, same levels of the other factors.

    Raises:
        ValueError: Two episodes have the same method, levels and trial.
    """
    table = _table(results, metric)
    key = [factor.name for factor in other_factors(results)] + ["trial"]
    sides = [table[table["method"] == method] for method in (first, second)]
    for side in sides:
        _check_unique(side, key)
    joined = sides[0].merge(sides[1], on=key, suffixes=("_first", "_second"), sort=True)
    complete = joined[joined["value_first"].notna() & joined["value_second"].notna()]
    broken = complete[["broken_first", "broken_second"]].to_numpy(bool)
    return Pairs(
        first=complete["value_first"].to_numpy(float),
        second=complete["value_second"].to_numpy(float),
        units=pd.factorize(complete["seed_first"])[0].astype(np.int64),
        strata=_strata(complete, key[:-1]),
        broken=broken.any(axis=1),
        censored=int(complete[["censored_first", "censored_second"]].to_numpy(bool).sum()),
        broken_episodes=int(broken.sum()),
        missing=len(joined) - len(complete),
        unmatched=len(sides[0]) + len(sides[1]) - 2 * len(joined),
    )


def _factor(results: ExperimentResults, name: str) -> Factor:
    for factor in results.description.factors:
        if factor.name == name:
            return factor
    known = ", ".join(factor.name for factor in results.description.factors) or "none"
    raise ValueError(f"experiment '{results.description.name}' has no factor '{name}'; its factors are: {known}")


def _table(results: ExperimentResults, metric: Metric) -> pd.DataFrame:
    """Returns a row for each episode: what pairs are found by, `method`, `value`, `censored`, `broken`."""
    episodes = results.episodes
    succeeded = episodes["success"].to_numpy(bool)
    broken = (episodes["status"] == EpisodeStatus.BROKEN.value).to_numpy(bool)
    if metric.name == SUCCESS.name:
        values = succeeded.astype(float)
        censored = np.zeros(len(values), dtype=bool)
    else:
        column = pd.to_numeric(episodes[metric.name]) if metric.name in episodes else pd.Series(np.nan, episodes.index)
        values = column.to_numpy(float).copy()
        values[~np.isfinite(values)] = np.nan
        values[broken] = np.nan
        censored = _censored(values, succeeded, metric, results.description.mode)
        if metric.limit is not None:
            values[censored] = metric.limit
    columns = [factor.name for factor in other_factors(results)] + ["trial", "seed"]
    return episodes[columns].assign(
        method=episodes[results.description.compared],
        value=values,
        censored=censored,
        broken=broken,
    )


def _censored(values: Floats, succeeded: Flags, metric: Metric, mode: str) -> Flags:
    """Returns which episodes count at the metric's limit."""
    if metric.limit is None:
        return np.zeros(len(values), dtype=bool)
    beyond = values >= metric.limit if metric.better is Direction.LOWER else values <= metric.limit
    whole_episode = metric.component == "task" or mode != "task"
    return np.isnan(values) | beyond | (~succeeded if whole_episode else False)


def _check_unique(side: pd.DataFrame, key: list[str]) -> None:
    repeated = side[side.duplicated(key)]
    if len(repeated):
        found = ", ".join(f"{name}={repeated.iloc[0][name]}" for name in ["method", *key])
        raise ValueError(f"two episodes have {found}; an experiment has each combination and trial once")


def _strata(table: pd.DataFrame, names: list[str]) -> NDArray[np.int64]:
    if not names:
        return np.zeros(len(table), dtype=np.int64)
    return table.groupby(names, sort=True, observed=True).ngroup().to_numpy(np.int64)
