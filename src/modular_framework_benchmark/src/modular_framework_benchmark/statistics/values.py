# SPDX-License-Identifier: BSD-3-Clause
"""Means and medians of independent units: confidence intervals, and the sign flip test of a mean.

The mean of unbounded values has no interval, because no interval is valid for every distribution.
Source: R. R. Bahadur, L. J. Savage, Annals of Mathematical Statistics 27 (1956) 1115-1122.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from modular_framework_benchmark.statistics.comparison import Interval
from modular_framework_benchmark.statistics.rates import MAX_UNITS_OUTSIDE_MODE, rate_interval
from modular_framework_benchmark.statistics.sequential import anytime_interval

Floats = NDArray[np.float64]

MIN_UNITS = 6
"""Minimum number of independent units for an interval, a test or a claim."""
MAX_WIDENED_UNITS = 12
"""Number of units up to which the interval of a mean is widened by the sign flip test."""
MAX_GRID_STEPS = 200_000
"""Maximum number of grid steps for the distribution of the sum in the sign flip test."""


def sign_flip_p_value(means: Floats, sizes: NDArray[np.int64]) -> float:
    """Returns the two-sided p value of the sign flip test of a mean: both signs of a unit's mean are equally likely.

    The distribution of the sum over all sign assignments is computed on a grid. With means of -1, 0 and 1 the test is
    McNemar's exact test. Source: I. A. Canay, J. P. Romano, A. M. Shaikh, Econometrica 85 (2017) 1013-1030.

    Args:
        means: Mean outcome of each unit's pairs (won 1, lost -1, tied 0), shape (n,).
        sizes: Number of pairs of each unit, shape (n,).
    """
    steps = min(int(np.lcm.reduce(sizes)), max(MAX_GRID_STEPS // len(means), 1))
    shifts = np.rint(means * steps).astype(np.int64)
    probabilities = np.ones(1)
    for shift in np.abs(shifts[shifts != 0]):
        flipped = np.zeros(len(probabilities) + 2 * shift)
        flipped[: len(probabilities)] += 0.5 * probabilities
        flipped[2 * shift :] += 0.5 * probabilities
        probabilities = flipped
    sums = np.arange(len(probabilities)) - len(probabilities) // 2
    return float(min(np.sum(probabilities[np.abs(sums) >= abs(int(shifts.sum()))]), 1.0))


def bounded_mean_interval(means: Floats, bounds: tuple[float, float], confidence: float) -> Interval | None:
    """Returns the confidence interval of the mean of bounded values, or None below `MIN_UNITS` units.

    The interval is Student's t with n - 1 degrees of freedom (R. Ibragimov, U. K. Müller, J. Business and Economic
    Statistics 28 (2010) 453-468). It covers too little for a few units in two groups, so up to `MAX_WIDENED_UNITS`
    units the means that the sign flip test does not reject are added. It also covers too little if most units are
    equal, which gives a betting interval. If all values equal a bound, the other end is exact: a true mean beyond
    `((1 - confidence) / 2) ** (1 / n)` of the range would give these values less often.

    Args:
        means: Mean of each unit, shape (n,).
        bounds: Smallest and largest possible value, both finite.
        confidence: Confidence level.
    """
    count, (lowest, highest) = len(means), bounds
    if count < MIN_UNITS:
        return None
    if np.all(means == means[0]) and means[0] in bounds:
        end = (highest - lowest) * ((1 - confidence) / 2) ** (1 / count)
        low, high = (lowest, highest - end) if means[0] == lowest else (lowest + end, highest)
        return Interval(low, high, confidence, "exact, all values at the bound")
    mode_count = np.unique(means, return_counts=True)[1].max()
    if 2 * mode_count > count or count - mode_count <= MAX_UNITS_OUTSIDE_MODE:
        middle = (highest + lowest) / 2
        shifted = anytime_interval(means - middle, confidence, (highest - lowest) / 2)
        return Interval(shifted.low + middle, shifted.high + middle, confidence, "betting")
    half_width = float(stats.t.isf((1 - confidence) / 2, count - 1) * np.std(means, ddof=1) / math.sqrt(count))
    mean, name = float(np.mean(means)), "Student's t of the units"
    low, high = mean - half_width, mean + half_width
    if count <= MAX_WIDENED_UNITS:
        subsets = np.sort(_subset_weights(count) @ means)
        rank = int((1 - confidence) / 2 * (len(subsets) + 1)) - 1
        first, last = (subsets[rank], subsets[-1 - rank]) if rank >= 0 else bounds  # too few to reject any mean
        low, high, name = min(low, float(first)), max(high, float(last)), f"{name} and sign flips"
    return Interval(max(low, lowest), min(high, highest), confidence, name)


@lru_cache(maxsize=MAX_WIDENED_UNITS)
def _subset_weights(count: int) -> Floats:
    """Returns the weights that average every nonempty subset of the values, shape (2 ** count - 1, count).

    The true mean lies between any two neighbouring subset means with equal probability if the deviations are symmetric.
    Source: J. A. Hartigan, J. American Statistical Association 64 (1969) 1303-1317.
    """
    chosen = (np.arange(1, 2**count)[:, None] >> np.arange(count)) & 1
    return chosen / chosen.sum(axis=1, keepdims=True)


def restricted_mean_interval(
    values: Floats, failed: NDArray[np.bool_], limits: tuple[float, float], confidence: float
) -> Interval | None:
    """Returns the confidence interval of a mean in which failures count at a limit, or None with too few successes.

    The Clopper-Pearson interval of the failure rate and Student's t of the successes have half of the error each.

    Args:
        values: Values of independent episodes, failures at the limit, shape (n,).
        failed: Whether each episode counts at the limit, shape (n,).
        limits: The limit, and the bound on the other side, which may be infinite.
        confidence: Confidence level.
    """
    successes, (limit, bound) = values[~failed], limits
    if len(successes) < MIN_UNITS or np.ptp(successes) == 0.0:
        return None
    rate = rate_interval(int(failed.sum()), len(values), (1 + confidence) / 2)
    half_width = float(stats.t.isf((1 - confidence) / 4, len(successes) - 1) * stats.sem(successes))
    lowest, highest = sorted((limit, bound))
    ends = [min(max(float(np.mean(successes)) + side * half_width, lowest), highest) for side in (-1, 1)]
    means = [share * limit + (1 - share) * end for share in (rate.low, rate.high) for end in ends]
    return Interval(min(means), max(means), confidence, "Clopper-Pearson of failures, Student's t")


def episodes_for_restricted_mean(failed: NDArray[np.bool_]) -> int | None:
    """Returns the number of episodes that yields enough successes for an interval of a restricted mean.

    Assumes that the fraction of failures stays as observed. Returns None without a success, and with enough successes,
    whose equal values then are the reason for the missing interval.

    Args:
        failed: Whether each episode counts at the limit, shape (n,).
    """
    successes = len(failed) - int(failed.sum())
    return math.ceil(MIN_UNITS * len(failed) / successes) if 0 < successes < MIN_UNITS else None


@lru_cache(maxsize=4096)
def _median_rank(count: int, confidence: float) -> int:
    """Returns the zero-based rank of the value at the lower end of the interval of a median."""
    return int(stats.binom.ppf((1 - confidence) / 2, count, 0.5)) - 1


def median_interval(values: Floats, confidence: float) -> Interval | None:
    """Returns the confidence interval of a median between two of the values, or None below `MIN_UNITS` values.

    The number of values below the median is binomial for every distribution, so the coverage is never below the
    confidence level. An infinite end is a failure.
    """
    count = len(values)
    rank = _median_rank(count, confidence) if count >= MIN_UNITS else -1
    if rank < 0:
        return None
    ordered = np.sort(values)
    return Interval(float(ordered[rank]), float(ordered[count - 1 - rank]), confidence, "binomial ranks")
