# SPDX-License-Identifier: BSD-3-Clause
"""Values and times: means with intervals, interquartile means, paired and unpaired tests, sizes of effects."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from modular_framework_benchmark.records.experiment import Direction, Metric
from modular_framework_benchmark.statistics.comparison import Effect, Interval

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

RESAMPLES = 1999
BOOTSTRAP_LIMIT = 1000
"""Values above which the normal limit stands for the bootstrap: the two then differ by little, and the bootstrap would
take seconds for each figure."""
SMALLEST_STRATUM = 10
"""Fewer values in a stratum make the bootstrap of that stratum too narrow; all values are then resampled as one."""
SMALLEST_BOOTSTRAP = 8
"""With fewer values, resamples are too often all alike; Student's t stands for the bootstrap."""


def mean_interval(
    values: Floats, strata: Integers, confidence: float, generator: np.random.Generator
) -> Interval | None:
    """Returns the interval of a mean, by the symmetric studentised bootstrap, stratified; None of a single value.

    It is used for paired differences because it keeps its level with few and with skewed values, where percentile and
    BCa bootstraps are too narrow (docs/statistics.md has the figures).
    Source: P. Hall, On symmetric bootstrap confidence intervals, J. R. Statist. Soc. B 50 (1988) 35-45.

    Args:
        values: Independent values, shape (n,), n at least 1.
        strata: Stratum of each, shape (n,).
        confidence: Level of the interval.
        generator: What the resamples are drawn with.
    """
    groups = _strata(values, strata)
    mean, deviation = float(np.mean(values)), _standard_error(groups)
    if len(values) == 1:
        return None
    if deviation <= 1e-12 * max(1.0, abs(mean)):
        return Interval(mean, mean, confidence, "all values are equal")
    factor = float(stats.t.isf((1 - confidence) / 2, len(values) - len(groups)))
    method = "Student's t"
    if SMALLEST_BOOTSTRAP <= len(values) <= BOOTSTRAP_LIMIT:
        resampled = _studentised_quantile(groups, confidence, generator)
        if np.isfinite(resampled):
            factor, method = resampled, f"symmetric studentised bootstrap, {RESAMPLES} resamples"
    return Interval(mean - factor * deviation, mean + factor * deviation, confidence, method)


def within_bounds(interval: Interval, metric: Metric, values: Floats) -> Interval:
    """Returns the part of an interval in which the figure of a metric can be.

    It holds the true figure as often as the whole interval, for the figure is never in the part that is cut off.

    Args:
        interval: Interval of a mean of values.
        metric: What they are of.
        values: The values, shape (n,), n at least 1; where they are beyond its bounds, these do not hold.
    """
    lowest, highest = metric.bounds
    low, high = max(interval.low, min(lowest, values.min())), min(interval.high, max(highest, values.max()))
    if (low, high) == (interval.low, interval.high):
        return interval
    return replace(interval, low=float(low), high=float(high), method=f"{interval.method}, within the metric's bounds")


def interquartile_mean(values: Floats) -> float:
    """Returns the mean of the middle half."""
    return float(stats.trim_mean(values, 0.25))


def interquartile_mean_interval(
    values: Floats, strata: Integers, confidence: float, generator: np.random.Generator
) -> Interval:
    """Returns the interval of an interquartile mean: the stratified BCa bootstrap, or its normal limit.

    Args:
        values: Independent values, shape (n,), n at least 1.
        strata: Stratum of each, shape (n,).
        confidence: Level of the interval.
        generator: What the resamples are drawn with.
    """
    middle = interquartile_mean(values)
    if len(values) < SMALLEST_BOOTSTRAP:
        return Interval(float(values.min()), float(values.max()), confidence, "range: too few values for a bootstrap")
    if len(values) > BOOTSTRAP_LIMIT:
        low, high = stats.mstats.trimmed_mean_ci(values, limits=(0.25, 0.25), alpha=1 - confidence)
        return Interval(float(low), float(high), confidence, "Student's t of the trimmed mean")
    if np.ptp(values) == 0.0:
        return Interval(middle, middle, confidence, "all values are equal")

    def middle_of(*groups: Floats, axis: int = -1) -> Floats:
        return np.asarray(stats.trim_mean(np.concatenate(groups, axis=axis), 0.25, axis=axis))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of a middle half that is all equal: see below
        found = stats.bootstrap(
            tuple(_strata(values, strata)), middle_of, vectorized=True, n_resamples=RESAMPLES, batch=500,
            confidence_level=confidence, method="BCa", rng=generator,
        ).confidence_interval  # fmt: skip
    if not np.isfinite([found.low, found.high]).all():  # the middle half is a single value in every jackknife sample
        return Interval(middle, middle, confidence, "the middle half is all equal")
    return Interval(float(found.low), float(found.high), confidence, f"BCa bootstrap, {RESAMPLES} resamples")


