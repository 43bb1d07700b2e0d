# SPDX-License-Identifier: BSD-3-Clause
"""Exact probabilities of claims and intervals: all outcomes of n pairs, with their probabilities by SciPy."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from modular_framework_benchmark.statistics.comparison import Interval
from modular_framework_benchmark.statistics.rates import (
    PairOutcomes,
    paired_interval,
    paired_p_value,
    rate_interval,
    score_interval,
)

Floats = NDArray[np.float64]
IntervalOf = Callable[[PairOutcomes], Interval]
ERROR = 0.05
ROUNDING = 1e-9  # of the sum of up to 5,151 probabilities, and of a difference at the end of an interval
NEAR_ZERO = (0.0, 0.001, 0.002, 0.003, 0.005, 0.007, 0.01, 0.015, 0.02, 0.03, 0.04)
PROBABILITIES = np.unique(np.round([*NEAR_ZERO, *(1.0 - np.array(NEAR_ZERO)), *np.linspace(0.0, 1.0, 41)], 6))
RATES = np.unique([*np.linspace(0.0, 1.0, 2001), *np.linspace(0.0, 0.02, 2001), *np.linspace(0.98, 1.0, 2001)])


@dataclass(frozen=True)
class Extreme:
    """Most unfavourable probability, and where on the grid it is."""

    probability: float
    pairs: int
    at: tuple[float, ...]

    def text(self) -> str:
        """Returns the probability in percent with its place."""
        place = ", ".join(f"{value:g}" for value in self.at)
        return f"{100.0 * self.probability:6.2f} %  {self.pairs} pairs, true {place}"


@cache
def grid() -> Floats:
    """Returns the grid of true probabilities to win and to lose a pair, shape (points, 2)."""
    points = [(won, lost) for won in PROBABILITIES for lost in PROBABILITIES if won + lost <= 1.0 + ROUNDING]
    return np.array(points)


def outcomes_of(pairs: int) -> list[PairOutcomes]:
    """Returns all outcomes of a number of pairs."""
    return [PairOutcomes(won, lost, pairs) for won in range(pairs + 1) for lost in range(pairs + 1 - won)]


def probabilities_of(outcomes: list[PairOutcomes]) -> Floats:
    """Returns the probability of each outcome at each point of the grid, shape (outcomes, points)."""
    counts = np.array([(item.won, item.lost, item.pairs - item.won - item.lost) for item in outcomes])
    won, lost = grid().T
    chances = np.column_stack([won, lost, np.clip(1.0 - won - lost, 0.0, 1.0)])
    return np.asarray(stats.multinomial.pmf(counts[:, None, :], outcomes[0].pairs, chances[None, :, :]))


def swapped(interval: Interval) -> Interval:
    """Returns the interval of the exchanged methods."""
    return Interval(-interval.high, -interval.low, interval.confidence, interval.method)


def intervals_of(outcomes: list[PairOutcomes], interval_of: IntervalOf = paired_interval) -> Floats:
    """Returns the ends of each outcome's interval, shape (outcomes, 2); half of them by exchanging the methods."""
    found = {}
    for item in outcomes:
        mirror = (item.lost, item.won)
        found[item.won, item.lost] = swapped(found[mirror]) if mirror in found else interval_of(item)
    return np.array([(found[item.won, item.lost].low, found[item.won, item.lost].high) for item in outcomes])


def tango_interval(outcomes: PairOutcomes) -> Interval:
    """Returns Tango's score interval as published."""
    return score_interval(outcomes, 1.0 - ERROR, correction=0.0)


def covered(ends: Floats, probabilities: Floats) -> Floats:
    """Returns the coverage at each point of the grid."""
    true = grid()[:, 0] - grid()[:, 1]
    holds = (ends[:, :1] - ROUNDING <= true) & (true <= ends[:, 1:] + ROUNDING)
    return np.asarray((holds * probabilities).sum(axis=0))


def false_claims(outcomes: list[PairOutcomes], ends: Floats, probabilities: Floats) -> Floats:
    """Returns the probability of a claim with a wrong sign at each point of the grid."""
    true = np.sign(np.round(grid()[:, 0] - grid()[:, 1], 9))
    tested = np.array([paired_p_value(item) <= ERROR for item in outcomes])
    claimed = np.where(tested & (ends[:, 0] > 0.0), 1, np.where(tested & (ends[:, 1] < 0.0), -1, 0))
    wrong = (claimed != 0)[:, None] & (claimed[:, None] != true)
    return np.asarray((wrong * probabilities).sum(axis=0))


def extreme(values: Floats, pairs: int, choose: Callable[[Floats], np.intp], points: Floats) -> Extreme:
    """Returns the chosen value with its place."""
    place = int(choose(values))
    return Extreme(float(values[place]), pairs, tuple(map(float, np.atleast_1d(points[place]))))


def rate_coverage(pairs: int, interval: Callable[[int, int], tuple[float, float]]) -> Floats:
    """Returns the coverage of a rate's interval at each rate."""
    ends = np.array([interval(count, pairs) for count in range(pairs + 1)])
    chances = stats.binom.pmf(np.arange(pairs + 1)[:, None], pairs, RATES[None, :])
    holds = (ends[:, :1] - ROUNDING <= RATES) & (ends[:, 1:] + ROUNDING >= RATES)
    return np.asarray((holds * chances).sum(axis=0))


def printed_rate(count: int, pairs: int) -> tuple[float, float]:
    """Returns the interval of a rate as a report prints it."""
    interval = rate_interval(count, pairs)
    return interval.low, interval.high


def wilson(count: int, pairs: int) -> tuple[float, float]:
    """Returns Wilson's interval by SciPy."""
    interval = stats.binomtest(count, pairs).proportion_ci(0.95, "wilson")
    return float(interval.low), float(interval.high)


def figures_of(pairs: int) -> dict[str, Extreme]:
    """Returns the most unfavourable probabilities for a number of pairs."""
    outcomes = outcomes_of(pairs)
    chances = probabilities_of(outcomes)
    printed = intervals_of(outcomes)
    found = {
        "false claims": extreme(false_claims(outcomes, printed, chances), pairs, np.argmax, grid()),
        "win difference": extreme(covered(printed, chances), pairs, np.argmin, grid()),
        "rate": extreme(rate_coverage(pairs, printed_rate), pairs, np.argmin, RATES),
        "Wilson": extreme(rate_coverage(pairs, wilson), pairs, np.argmin, RATES),
    }
    tango = intervals_of(outcomes, tango_interval)
    found["Tango alone"] = extreme(covered(tango, chances), pairs, np.argmin, grid())
    return found


def worst_of(rows: Iterable[dict[str, Extreme]]) -> dict[str, Extreme]:
    """Returns the most unfavourable probability of each kind over all numbers of pairs."""
    rows = list(rows)
    return {
        kind: (max if kind == "false claims" else min)(
            (row[kind] for row in rows), key=lambda item: item.probability
        )
        for kind in rows[0]
    }  # fmt: skip
