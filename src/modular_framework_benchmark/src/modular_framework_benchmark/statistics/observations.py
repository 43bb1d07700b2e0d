# SPDX-License-Identifier: BSD-3-Clause
"""Converts episodes into the observations that the statistics use: metric values per method and in pairs.

This module defines the value of an episode that failed, timed out, broke or lacks a value:

- Success: every episode that does not succeed is a failure, including broken and invalid episodes.
- Other metrics except rates and partial credit: an unsuccessful episode ranks worse than any value if the metric
  describes the whole task (outside the mode `task`, for every metric) or if the episode has no value. Its value in a
  mean is the metric's limit, if there is one. Values beyond the limit also count at the limit.
- Partial credit: every episode has its own value; an episode without a value, such as a broken or invalid episode,
  counts as 0.
- Missing: a rate without a value, a metric without a value in any episode, a successful episode without a value.
  Missing values are excluded from the figures and counted.

Real and processor times are compared only between two first episodes of their stacks or two later episodes, and only
between episodes with the same number of workers on the machine.

The module also defines the independent units: episodes that share a drawn problem or seed belong to one unit.
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
from modular_framework_benchmark.records.results import COLD_START, WORKER_COUNT, ExperimentResults
from modular_framework_benchmark.statistics.comparison import EpisodeCounts

SUCCESS = Metric("success", "task", MetricKind.RATE, Direction.HIGHER, description="The episode succeeded.")

UNMEASURED_STATUSES = (EpisodeStatus.BROKEN, EpisodeStatus.INVALID)
"""Statuses that say nothing about the methods if every episode of every method has one of them."""

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Observations:
    """Observations of a metric in n episodes.

    Attributes:
        values: Values for means, NaN if there is none, shape (n,).
        scores: Values for ranks: infinitely bad for failures, NaN if missing, shape (n,).
        censored: Whether each value counts at the limit, shape (n,).
        broken: Whether each episode is broken or invalid, shape (n,).
        units: Index of each episode's independent unit, shape (n,).
    """

    values: Floats
    scores: Floats
    censored: Flags
    broken: Flags
    units: Integers

    def at_rows(self, rows: Integers) -> Observations:
        """Returns the observations of the episodes with these indices."""
        return Observations(*(getattr(self, field.name)[rows] for field in dataclasses.fields(self)))


@dataclass(frozen=True, slots=True)
class Pairs:
    """Observations of a metric in pairs of episodes, without missing values.

    Attributes:
        first: Observations of the first method.
        second: Observations of the second method, in the order of their partners.
        missing: Number of pairs excluded because a value is missing.
        unlike: Number of pairs excluded because only one episode is the first of its stack, or because the numbers of
            workers differ.
        unmatched: Number of episodes without a partner.
        at_random: Whether partners share only the levels of the other factors.
    """

    first: Observations
    second: Observations
    missing: int
    unlike: int
    unmatched: int
    at_random: bool

    def __len__(self) -> int:
        return len(self.first.values)

    @property
    def broken(self) -> Flags:
        """Returns whether either episode of each pair is broken or invalid, shape (n,)."""
        return np.asarray(self.first.broken | self.second.broken)

    def select(self, mask: Flags) -> Pairs:
        """Returns the pairs that the mask selects."""
        rows = np.flatnonzero(mask)
        return dataclasses.replace(self, first=self.first.at_rows(rows), second=self.second.at_rows(rows))

    def complete_units(self) -> Pairs:
        """Returns the pairs of complete units, those with as many pairs as the largest unit."""
        if not len(self):
            return self
        _, units, sizes = np.unique(self.first.units, return_inverse=True, return_counts=True)
        return self.select(sizes[units] == sizes.max())

    def outcomes(self, better: Direction) -> Floats:
        """Returns 1 for each pair that the first method wins, -1 if the second wins, 0 for a tie or two failures."""
        sign = 1.0 if better is Direction.HIGHER else -1.0
        first, second = self.first.scores, self.second.scores
        return sign * ((first > second).astype(float) - (first < second))


def unit_means(values: Floats, units: Integers) -> tuple[Floats, Integers]:
    """Returns the mean value and the number of values of each unit."""
    _, places, sizes = np.unique(units, return_inverse=True, return_counts=True)
    return np.asarray(np.bincount(places, values) / sizes), sizes


def metrics_of(results: ExperimentResults) -> tuple[Metric, ...]:
    """Returns the compared metrics: success first, then the others in the order of the experiment."""
    described = results.description.metrics
    success = next((metric for metric in described if metric.name == SUCCESS.name), SUCCESS)
    return (success, *(metric for metric in described if metric.name != SUCCESS.name))


def methods_of(results: ExperimentResults) -> tuple[str, ...]:
    """Returns the methods in the order of the experiment.

    Raises:
        ValueError: The experiment lacks the compared factor.
    """
    return _factor(results, results.description.compared).levels


def other_factors(results: ExperimentResults) -> tuple[Factor, ...]:
    """Returns the factors except the compared one."""
    return tuple(factor for factor in results.description.factors if factor.name != results.description.compared)


def restrict_results(results: ExperimentResults, factor: str, *levels: str) -> ExperimentResults:
    """Returns the results of the episodes at some levels of a factor.

    Args:
        results: Results of the experiment.
        factor: Name of the factor.
        *levels: Labels of the levels.

    Raises:
        ValueError: The experiment lacks the factor.
    """
    _factor(results, factor)
    chosen = results.episodes[results.episodes[factor].isin(levels)]
    finished = len(results.episodes) >= results.planned
    return dataclasses.replace(results, episodes=chosen, planned=len(chosen) if finished else results.planned)


class EpisodeTable:
    """Finished episodes of an experiment, indexed once for all metrics and pairs of methods."""

    def __init__(self, results: ExperimentResults) -> None:
        """Reads the columns of the episodes.

        Args:
            results: Finished episodes.

        Raises:
            ValueError: The experiment lacks the compared factor, or two episodes have the same method, levels and
                trial.
        """
        methods_of(results)
        self.results = results
        episodes = results.episodes
        self._succeeded = episodes["success"].to_numpy(bool)
        self._statuses = episodes["status"].to_numpy()
        self._broken = np.isin(self._statuses, [status.value for status in UNMEASURED_STATUSES])
        first_of_stack = episodes[COLD_START] if COLD_START in episodes else np.zeros(len(episodes), dtype=bool)
        self._first_of_stack = np.asarray(first_of_stack, dtype=bool)
        workers = episodes[WORKER_COUNT] if WORKER_COUNT in episodes else np.zeros(len(episodes), dtype=np.int64)
        self._workers = np.asarray(workers, dtype=np.int64)
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
        """Returns the observations of a metric in every finished episode of a method."""
        return self._column(metric).at_rows(self._rows[method])

    def numbers(self, method: str) -> Integers:
        """Returns the numbers of a method's finished episodes, in the order of `observations`."""
        return self.results.episodes["number"].to_numpy(np.int64)[self._rows[method]]

    def counts(self, metric: Metric, method: str) -> EpisodeCounts:
        """Returns the numbers of a method's episodes by outcome and by their part in a metric's figures."""
        statuses = self._statuses[self._rows[method]]
        observed = self.observations(metric, method)
        present = ~np.isnan(observed.scores)

        def count_status(status: EpisodeStatus) -> int:
            return int(np.sum(statuses == status.value))

        return EpisodeCounts(
            episodes=len(statuses),
            succeeded=count_status(EpisodeStatus.SUCCEEDED),
            failed=count_status(EpisodeStatus.FAILED),
            timed_out=count_status(EpisodeStatus.TIMED_OUT),
            broken=count_status(EpisodeStatus.BROKEN),
            invalid=count_status(EpisodeStatus.INVALID),
            counted=int(present.sum()),
            censored=int(observed.censored.sum()),
            missing=int((~present).sum()),
            units=len(np.unique(observed.units[present])),
        )

    def pairs(self, metric: Metric, first: str, second: str) -> Pairs:
        """Returns the observations of a metric in pairs of episodes with the same trial and other levels.

        If no trial occurs in both methods of a finished experiment, episodes with the same levels are paired in order.

        Args:
            metric: Compared metric.
            first: First method.
            second: Second method.
        """
        rows = self._rows[first], self._rows[second]
        keys = [self._keys[of_method] for of_method in rows]
        finished = len(self._succeeded) >= self.results.planned
        at_random = finished and not np.isin(keys[0], keys[1]).any()
        if at_random:
            keys = [_order_within(self._strata[of_method]) for of_method in rows]
        _, *places = np.intersect1d(keys[0], keys[1], assume_unique=True, return_indices=True)
        column = self._column(metric)
        paired = [of_method[place] for of_method, place in zip(rows, places, strict=True)]
        sides = [column.at_rows(of_method) for of_method in paired]
        count = len(paired[0])
        alike = np.ones(count, dtype=bool)
        if metric.depends_on_machine:
            alike = self._are_alike(*paired)
        present = ~np.isnan(sides[0].scores) & ~np.isnan(sides[1].scores)
        missing, unlike = int(np.sum(~present)), int(np.sum(present & ~alike))
        pairs = Pairs(sides[0], sides[1], missing, unlike, len(rows[0]) + len(rows[1]) - 2 * count, at_random)
        return pairs.select(present & alike)

    def _are_alike(self, first: Integers, second: Integers) -> Flags:
        """Returns whether the real times of the episodes in each pair are comparable, shape (pairs,).

        Args:
            first: Row of each pair's first episode.
            second: Row of each pair's second episode.
        """
        workers = self._workers[first], self._workers[second]
        unknown = (workers[0] == 0) | (workers[1] == 0)
        same_workers = unknown | (workers[0] == workers[1])
        return np.asarray(same_workers & (self._first_of_stack[first] == self._first_of_stack[second]))

    def _column(self, metric: Metric) -> Observations:
        """Returns the observations of a metric in every episode."""
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
        if metric.kind is MetricKind.PARTIAL_CREDIT and not np.isnan(values).all():
            values = np.clip(np.nan_to_num(values, nan=0.0), 0.0, 1.0)
        scores, failed = values.copy(), self._failure_flags(values, metric)
        scores[failed] = -np.inf if metric.better is Direction.HIGHER else np.inf
        censored = np.zeros(count, dtype=bool)
        if metric.limit is not None:
            censored = failed | (values >= metric.limit if metric.better is Direction.LOWER else values <= metric.limit)
            values[censored] = metric.limit
        return Observations(values, scores, censored, self._broken, self._units)

    def _failure_flags(self, values: Floats, metric: Metric) -> Flags:
        """Returns whether each episode ranks worse than any value."""
        if metric.is_fraction or np.isnan(values).all():  # never reported, such as the hold time
            return np.zeros(len(values), dtype=bool)
        whole_episode = metric.component == "task" or self.results.description.mode != "task"
        return np.asarray(~self._succeeded & (whole_episode | np.isnan(values)))

    def _check_unique(self, method: str, rows: NDArray[np.int64]) -> None:
        _, places = np.unique(self._keys[rows], return_index=True)
        if len(places) == len(rows):
            return
        row = self.results.episodes.iloc[np.setdiff1d(rows, rows[places])[0]]
        names = [factor.name for factor in other_factors(self.results)] + ["trial"]
        first_levels = ", ".join(f"{name}={row[name]}" for name in names)
        raise ValueError(
            f"two episodes of method {method} have {first_levels}; each combination of levels and trial must occur once"
        )


