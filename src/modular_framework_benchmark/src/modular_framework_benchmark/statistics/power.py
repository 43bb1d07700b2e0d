# SPDX-License-Identifier: BSD-3-Clause
"""Power and sample size of paired comparisons."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from modular_framework_benchmark.statistics.rates import PairOutcomes, paired_interval
from modular_framework_benchmark.statistics.sequential import anytime_p_value, log_capital
from modular_framework_benchmark.statistics.values import MIN_UNITS

TARGET_POWER = 0.8
"""Conventional power: the probability that an experiment shows the difference."""
MAX_PAIRS = 1_000_000


@lru_cache(maxsize=4096)
def rate_power(
    pairs: int, difference: float, discordance: float, error_rate: float = 0.05, at_any_time: bool = False
) -> float:
    """Returns the power for a win difference, which for a rate is the difference of the rates.

    The sum over the number of discordant pairs and of pairs won by the first method is exact. The test is McNemar's, or
    the anytime-valid test after the last pair; the latter may end sooner, so its power is a lower bound.

    Args:
        pairs: Number of paired episodes.
        difference: Win difference, such as 0.05 for 5 points.
        discordance: Fraction of discordant pairs; at least the absolute difference.
        error_rate: Two-sided error rate of the comparison after the multiplicity correction.
        at_any_time: Whether the test is anytime-valid.
    """
    discordance = min(max(discordance, abs(difference)), 1.0)
    fewest, most = stats.binom.ppf([1e-12, 1 - 1e-12], pairs, discordance)
    discordant = np.arange(int(fewest), int(most) + 1)
    probabilities = stats.binom.pmf(discordant, pairs, discordance)
    min_wins = _sequential_wins(discordant, error_rate) if at_any_time else _fixed_wins(discordant, error_rate)
    win_probability = (1 + abs(difference) / discordance) / 2 if discordance else 0.5
    return float(np.sum(probabilities * stats.binom.sf(min_wins - 1, discordant, win_probability)))


def _fixed_wins(discordant: NDArray[np.int64], error_rate: float) -> NDArray[np.float64]:
    """Returns the wins that McNemar's test needs for each number of discordant pairs (two-sided)."""
    return np.asarray(stats.binom.isf(error_rate / 2, discordant, 0.5) + 1)


def _sequential_wins(discordant: NDArray[np.int64], error_rate: float) -> NDArray[np.float64]:
    """Returns the wins that the anytime-valid test needs for each number of discordant pairs, found by bisection."""
    differences, threshold = np.array([-1.0, 1.0]), -math.log(error_rate)
    low, high = discordant // 2, discordant + 1  # more wins than pairs: no number of wins is enough
    while np.any(high - low > 1):
        middle = (low + high) // 2
        is_enough = (
            log_capital(differences, np.stack([discordant - middle, middle], axis=-1).astype(float)) >= threshold
        )
        low, high = np.where(is_enough, low, middle), np.where(is_enough, middle, high)
    return high.astype(float)


@lru_cache(maxsize=1024)
def pairs_for_rate(
    difference: float,
    discordance: float,
    error_rate: float = 0.05,
    power: float = TARGET_POWER,
    at_any_time: bool = False,
) -> int | None:
    """Returns the number of paired episodes that shows a difference of rates, or None above a million.

    The search starts from the asymptotic formula. Source of the formula: R. J. Connor, Sample
    size for testing differences in proportions for the paired-sample design, Biometrics 43 (1987) 207-211.

    Args:
        difference: Difference of the rates, above 0, such as 0.05 for 5 points.
        discordance: Fraction of discordant pairs.
        error_rate: Two-sided error rate of the comparison after the multiplicity correction.
        power: Required power.
        at_any_time: Whether the test is anytime-valid.
    """
    discordance = min(max(discordance, difference), 1.0)
    spread = stats.norm.isf(error_rate / 2) * math.sqrt(discordance)
    spread += stats.norm.isf(1 - power) * math.sqrt(discordance - difference**2)
    low = int((spread / difference) ** 2)
    if low > MAX_PAIRS:
        return None
    high = max(low, 1)
    while rate_power(high, difference, discordance, error_rate, at_any_time) < power:
        low, high = high, math.ceil(high * 1.1) + 1
    while rate_power(max(low, 1), difference, discordance, error_rate, at_any_time) >= power and low > 1:
        low = int(low / 1.1)
    while high - low > 1:
        middle = (low + high) // 2
        enough = rate_power(middle, difference, discordance, error_rate, at_any_time) >= power
        low, high = (low, middle) if enough else (middle, high)
    return high


def detectable_difference(
    units: int, error_rate: float, discordance: float = 1.0, at_any_time: bool = False
) -> float | None:
    """Returns the smallest win difference that the units show with 80 % power, or None if no difference is shown.

    Args:
        units: Number of independent pairs.
        error_rate: Two-sided error rate of the comparison after the multiplicity correction.
        discordance: Fraction of discordant pairs, raised to the difference if smaller.
        at_any_time: Whether the test is anytime-valid.
    """
    if units < min_units(error_rate, at_any_time):
        return None
    for points in range(1, 101):
        if rate_power(units, points / 100, discordance, error_rate, at_any_time) >= TARGET_POWER:
            return points / 100
    return None


@lru_cache(maxsize=1024)
def min_units(error_rate: float, at_any_time: bool = False) -> int:
    """Returns the number of units with which a difference is shown if the first method wins all of them.

    Args:
        error_rate: Two-sided error rate of the comparison after the multiplicity correction.
        at_any_time: Whether the test is anytime-valid.
    """
    units = MIN_UNITS
    while True:
        if at_any_time:
            p_value, excludes_zero = anytime_p_value(np.ones(units)), True
        else:
            p_value, excludes_zero = 2.0 ** (1 - units), paired_interval(PairOutcomes(units, 0, units)).low > 0.0
        if p_value <= error_rate and excludes_zero:
            return units
        units += 1
