# SPDX-License-Identifier: BSD-3-Clause
"""Confidence interval of a rate; test and confidence interval of a win difference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import optimize, stats
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.proportion import proportion_confint

from modular_framework_benchmark.statistics.comparison import Interval

MAX_UNITS_OUTSIDE_MODE = 3
"""Number of units outside the most frequent outcome up to which Tango's interval covers too little (down to 83 %)."""

CORRECTION = 0.5
"""Continuity correction of Tango's score [pairs]: without it the coverage of 95 % falls to 92.2 % at 21 pairs."""


@dataclass(frozen=True, slots=True)
class PairOutcomes:
    """Numbers of won and lost independent pairs, the sufficient statistic of a comparison.

    Attributes:
        won: Pairs in which the first method is better.
        lost: Pairs in which the second method is better.
        pairs: Total number of pairs, including ties.
    """

    won: int
    lost: int
    pairs: int

    @property
    def difference(self) -> float:
        """Returns the win difference: won minus lost pairs, divided by all pairs."""
        return (self.won - self.lost) / self.pairs


@lru_cache(maxsize=16384)
def rate_interval(successes: int, episodes: int, confidence: float = 0.95) -> Interval:
    """Returns the Clopper-Pearson interval of a rate, whose coverage is never below its confidence level.

    Args:
        successes: Number of episodes in which the metric is true.
        episodes: Number of episodes; the interval of 0 episodes is [0, 1].
        confidence: Confidence level.
    """
    if not episodes:
        return Interval(0.0, 1.0, confidence, "Clopper-Pearson")
    low, high = proportion_confint(successes, episodes, alpha=1 - confidence, method="beta")
    return Interval(float(low), float(high), confidence, "Clopper-Pearson")


@lru_cache(maxsize=16384)
def paired_p_value(outcomes: PairOutcomes) -> float:
    """Returns the two-sided p value of McNemar's exact test, that both methods win equally many discordant pairs."""
    return float(mcnemar([[0, outcomes.won], [outcomes.lost, 0]], exact=True).pvalue)


@lru_cache(maxsize=16384)
def paired_interval(outcomes: PairOutcomes, confidence: float = 0.95) -> Interval:
    """Returns the confidence interval of a win difference, which for a rate is the paired difference of two rates.

    It is Tango's score interval. If at most `MAX_UNITS_OUTSIDE_MODE` pairs lie outside the larger of won and lost, the
    interval is the difference of two Clopper-Pearson intervals with half of the error each.
    """
    if outcomes.pairs - max(outcomes.won, outcomes.lost) <= MAX_UNITS_OUTSIDE_MODE:
        won, lost = (
            rate_interval(count, outcomes.pairs, (1 + confidence) / 2) for count in (outcomes.won, outcomes.lost)
        )
        return Interval(won.low - lost.high, won.high - lost.low, confidence, "two Clopper-Pearson intervals")
    return score_interval(outcomes, confidence)


def score_interval(outcomes: PairOutcomes, confidence: float, correction: float = CORRECTION) -> Interval:
    """Returns Tango's score interval: every difference that the score test does not reject.

    At a difference of 0 the score test is McNemar's.
    Source: T. Tango, Equivalence test and confidence interval for the difference in proportions for the paired-sample
    design, Statistics in Medicine 17 (1998) 891-908.

    Args:
        outcomes: Numbers of won and lost pairs.
        confidence: Confidence level.
        correction: Continuity correction [pairs]; Tango's own interval has 0.
    """
    critical = float(stats.norm.isf((1 - confidence) / 2))
    estimate = outcomes.difference

    def excess(difference: float) -> float:
        return abs(_score(outcomes, difference, correction)) - critical

    def root(end: float) -> float:
        # The score is 0 at the estimate. At an end that was not observed it diverges, unless the pairs are few.
        if estimate == end or excess(end) <= 0.0:
            return end
        return float(optimize.brentq(excess, estimate, end))

    return Interval(root(-1.0), root(1.0), confidence, "Tango's score interval")


def _score(outcomes: PairOutcomes, difference: float, correction: float) -> float:
    """Returns Tango's score statistic of a difference, with a continuity correction [standard deviations]."""
    won, lost, pairs = outcomes.won, outcomes.lost, outcomes.pairs
    shift = won - lost - pairs * difference
    deviation = math.copysign(max(abs(shift) - correction, 0.0), shift)
    if deviation == 0.0:
        return 0.0
    linear = -won - lost + (2 * pairs - won + lost) * difference
    constant = -lost * difference * (1 - difference)
    discriminant_root = np.sqrt(max(linear**2 - 8 * pairs * constant, 0.0))
    lost_rate = (discriminant_root - linear) / (4 * pairs)
    variance = pairs * (2 * lost_rate + difference * (1 - difference))
    return float(deviation / np.sqrt(variance)) if variance > 0.0 else float(np.copysign(1e9, deviation))
