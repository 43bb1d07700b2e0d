# SPDX-License-Identifier: BSD-3-Clause
"""Rates: intervals of one, tests and intervals of the difference of two, paired or not."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.proportion import confint_proportions_2indep, proportion_confint

from modular_framework_benchmark.statistics.comparison import Interval

INTERVALS = {"wilson": "Wilson", "beta": "Clopper-Pearson"}


@dataclass(frozen=True, slots=True)
class Discordance:
    """Outcomes of pairs: how often the two methods differ, which is all that a paired comparison rests on.

    Attributes:
        first_only: Pairs in which only the first method was true.
        second_only: Pairs in which only the second was.
        pairs: All pairs.
    """

    first_only: int
    second_only: int
    pairs: int

    @classmethod
    def of(cls, first: NDArray[np.float64], second: NDArray[np.float64]) -> Discordance:
        """Returns that of the outcomes of each pair (0 or 1), shape (n,) each."""
        return cls(int(np.sum(first > second)), int(np.sum(second > first)), len(first))

    @property
    def difference(self) -> float:
        """Returns the difference of the rates, first minus second."""
        return (self.first_only - self.second_only) / self.pairs


def rate_interval(
    successes: int, episodes: int, confidence: float = 0.95, method: Literal["wilson", "beta"] = "wilson"
) -> Interval:
    """Returns the interval of a rate.

    Args:
        successes: Episodes that were true.
        episodes: All of them; with 0 the interval is all rates.
        confidence: Level of the interval.
        method: `wilson`: right on average over rates; `beta` (Clopper-Pearson): never below its level, hence wider.
    """
    if not episodes:
        return Interval(0.0, 1.0, confidence, INTERVALS[method])
    low, high = proportion_confint(successes, episodes, alpha=1 - confidence, method=method)
    return Interval(float(low), float(high), confidence, INTERVALS[method])


def paired_p_value(outcomes: Discordance) -> float:
    """Returns the two-sided p value of McNemar's exact test: among pairs that differ, either method is as likely."""
    table = [[0, outcomes.first_only], [outcomes.second_only, 0]]
    return float(mcnemar(table, exact=True).pvalue)


def paired_interval(outcomes: Discordance, confidence: float = 0.95) -> Interval:
    """Returns the interval of the paired difference of two rates: Tango's score interval.

    It holds every difference that the score test does not reject; at a difference of 0 that is McNemar's statistic.
    Source: T. Tango, Equivalence test and confidence interval for the difference in proportions for the paired-sample
    design, Statistics in Medicine 17 (1998) 891-908.
    """
    low, high = _score_limits(outcomes.first_only, outcomes.second_only, outcomes.pairs, confidence)
    return Interval(low, high, confidence, "Tango's score interval")


def unpaired_p_value(first: tuple[int, int], second: tuple[int, int]) -> float:
    """Returns the two-sided p value of Barnard's exact test of two independent rates.

    Args:
        first: Successes and episodes of the first method.
        second: Those of the second.
    """
    table = np.array([[first[0], second[0]], [first[1] - first[0], second[1] - second[0]]])
    if table.sum() > LARGE_TABLE:
        return float(stats.chi2_contingency(table, correction=False).pvalue) if _mixed(table) else 1.0
    return float(stats.barnard_exact(table, pooled=True).pvalue) if _mixed(table) else 1.0


LARGE_TABLE = 2000
"""Episodes above which Barnard's test takes seconds and the score test, its limit for many episodes, stands for it."""


def unpaired_test_name(episodes: int) -> str:
    """Returns the name of the test that `unpaired_p_value` uses."""
    return "Barnard's exact test" if episodes <= LARGE_TABLE else "chi-squared test"


def unpaired_interval(first: tuple[int, int], second: tuple[int, int], confidence: float = 0.95) -> Interval:
    """Returns the interval of the difference of two independent rates: Newcombe's."""
    low, high = confint_proportions_2indep(*first, *second, method="newcomb", compare="diff", alpha=1 - confidence)
    return Interval(float(low), float(high), confidence, "Newcombe")


def _mixed(table: NDArray[np.int64]) -> bool:
    """Returns whether there are both successes and failures."""
    return bool(np.all(table.sum(axis=1) > 0))


@lru_cache(maxsize=4096)
def _score_limits(first_only: int, second_only: int, pairs: int, confidence: float) -> tuple[float, float]:
    critical = float(stats.norm.isf((1 - confidence) / 2))
    estimate = (first_only - second_only) / pairs

    def limit(end: float) -> float:
        if estimate == end:
            return end
        # The score falls from the estimate, where it is 0, to minus infinity at an end that was not observed.
        return float(
            optimize.brentq(lambda shift: abs(_score(first_only, second_only, pairs, shift)) - critical, estimate, end)
        )

    return limit(-1.0), limit(1.0)


def _score(first_only: int, second_only: int, pairs: int, difference: float) -> float:
    """Returns Tango's score of a difference: how far the outcomes are from it [standard deviations]."""
    surprise = first_only - second_only - pairs * difference
    if surprise == 0.0:
        return 0.0
    linear = -first_only - second_only + (2 * pairs - first_only + second_only) * difference
    constant = -second_only * difference * (1 - difference)
    root = np.sqrt(max(linear**2 - 8 * pairs * constant, 0.0))
    second_rate = (root - linear) / (4 * pairs)
    variance = pairs * (2 * second_rate + difference * (1 - difference))
    return float(surprise / np.sqrt(variance)) if variance > 0.0 else float(np.copysign(1e9, surprise))
