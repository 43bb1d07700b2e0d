# SPDX-License-Identifier: BSD-3-Clause
"""Anytime-valid tests and intervals, for experiments with interim analyses.

A betting strategy wagers on the differences of pairs. Its capital starts at 1 and is a martingale if the true mean
difference is m. By Ville's inequality, the probability that the capital ever reaches 1 / error rate is at most the
error rate, for any number of interim analyses. The inverse of the capital against m = 0 is a p value. The interval
contains every m whose capital stays below 1 / error rate. The bet is a fixed mixture over bet sizes, so the results
depend on the differences and not on their order.
Source: I. Waudby-Smith, A. Ramdas, Estimating means of bounded random variables by betting, J. R. Statist. Soc. B 86
(2024) 1-27. For binary results and m = 0, the test is the mixture sequential probability ratio test of the fraction
of discordant pairs that the first method wins.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from modular_framework_benchmark.statistics.comparison import Interval

Floats = NDArray[np.float64]

_BET_SIZES, _BET_WEIGHTS = special.roots_legendre(64)
_LOG_BET_WEIGHTS = np.log(_BET_WEIGHTS / _BET_WEIGHTS.sum())
GRID_POINTS = 101
"""Number of candidate differences from -1 to 1, between which the ends of an interval are refined."""
MAX_BATCH_SIZE = 1_000_000
"""Array elements per batch when the capital of all candidates is computed: 8 MB."""


def log_capital(differences: Floats, counts: Floats, true_difference: float = 0.0) -> Floats:
    """Returns the logarithm of the capital of a bet against a true difference.

    Args:
        differences: Distinct differences of a pair, each from -1 to 1, shape (k,).
        counts: Number of occurrences of each difference, shape (..., k).
        true_difference: Hypothetical mean difference, above -1 and below 1.

    Returns:
        Logarithm of the capital, 0 at the start, shape (...).
    """
    return np.asarray(special.logsumexp(counts @ _gains(differences, true_difference).T + _LOG_BET_WEIGHTS, axis=-1))


def _gains(differences: Floats, true_difference: float | Floats) -> Floats:
    """Returns the logarithmic gain of each bet size for each difference, shape (..., sizes, k).

    Args:
        differences: Possible differences between the two results of a pair, shape (k,).
        true_difference: Hypothetical mean difference, scalar or shape (..., 1, 1).
    """
    sizes = _BET_SIZES[:, None]
    largest = np.where(sizes < 0.0, 1.0 / (1.0 - true_difference), 1.0 / (1.0 + true_difference))
    return np.asarray(np.log1p(sizes * largest * (differences - true_difference)))


def anytime_p_value(differences: Floats, bound: float = 1.0) -> float:
    """Returns an anytime-valid p value of the hypothesis that the mean difference is 0.

    Args:
        differences: Independent differences, each from -bound to bound, shape (n,).
        bound: Largest possible difference.
    """
    distinct, counts = np.unique(differences / bound, return_counts=True)
    return min(1.0, float(np.exp(-log_capital(distinct, counts.astype(float)))))


def anytime_interval(differences: Floats, confidence: float, bound: float = 1.0) -> Interval:
    """Returns an anytime-valid confidence interval of the mean difference.

    Args:
        differences: Independent differences, each from -bound to bound, shape (n,).
        confidence: Confidence level.
        bound: Largest possible difference.
    """
    distinct, counts = np.unique(differences / bound, return_counts=True)
    threshold = -np.log(1.0 - confidence)

    def excess(true_difference: float) -> float:
        return float(log_capital(distinct, counts.astype(float), true_difference)) - threshold

    mean = float(np.clip(np.average(distinct, weights=counts), -1 + 1e-9, 1 - 1e-9))

    def interval_end(end: float) -> float:
        grid = np.linspace(mean, end, GRID_POINTS)[1:-1]
        kept = np.flatnonzero(_log_capitals(distinct, counts.astype(float), grid) < threshold)
        inner = float(grid[kept[-1]]) if len(kept) else mean
        outer = inner + (end - mean) / (GRID_POINTS - 1)
        if abs(outer) >= 1.0 or excess(outer) < 0.0 or excess(inner) > 0.0:
            return float(np.clip(outer, -1.0, 1.0))
        return float(optimize.brentq(excess, inner, outer))

    return Interval(bound * interval_end(-1.0), bound * interval_end(1.0), confidence, "betting, valid at any time")


def _log_capitals(differences: Floats, counts: Floats, candidates: Floats) -> Floats:
    """Returns the logarithm of the capital against each candidate difference, shape (candidates,)."""
    parts = np.array_split(candidates, -(-len(candidates) * len(_BET_SIZES) * len(differences) // MAX_BATCH_SIZE))
    return np.concatenate(
        [
            special.logsumexp(_gains(differences, part[:, None, None]) @ counts + _LOG_BET_WEIGHTS, axis=-1)
            for part in parts
        ]
    )