def unmeasured_reason(results: ExperimentResults) -> str:
    """Returns the reason if every episode of every method ended for a cause outside the methods, otherwise "".

    Examples of such causes: the launch died, the simulation never became ready, the world was changed from outside.
    """
    episodes = results.episodes
    if episodes.empty or not episodes["status"].isin([status.value for status in UNMEASURED_STATUSES]).all():
        return ""
    causes = episodes["cause"].astype(str).value_counts()
    return (
        "every episode of every method ended for a reason outside the methods, so nothing is compared; the most "
        f"frequent ({causes.iloc[0]:,} of {len(episodes):,}): {causes.index[0] or 'no cause was recorded'}"
    )


def pairs_of_methods(results: ExperimentResults) -> tuple[tuple[str, str], ...]:
    """Returns every pair of methods in the order of the experiment."""
    return tuple(combinations(methods_of(results), 2))


def _factor(results: ExperimentResults, name: str) -> Factor:
    for factor in results.description.factors:
        if factor.name == name:
            return factor
    known_factors = ", ".join(factor.name for factor in results.description.factors) or "none"
    raise ValueError(
        f"experiment '{results.description.name}' has no factor '{name}'; its factors are: {known_factors}"
    )


def _strata(results: ExperimentResults) -> NDArray[np.int64]:
    """Returns the index of each episode's combination of the other factors' levels, shape (episodes,)."""
    strata = np.zeros(len(results.episodes), dtype=np.int64)
    for factor in other_factors(results):
        codes, levels = pd.factorize(results.episodes[factor.name])
        strata = strata * (len(levels) + 1) + codes
    return strata


def _units(results: ExperimentResults, strata: Integers) -> tuple[Integers, str]:
    """Returns the index of each episode's independent unit, and the noun for a unit.

    A unit is a problem or seed that was drawn for a trial; of crossed problems and seeds, the coarser partition. A
    problem that is the only one at its levels was not drawn.
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
    """Returns a key that combines each episode's stratum with its rank within the stratum."""
    places = pd.Series(strata).groupby(strata).cumcount().to_numpy(np.int64)
    return np.asarray(strata * (len(strata) + 1_000_000_000) + places)