def paired_p_value(differences: Floats) -> float:
    """Returns the two-sided p value of Wilcoxon's signed rank test; pairs without a difference are left out by it."""
    if not np.any(differences):
        return 1.0
    return float(stats.wilcoxon(differences).pvalue)


def sign_flip_p_value(differences: Floats, generator: np.random.Generator) -> float:
    """Returns the two-sided p value of the sign flip test of a mean: either sign of each difference is as likely.

    With differences of -1, 0 and 1 it is McNemar's exact test; it also holds for sums of several pairs of one seed.

    Args:
        differences: Independent differences, shape (n,).
        generator: What the flips are drawn with when there are too many for all of them.
    """
    if len(differences) < 2 or not np.any(differences):
        return 1.0  # of a single difference, either sign is as far from 0

    def difference_of_means(first: Floats, second: Floats, axis: int = -1) -> Floats:
        return np.asarray(np.mean(first, axis=axis) - np.mean(second, axis=axis))

    return float(
        stats.permutation_test(
            (differences, np.zeros_like(differences)), difference_of_means, permutation_type="samples",
            vectorized=True, n_resamples=9999, batch=500, rng=generator,
        ).pvalue
    )  # fmt: skip


def unpaired_p_value(first: Floats, second: Floats) -> float:
    """Returns the two-sided p value of the Mann-Whitney U test."""
    if np.ptp(np.concatenate([first, second])) == 0.0:
        return 1.0
    return float(stats.mannwhitneyu(first, second).pvalue)


def unpaired_interval(first: Floats, second: Floats, confidence: float) -> Interval | None:
    """Returns the interval of the difference of two means, Welch's; None where a method has a single value."""
    if min(len(first), len(second)) < 2:
        return None
    difference = float(np.mean(first) - np.mean(second))
    if max(np.ptp(first), np.ptp(second)) == 0.0:
        return Interval(difference, difference, confidence, "all values are equal")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of values that are nearly equal: the interval is narrow
        found = stats.ttest_ind(first, second, equal_var=False).confidence_interval(confidence)
    return Interval(float(found.low), float(found.high), confidence, "Welch")


def rank_biserial(differences: Floats) -> Effect:
    """Returns the matched-pairs rank-biserial correlation: 1 where the first is higher in every pair, -1 lower.

    Source: D. S. Kerby, The simple difference formula, Comprehensive Psychology 3 (2014) 1.
    """
    differing = differences[differences != 0.0]
    ranks = stats.rankdata(np.abs(differing))
    value = float(np.sum(ranks * np.sign(differing)) / np.sum(ranks)) if len(differing) else 0.0
    return Effect("matched-pairs rank-biserial correlation", value)


def improvement(first: Floats, second: Floats, better: Direction) -> float:
    """Returns the share of pairs in which the first is better; ties count half."""
    sign = 1.0 if better is Direction.HIGHER else -1.0
    return float(np.mean(0.5 + 0.5 * np.sign(sign * (first - second))))


def unpaired_improvement(first: Floats, second: Floats, better: Direction) -> float:
    """Returns the probability that an episode of the first is better than one of the second; ties count half."""
    above = float(stats.mannwhitneyu(first, second).statistic) / (len(first) * len(second))
    return above if better is Direction.HIGHER else 1.0 - above


def optimality_gap(values: Floats, target: float, better: Direction) -> float:
    """Returns how far the values are from a target on average, where values beyond it count as the target.

    Args:
        values: Values, shape (n,), n at least 1.
        target: What is good enough, in their unit.
        better: Which values are better.
    """
    gaps = target - values if better is Direction.HIGHER else values - target
    return float(np.mean(np.maximum(gaps, 0.0)))


def _strata(values: Floats, strata: Integers) -> list[Floats]:
    groups = [values[strata == stratum] for stratum in np.unique(strata)]
    return groups if min(len(group) for group in groups) >= SMALLEST_STRATUM else [values]


def _standard_error(groups: list[Floats]) -> float:
    """Returns the standard error of the mean of all values, from the spread within each stratum."""
    count = sum(len(group) for group in groups)
    if count < 2:
        return float("inf")
    return float(np.sqrt(sum(len(group) * np.var(group, ddof=1) for group in groups)) / count)


def _studentised_quantile(groups: list[Floats], confidence: float, generator: np.random.Generator) -> float:
    """Returns how many standard errors a resampled mean is away from the mean, at the level of the interval."""
    count = sum(len(group) for group in groups)
    shifts, variances = np.zeros(RESAMPLES), np.zeros(RESAMPLES)
    for group in groups:
        drawn = group[generator.integers(0, len(group), (RESAMPLES, len(group)))]
        shifts += (drawn.mean(axis=1) - group.mean()) * len(group)
        variances += len(group) * drawn.var(axis=1, ddof=1)
    smallest = (1e-9 * count * _standard_error(groups)) ** 2
    away = np.where(variances > smallest, np.abs(shifts) / np.sqrt(np.maximum(variances, smallest)), np.inf)
    return float(np.quantile(away, confidence, method="higher"))
