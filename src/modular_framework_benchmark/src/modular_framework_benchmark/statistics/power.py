# SPDX-License-Identifier: BSD-3-Clause
"""Plans episodes: how many pairs would show a difference, and how likely a number of pairs shows it."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy import stats

from modular_framework_benchmark.statistics.rates import PairOutcomes, paired_interval
from modular_framework_benchmark.statistics.sequential import anytime_p_value
from modular_framework_benchmark.statistics.values import MIN_UNITS

POWER = 0.8
"""Share of experiments that would show the difference, the usual one."""
MOST_PAIRS = 1_000_000


@lru_cache(maxsize=4096)
def rate_power(pairs: int, difference: float, discordance: float, error_rate: float = 0.05) -> float:
    """Returns how likely McNemar's exact test shows a win difference, which for a rate is that of the rates.

    Exact: summed over how many of the pairs differ, and how many of those the first method wins.

    Args:
        pairs: Paired episodes.
        difference: Win difference, such as 0.05 for 5 points.
        discordance: Share of pairs in which the methods differ, at least the difference.
        error_rate: Two-sided, that of this comparison after the correction for many.
    """
    discordance = min(max(discordance, abs(difference)), 1.0)
    least, most = stats.binom.ppf([1e-12, 1 - 1e-12], pairs, discordance)
    differing = np.arange(int(least), int(most) + 1)
    likely = stats.binom.pmf(differing, pairs, discordance)
    # Fewest wins that the test shows: it doubles the tail, so that the tail may have half the error rate.
    fewest = stats.binom.isf(error_rate / 2, differing, 0.5) + 1
    wins = (1 + abs(difference) / discordance) / 2 if discordance else 0.5
    return float(np.sum(likely * stats.binom.sf(fewest - 1, differing, wins)))


@lru_cache(maxsize=1024)
def pairs_for_rate(difference: float, discordance: float, error_rate: float = 0.05, power: float = POWER) -> int | None:
    """Returns how many paired episodes show a difference of rates with a power; None above a million.

    Starts from the formula for many pairs and then finds the exact number. Source of the formula: R. J. Connor, Sample
    size for testing differences in proportions for the paired-sample design, Biometrics 43 (1987) 207-211.

    Args:
        difference: Difference of the rates, above 0, such as 0.05 for 5 points.
        discordance: Share of pairs in which the methods differ.
        error_rate: Two-sided, that of this comparison after the correction for many.
        power: Share of experiments that are to show it.
    """
    discordance = min(max(discordance, difference), 1.0)
    spread = stats.norm.isf(error_rate / 2) * math.sqrt(discordance)
    spread += stats.norm.isf(1 - power) * math.sqrt(discordance - difference**2)
    low = int((spread / difference) ** 2)
    if low > MOST_PAIRS:
        return None
    high = max(low, 1)
    while rate_power(high, difference, discordance, error_rate) < power:
        low, high = high, math.ceil(high * 1.1) + 1
    while rate_power(max(low, 1), difference, discordance, error_rate) >= power and low > 1:
        low = int(low / 1.1)
    while high - low > 1:
        middle = (low + high) // 2
        enough = rate_power(middle, difference, discordance, error_rate) >= power
        low, high = (low, middle) if enough else (middle, high)
    return high


def smallest_difference(units: int, error_rate: float, decided: float = 1.0) -> float | None:
    """Returns the smallest win difference that a number of units shows with 80 % power; None where none is shown.

    Args:
        units: Independent pairs.
        error_rate: Two-sided, that of this comparison after the correction for many.
        decided: Share of the pairs in which the methods differ, where the difference is no larger.
    """
    for points in range(1, 101):
        if rate_power(units, points / 100, decided, error_rate) >= POWER and units >= fewest_units(error_rate):
            return points / 100
    return None


@lru_cache(maxsize=1024)
def fewest_units(error_rate: float, at_any_time: bool = False) -> int:
    """Returns with how many units a difference can be shown if the first method wins all of them.

    Args:
        error_rate: Two-sided, that of this comparison after the correction for many.
        at_any_time: Whether the test holds however often one looks.
    """
    units = MIN_UNITS
    while True:
        if at_any_time:
            p_value, outside = anytime_p_value(np.ones(units)), True
        else:
            p_value, outside = 2.0 ** (1 - units), paired_interval(PairOutcomes(units, 0, units)).low > 0.0
        if p_value <= error_rate and outside:
            return units
        units += 1
