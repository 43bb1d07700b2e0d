# SPDX-License-Identifier: BSD-3-Clause
"""Simulates experiments to see whether the statistics keep what they say.

Scenes differ in difficulty, so that the episodes of a pair go together as those of real pairs do.
Each simulation runs a number of experiments and returns how many of them claim a difference, cover the true figure, or
show the difference that they were planned for.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from dataclasses import replace
from unittest import mock

import numpy as np
import pandas as pd
from scipy import stats

from modular_framework_benchmark.records.experiment import (
    Direction,
    ExperimentDescription,
    Factor,
    Metric,
    MetricKind,
)
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics import power, rates, sequential, values, verdicts
from modular_framework_benchmark.statistics.analysis import compare
from modular_framework_benchmark.statistics.comparison import Verdict

SHOWN = (Verdict.FIRST_BETTER, Verdict.SECOND_BETTER)
METRICS = (
    Metric("task_time", "task", MetricKind.TIME, Direction.LOWER, "s", limit=60.0),
    Metric("planning_time", "planning", MetricKind.TIME, Direction.LOWER, "s"),
    Metric("path_length", "planning", MetricKind.VALUE, Direction.LOWER, "rad"),
    Metric("clearance", "planning", MetricKind.VALUE, Direction.HIGHER, "m"),
)
DIFFERENCE, ODDS = np.array([-1.0, 0.0, 1.0]), 0.95


Simulation = Callable[[np.random.Generator, int], int]
"""Runs a number of experiments and returns how many of them claim, cover or show."""


def leave_out_what_decides_nothing() -> None:
    """Leaves out, in this process, what takes most of the time and changes no verdict.

    That is the number of pairs to plan next, which only a sentence has, and the collection of garbage that statsmodels
    does in each of Holm's corrections.
    """
    verdicts.pairs_for_rate = verdicts.pairs_for_value = lambda *_: None  # type: ignore[assignment]
    gc.collect = lambda *_: 0  # type: ignore[assignment]


def results(generator: np.random.Generator, pairs: int, methods: int, metrics: int, objects: int = 1,
            sequential: bool = False, broken: float = 0.01, easier: float = 0.0) -> ExperimentResults:  # fmt: skip
    """Returns an experiment with methods that are identical, or of which the first succeeds more often.

    Args:
        generator: What outcomes are drawn with.
        pairs: Episodes of each method.
        methods: How many methods.
        metrics: How many metrics beside success.
        objects: Objects that share the seeds, and so the difficulty, of a trial.
        sequential: Whether a stopping rule looks at the results.
        broken: Share of episodes that break.
        easier: What the first method's rate is above the others'.
    """
    trials = pairs // objects
    ease = np.repeat(generator.beta(3.0, 1.0, trials), objects)[:, None]
    better = np.where(np.arange(methods) == 0, easier, 0.0)
    success = generator.random((pairs, methods)) < np.clip(ease + better, 0.0, 1.0)
    dead = generator.random((pairs, methods)) < broken
    names = tuple("abcdef"[:methods])
    table = {
        "number": np.arange(pairs * methods),
        "trial": np.repeat(np.arange(pairs) // objects, methods),
        "seed": np.repeat(np.arange(pairs) // objects, methods),
        "object": np.repeat(np.arange(pairs) % objects, methods).astype(str),
        "method": np.tile(names, pairs),
        "success": (success & ~dead).ravel(),
        "status": np.where(dead, "broken", np.where(success, "succeeded", "failed")).ravel(),
        "simulated_s": np.full(pairs * methods, 10.0),
    }
    for number, metric in enumerate(METRICS[:metrics]):
        drawn = np.exp(generator.normal(2.0 - ease, 0.5 + 0.25 * number, (pairs, methods)))
        table[metric.name] = np.where(success, drawn, np.nan).ravel()
    factors = (Factor("method", names), Factor("object", tuple(str(number) for number in range(objects))))
    description = ExperimentDescription(
        "simulated", "task", "", "", factors, "method", METRICS[:metrics], 60.0, sequential=sequential
    )
    return ExperimentResults(description, pd.DataFrame(table), pd.DataFrame(), pairs * methods)


def claims(generator: np.random.Generator, count: int, **layout: int) -> int:
    """Returns how many experiments with identical methods claim a difference in anything.

    The bootstrap has fewer resamples than in a report: a claim needs a corrected p value that is small enough, and the
    interval can only take a claim back.
    """
    with mock.patch.object(values, "RESAMPLES", 399):
        return sum(
            any(found.verdict in SHOWN for found in compare(results(generator, **layout)))  # type: ignore[arg-type]
            for _ in range(count)
        )


def looking(generator: np.random.Generator, count: int, pairs: int, methods: int) -> int:
    """Returns how many experiments ever claim a difference in success with a look after every pair."""
    ever = 0
    for _ in range(count):
        ease = generator.beta(3.0, 1.0, (pairs, 1))
        success = (generator.random((pairs, methods)) < ease).astype(int)
        of_pairs = [
            np.exp(-sequential.log_capital(DIFFERENCE, _running_counts(success[:, one] - success[:, other])))
            for one in range(methods)
            for other in range(one + 1, methods)
        ]
        # Holm's least corrected p value is the least p value times their number: it decides whether anything is shown.
        ever += bool(np.min(of_pairs) * len(of_pairs) <= 1 - ODDS)
    return ever


def stopping(generator: np.random.Generator, count: int, pairs: int, step: int) -> int:
    """Returns how many experiments ever claim a difference in anything, when all of it is looked at again and again."""
    ever = 0
    for _ in range(count):
        whole = results(generator, pairs, 3, 2, sequential=True)
        ever += any(
            found.verdict in SHOWN
            for looked in range(step, pairs + 1, step)
            for found in compare(replace(whole, episodes=whole.episodes.iloc[: 3 * looked]))
        )
    return ever


def peeking(generator: np.random.Generator, count: int, pairs: int) -> int:
    """Returns how many experiments ever have p <= 0.05 by McNemar's test after some pair: why looking needs a rule."""
    ever = 0
    for _ in range(count):
        ease = generator.beta(3.0, 1.0, (pairs, 1))
        success = (generator.random((pairs, 2)) < ease).astype(int)
        counts = _running_counts(success[:, 0] - success[:, 1]).astype(int)
        different = np.unique(counts[:, [0, 2]], axis=0)
        ever += any(_mcnemar(int(one), int(other)) <= 0.05 for other, one in different)
    return ever


