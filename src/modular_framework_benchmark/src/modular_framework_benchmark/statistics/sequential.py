# SPDX-License-Identifier: BSD-3-Clause
"""Tests and intervals that hold at any time, for experiments that look at their results and stop by them.

They bet on the differences of pairs: capital that starts at 1 and is, if the true difference is m, a martingale. By
Ville's inequality it ever reaches 1 / error rate with at most that rate, however often one looks. The inverse of the
capital against "no difference" is a p value, the differences m whose capital stays below are an interval. The bet is a
mixture over its size, fixed beforehand, so that both depend on the differences only and not on their order.
Source: I. Waudby-Smith, A. Ramdas, Estimating means of bounded random variables by betting, J. R. Statist. Soc. B 86
(2024) 1-27; for pairs of 0 and 1 and m = 0 it is the mixture sequential probability ratio test of the share of pairs
that the first method wins among those that differ.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from modular_framework_benchmark.statistics.comparison import Interval

Floats = NDArray[np.float64]

_SIZES, _WEIGHTS = special.roots_legendre(64)
_LOG_WEIGHTS = np.log(_WEIGHTS / _WEIGHTS.sum())
GRID = 101
"""Candidates for the true difference from -1 to 1, between which an end of the interval is then refined."""
LARGEST_PART = 1_000_000
"""Numbers that are held at once to compute the capital against all candidates: 8 MB."""


def log_capital(differences: Floats, counts: Floats, true_difference: float = 0.0) -> Floats:
    """Returns the logarithm of what betting against a true difference has won.

    Args:
        differences: The values that a difference of a pair can have, each from -1 to 1, shape (k,).
        counts: How often each was seen, shape (..., k).
        true_difference: What is bet against, above -1 and below 1.

    Returns:
        Logarithm of the capital, 0 at the start, shape (...).
    """
    return np.asarray(special.logsumexp(counts @ _gains(differences, true_difference).T + _LOG_WEIGHTS, axis=-1))


def _gains(differences: Floats, true_difference: float | Floats) -> Floats:
    """Returns the logarithm of what each size of the bet wins with each difference, shape (..., sizes, k).

    Args:
        differences: The differences of a pair, shape (k,).
        true_difference: What is bet against, a number or shape (..., 1, 1).
    """
    sizes = _SIZES[:, None]
    largest = np.where(sizes < 0.0, 1.0 / (1.0 - true_difference), 1.0 / (1.0 + true_difference))
    return np.asarray(np.log1p(sizes * largest * (differences - true_difference)))


def anytime_p_value(differences: Floats, bound: float = 1.0) -> float:
    """Returns a p value of "the mean difference is 0" that holds at any time.

    Args:
        differences: Independent differences, each from -bound to bound, shape (n,).
        bound: Largest difference there can be.
    """
    seen, counts = np.unique(differences / bound, return_counts=True)
    return min(1.0, float(np.exp(-log_capital(seen, counts.astype(float)))))


def anytime_interval(differences: Floats, confidence: float, bound: float = 1.0) -> Interval:
    """Returns an interval of the mean difference that holds at any time, at all times together.

    Args:
        differences: Independent differences, each from -bound to bound, shape (n,).
        confidence: Level of the interval.
        bound: Largest difference there can be.
    """
    seen, counts = np.unique(differences / bound, return_counts=True)
    most = -np.log(1.0 - confidence)

    def excess(true_difference: float) -> float:
        return float(log_capital(seen, counts.astype(float), true_difference)) - most

    middle = float(np.clip(np.average(seen, weights=counts), -1 + 1e-9, 1 - 1e-9))

    def limit(end: float) -> float:
        grid = np.linspace(middle, end, GRID)[1:-1]
        kept = np.flatnonzero(_log_capitals(seen, counts.astype(float), grid) < most)
        inner = float(grid[kept[-1]]) if len(kept) else middle
        outer = inner + (end - middle) / (GRID - 1)
        if abs(outer) >= 1.0 or excess(outer) < 0.0 or excess(inner) > 0.0:
            return float(np.clip(outer, -1.0, 1.0))
        return float(optimize.brentq(excess, inner, outer))

    return Interval(bound * limit(-1.0), bound * limit(1.0), confidence, "betting, valid at any time")


def _log_capitals(differences: Floats, counts: Floats, candidates: Floats) -> Floats:
    """Returns the logarithm of the capital against each candidate for the true difference, shape (candidates,)."""
    parts = np.array_split(candidates, -(-len(candidates) * len(_SIZES) * len(differences) // LARGEST_PART))
    return np.concatenate(
        [special.logsumexp(_gains(differences, part[:, None, None]) @ counts + _LOG_WEIGHTS, axis=-1) for part in parts]
    )
