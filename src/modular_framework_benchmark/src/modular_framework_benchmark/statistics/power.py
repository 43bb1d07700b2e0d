# SPDX-License-Identifier: BSD-3-Clause
"""Plans episodes: how many pairs would show a difference, and how likely a number of pairs shows it."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy import stats
from statsmodels.stats.power import TTestPower

POWER = 0.8
"""Share of experiments that would show the difference, the usual one."""
MOST_PAIRS = 1_000_000
SIGNED_RANK_EFFICIENCY = 3.0 / math.pi
"""Pairs that a t test needs for each pair of Wilcoxon's signed rank test, for normal differences."""


@lru_cache(maxsize=4096)
def rate_power(pairs: int, difference: float, discordance: float, error_rate: float = 0.05) -> float:
    """Returns how likely McNemar's exact test shows a paired difference of rates, on the right side.

    Exact: summed over how many of the pairs differ, and how many of those the first method wins.

    Args:
        pairs: Paired episodes.
        difference: Difference of the rates, such as 0.05 for 5 points.
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


def pairs_for_value(difference: float, deviation: float, error_rate: float = 0.05, power: float = POWER) -> int | None:
    """Returns how many paired episodes show a difference of values by Wilcoxon's test; None above a million.

    That of a paired t test, for the efficiency of the signed rank test with normal differences.

    Args:
        difference: Mean difference, above 0, in the metric's unit.
        deviation: Standard deviation of the paired differences, in the metric's unit, above 0.
        error_rate: Two-sided, that of this comparison after the correction for many.
        power: Share of experiments that are to show it.
    """
    size = float(f"{difference / deviation:.3g}")
    return _pairs_for_size(size, error_rate, power)


SMALLEST_SIGNED_RANK = 6
"""Fewest pairs with which the signed rank test can have a p value below 0.05."""


@lru_cache(maxsize=4096)
def _pairs_for_size(size: float, error_rate: float, power: float) -> int | None:
    """Returns the number of pairs for a difference in standard deviations; rounded sizes are asked for repeatedly."""
    if size < 1e-3:
        return None
    if size > 5.0:
        return SMALLEST_SIGNED_RANK
    pairs = TTestPower().solve_power(effect_size=size, alpha=error_rate, power=power)
    needed = math.ceil(float(np.squeeze(pairs)) / SIGNED_RANK_EFFICIENCY)
    return max(needed, SMALLEST_SIGNED_RANK) if needed <= MOST_PAIRS else None