def pooling(generator: np.random.Generator, count: int, seeds: int, objects: int) -> int:
    """Returns how many experiments McNemar's test claims a difference in if pairs of one seed count as independent."""
    ever = 0
    for _ in range(count):
        # The seed decides the outcome for each method, whatever the object: the worst case.
        success = np.repeat((generator.random((seeds, 2)) < 0.8).astype(int), objects, axis=0)
        differences = success[:, 0] - success[:, 1]
        ever += _mcnemar(int(np.sum(differences > 0)), int(np.sum(differences < 0))) <= 0.05
    return ever


_P_VALUES: dict[tuple[int, int], float] = {}


def _mcnemar(one: int, other: int) -> float:
    if (one, other) not in _P_VALUES:
        _P_VALUES[one, other] = rates.paired_p_value(rates.Discordance(one, other, one + other))
    return _P_VALUES[one, other]


def _running_counts(differences: np.ndarray) -> np.ndarray:
    """Returns how often -1, 0 and 1 were seen after each pair, shape (pairs, 3)."""
    return np.cumsum(differences[:, None] == DIFFERENCE[None, :], axis=0).astype(float)


def covers_rate(generator: np.random.Generator, count: int, episodes: int, method: str) -> int:
    """Returns how many intervals hold the true rate; rates from 30 to 98 %."""
    true = generator.uniform(0.3, 0.98, count)
    found = [rates.rate_interval(int(generator.binomial(episodes, rate)), episodes, ODDS, method) for rate in true]  # type: ignore[arg-type]
    return sum(each.low <= rate <= each.high for each, rate in zip(found, true, strict=True))


