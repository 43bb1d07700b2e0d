# SPDX-License-Identifier: BSD-3-Clause
"""Means and medians of independent units: their intervals, and the test of a mean by sign flips.

There is no interval of the mean of values without bounds: none holds whatever their distribution.
Source: R. R. Bahadur, L. J. Savage, Annals of Mathematical Statistics 27 (1956) 1115-1122.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from modular_framework_benchmark.statistics.comparison import Interval
from modular_framework_benchmark.statistics.rates import MAX_OUTSIDE, rate_interval
from modular_framework_benchmark.statistics.sequential import anytime_interval

Floats = NDArray[np.float64]

MIN_UNITS = 6
"""Fewest independent units for an interval, a test or a claim."""
FEW_UNITS = 12
"""Up to so many units, the interval of a mean also holds what the sign flip test does not reject."""
MAX_STEPS = 200_000
"""Steps in which the sum of the units' means is counted for the sign flip test."""


def sign_flip_p_value(means: Floats, sizes: NDArray[np.int64]) -> float:
    """Returns the two-sided p value of the sign flip test of a mean: either sign of each unit's mean is as likely.

    Every assignment of signs is counted, by the distribution of their sum on a grid. With means of -1, 0 and 1 it is
    McNemar's exact test. Source: I. A. Canay, J. P. Romano, A. M. Shaikh, Econometrica 85 (2017) 1013-1030.

    Args:
        means: Mean of won (1), lost (-1) and tied (0) pairs of each unit, shape (n,).
        sizes: Number of pairs of each unit, shape (n,).
    """
    steps = min(int(np.lcm.reduce(sizes)), max(MAX_STEPS // len(means), 1))
    shifts = np.rint(means * steps).astype(np.int64)
    chances = np.ones(1)
    for shift in np.abs(shifts[shifts != 0]):
        flipped = np.zeros(len(chances) + 2 * shift)
        flipped[: len(chances)] += 0.5 * chances
        flipped[2 * shift :] += 0.5 * chances
        chances = flipped
    sums = np.arange(len(chances)) - len(chances) // 2
    return float(min(np.sum(chances[np.abs(sums) >= abs(int(shifts.sum()))]), 1.0))


def bounded_mean_interval(means: Floats, bounds: tuple[float, float], confidence: float) -> Interval | None:
    """Returns the interval of the mean of bounded values; None of fewer units than `MIN_UNITS`.

    Student's t with units - 1 degrees of freedom (R. Ibragimov, U. K. Müller, J. Business and Economic Statistics 28
    (2010) 453-468). It is too narrow for a few units that lie in two groups, so up to `FEW_UNITS` it is widened to
    what the sign flip test of the means does not reject. It is too narrow as well where most units are equal: then a
    betting interval, and if all are at a bound the exact end: a true mean below
    `((1 - confidence) / 2) ** (1 / units)` would give that less often.

    Args:
        means: Mean of each unit, shape (n,).
        bounds: Least and greatest value there can be, both finite.
        confidence: Level of the interval.
    """
    count, (lowest, highest) = len(means), bounds
    if count < MIN_UNITS:
        return None
    if np.all(means == means[0]) and means[0] in bounds:
        end = (highest - lowest) * ((1 - confidence) / 2) ** (1 / count)
        low, high = (lowest, highest - end) if means[0] == lowest else (lowest + end, highest)
        return Interval(low, high, confidence, "exact, all values at the bound")
    most_frequent = np.unique(means, return_counts=True)[1].max()
    if 2 * most_frequent > count or count - most_frequent <= MAX_OUTSIDE:
        middle = (highest + lowest) / 2
        found = anytime_interval(means - middle, confidence, (highest - lowest) / 2)
        return Interval(found.low + middle, found.high + middle, confidence, "betting")
    half = float(stats.t.isf((1 - confidence) / 2, count - 1) * np.std(means, ddof=1) / math.sqrt(count))
    mean, name = float(np.mean(means)), "Student's t of the units"
    low, high = mean - half, mean + half
    if count <= FEW_UNITS:
        subsets = np.sort(_subset_weights(count) @ means)
        rank = int((1 - confidence) / 2 * (len(subsets) + 1)) - 1
        first, last = (subsets[rank], subsets[-1 - rank]) if rank >= 0 else bounds  # too few to reject anything
        low, high, name = min(low, float(first)), max(high, float(last)), f"{name} and sign flips"
    return Interval(max(low, lowest), min(high, highest), confidence, name)


@lru_cache(maxsize=FEW_UNITS)
def _subset_weights(count: int) -> Floats:
    """Returns what makes the mean of every subset of so many values, shape (2 ** count - 1, count).

    The true mean lies between each two neighbours of these means with the same chance, if either sign of every
    deviation is as likely. Source: J. A. Hartigan, J. American Statistical Association 64 (1969) 1303-1317.
    """
    chosen = (np.arange(1, 2**count)[:, None] >> np.arange(count)) & 1
    return chosen / chosen.sum(axis=1, keepdims=True)


def restricted_mean_interval(
    values: Floats, failed: NDArray[np.bool_], limits: tuple[float, float], confidence: float
) -> Interval | None:
    """Returns the interval of a mean in which failures count at a limit; None where it has none.

    Clopper and Pearson's interval of the rate of failures and Student's t of the successes have half of the error each.

    Args:
        values: Values of independent episodes, those of failures at the limit, shape (n,).
        failed: Whether each counts at the limit, shape (n,).
        limits: The limit, and the bound on the other side, which may be infinite.
        confidence: Level of the interval.
    """
    kept, (limit, other) = values[~failed], limits
    if len(kept) < MIN_UNITS or np.ptp(kept) == 0.0:
        return None
    rate = rate_interval(int(failed.sum()), len(values), (1 + confidence) / 2)
    half = float(stats.t.isf((1 - confidence) / 4, len(kept) - 1) * stats.sem(kept))
    lowest, highest = sorted((limit, other))
    ends = [min(max(float(np.mean(kept)) + side * half, lowest), highest) for side in (-1, 1)]
    corners = [share * limit + (1 - share) * end for share in (rate.low, rate.high) for end in ends]
    return Interval(min(corners), max(corners), confidence, "Clopper-Pearson of failures, Student's t")


@lru_cache(maxsize=4096)
def _median_rank(count: int, confidence: float) -> int:
    """Returns the rank, from 0, of the value at the lower end of the interval of a median."""
    return int(stats.binom.ppf((1 - confidence) / 2, count, 0.5)) - 1


def median_interval(values: Floats, confidence: float) -> Interval | None:
    """Returns the interval of a median between two of the values; None of fewer than `MIN_UNITS`.

    The number of values below the median is binomial whatever their distribution, so it never covers less than its
    level. An end may be infinite: a failure.
    """
    count = len(values)
    rank = _median_rank(count, confidence) if count >= MIN_UNITS else -1
    if rank < 0:
        return None
    ordered = np.sort(values)
    return Interval(float(ordered[rank]), float(ordered[count - 1 - rank]), confidence, "binomial ranks")
