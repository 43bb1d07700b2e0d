# SPDX-License-Identifier: BSD-3-Clause
"""Rates: the interval of one, test and interval of won and lost pairs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import optimize, stats
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.proportion import proportion_confint

from modular_framework_benchmark.statistics.comparison import Interval

MAX_OUTSIDE = 3
"""Units outside the most frequent outcome up to which Tango's interval is too narrow (it covers down to 85 %)."""


@dataclass(frozen=True, slots=True)
class PairOutcomes:
    """Outcomes of independent pairs, which is all that the claim of a comparison rests on.

    Attributes:
        won: Pairs in which the first method was better.
        lost: Pairs in which the second was.
        pairs: All pairs, ties included.
    """

    won: int
    lost: int
    pairs: int

    @property
    def difference(self) -> float:
        """Returns the win difference: won minus lost pairs, over all pairs."""
        return (self.won - self.lost) / self.pairs


@lru_cache(maxsize=16384)
def rate_interval(successes: int, episodes: int, confidence: float = 0.95) -> Interval:
    """Returns the interval of a rate, Clopper and Pearson's, which never covers less than its level.

    Args:
        successes: Episodes that were true.
        episodes: All of them; with 0 the interval is all rates.
        confidence: Level of the interval.
    """
    if not episodes:
        return Interval(0.0, 1.0, confidence, "Clopper-Pearson")
    low, high = proportion_confint(successes, episodes, alpha=1 - confidence, method="beta")
    return Interval(float(low), float(high), confidence, "Clopper-Pearson")


@lru_cache(maxsize=16384)
def paired_p_value(outcomes: PairOutcomes) -> float:
    """Returns the two-sided p value of McNemar's exact test: among decided pairs, either method is as likely to win."""
    return float(mcnemar([[0, outcomes.won], [outcomes.lost, 0]], exact=True).pvalue)


@lru_cache(maxsize=16384)
def paired_interval(outcomes: PairOutcomes, confidence: float = 0.95) -> Interval:
    """Returns the interval of a win difference, which for a rate is the paired difference of two rates.

    It is Tango's score interval: every difference that the score test does not reject; at a difference of 0 that is
    McNemar's statistic. Where at most `MAX_OUTSIDE` pairs lie outside the larger of won and lost it is the difference
    of two Clopper-Pearson intervals, with half of the error each.
    Source: T. Tango, Equivalence test and confidence interval for the difference in proportions for the paired-sample
    design, Statistics in Medicine 17 (1998) 891-908.
    """
    if outcomes.pairs - max(outcomes.won, outcomes.lost) <= MAX_OUTSIDE:
        won, lost = (
            rate_interval(count, outcomes.pairs, (1 + confidence) / 2) for count in (outcomes.won, outcomes.lost)
        )
        return Interval(won.low - lost.high, won.high - lost.low, confidence, "two Clopper-Pearson intervals")
    low, high = _score_limits(outcomes, confidence)
    return Interval(low, high, confidence, "Tango's score interval")


def _score_limits(outcomes: PairOutcomes, confidence: float) -> tuple[float, float]:
    critical = float(stats.norm.isf((1 - confidence) / 2))
    estimate = outcomes.difference

    def limit(end: float) -> float:
        if estimate == end:
            return end
        # The score falls from the estimate, where it is 0, to minus infinity at an end that was not observed.
        return float(optimize.brentq(lambda shift: abs(_score(outcomes, shift)) - critical, estimate, end))

    return limit(-1.0), limit(1.0)


def _score(outcomes: PairOutcomes, difference: float) -> float:
    """Returns Tango's score of a difference: how far the outcomes are from it [standard deviations]."""
    won, lost, pairs = outcomes.won, outcomes.lost, outcomes.pairs
    surprise = won - lost - pairs * difference
    if surprise == 0.0:
        return 0.0
    linear = -won - lost + (2 * pairs - won + lost) * difference
    constant = -lost * difference * (1 - difference)
    root = np.sqrt(max(linear**2 - 8 * pairs * constant, 0.0))
    lost_rate = (root - linear) / (4 * pairs)
    variance = pairs * (2 * lost_rate + difference * (1 - difference))
    return float(surprise / np.sqrt(variance)) if variance > 0.0 else float(np.copysign(1e9, surprise))