def covers_paired_rate(generator: np.random.Generator, count: int, pairs: int, easier: float) -> int:
    """Returns how many of Tango's intervals hold the true difference of paired rates."""
    covered = 0
    for _ in range(count):
        ease = generator.beta(3.0, 1.0, pairs)
        first = generator.random(pairs) < ease + easier * (1 - ease)
        second = generator.random(pairs) < ease
        interval = rates.paired_interval(rates.Discordance.of(first.astype(float), second.astype(float)))
        covered += interval.low <= easier * 0.25 <= interval.high  # the mean of 1 - ease is a quarter
    return covered


def covers_sequence(generator: np.random.Generator, count: int, pairs: int, easier: float) -> int:
    """Returns how many anytime intervals of paired rates hold the true difference at every look."""
    covered = 0
    for _ in range(count):
        ease = generator.beta(3.0, 1.0, pairs)
        first = generator.random(pairs) < ease + easier * (1 - ease)
        second = generator.random(pairs) < ease
        counts = _running_counts(first.astype(int) - second.astype(int))
        capital = sequential.log_capital(DIFFERENCE, counts, easier * 0.25)
        covered += bool(np.max(capital) < -np.log(1 - ODDS))
    return covered


def covers_mean(generator: np.random.Generator, count: int, pairs: int, shift: float, strata: int = 1) -> int:
    """Returns how many intervals hold the true mean difference of two log-normal times, cut off at a limit."""
    which = np.arange(pairs) % strata
    true = _mean_of_times(0.5 * shift) - _mean_of_times(-0.5 * shift)
    covered = 0
    for _ in range(count):
        scene = generator.normal(0.0, 0.5, pairs)
        first, second = (np.minimum(np.exp(generator.normal(scene + side * shift, 0.8)), 5.0) for side in (0.5, -0.5))
        interval = values.mean_interval(first - second, which, ODDS, generator)
        covered += interval is not None and interval.low <= true <= interval.high
    return covered


def _mean_of_times(centre: float, limit: float = 5.0) -> float:
    """Returns the mean of a log-normal time that is cut off at a limit: scene and method spread it by 0.5 and 0.8."""
    spread, end = np.hypot(0.5, 0.8), np.log(limit)
    below = np.exp(centre + spread**2 / 2) * stats.norm.cdf((end - centre) / spread - spread)
    return float(below + limit * stats.norm.sf((end - centre) / spread))


def covers_interquartile_mean(generator: np.random.Generator, count: int, episodes: int) -> int:
    """Returns how many intervals hold the true interquartile mean of a log-normal value."""
    ends = stats.norm.ppf([0.25, 0.75]) - 0.8
    true = np.exp(0.8**2 / 2) * np.diff(stats.norm.cdf(ends))[0] / 0.5
    covered = 0
    for _ in range(count):
        drawn = np.exp(generator.normal(0.0, 0.8, episodes))
        interval = values.interquartile_mean_interval(drawn, np.zeros(episodes, dtype=np.int64), ODDS, generator)
        covered += interval.low <= true <= interval.high
    return covered


def shows_rate(generator: np.random.Generator, count: int, difference: float, discordance: float) -> int:
    """Returns how many experiments with the planned number of pairs show a difference of rates."""
    pairs = power.pairs_for_rate(difference, discordance)
    assert pairs is not None
    shares = [(discordance - difference) / 2, 1 - discordance, (discordance + difference) / 2]
    return sum(
        _mcnemar(int(one), int(other)) <= 0.05 and one > other
        for other, _, one in generator.multinomial(pairs, shares, count)
    )


def shows_value(generator: np.random.Generator, count: int, difference: float) -> int:
    """Returns how many experiments with the planned number of pairs show a difference of normal values."""
    pairs = power.pairs_for_value(difference, 1.0)
    assert pairs is not None
    return sum(values.paired_p_value(generator.normal(difference, 1.0, pairs)) <= 0.05 for _ in range(count))
