# SPDX-License-Identifier: BSD-3-Clause
"""Compares two methods on a metric by the win difference, before the multiplicity correction.

The win difference decides the direction, the p value and the interval of every metric. Sources: S. J.
Pocock and others, The win ratio, European Heart J. 33 (2012) 176-182; R. Agarwal and others, NeurIPS 2021.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from modular_framework_benchmark.records.experiment import Metric, MetricKind
from modular_framework_benchmark.statistics import rates, sequential
from modular_framework_benchmark.statistics.comparison import Estimate, Interval, PairCounts, PairFigures
from modular_framework_benchmark.statistics.observations import EpisodeTable, Floats, Integers, Pairs, unit_means
from modular_framework_benchmark.statistics.values import MIN_UNITS, bounded_mean_interval, sign_flip_p_value


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding(PairFigures):
    """Comparison before the multiplicity correction.

    Attributes:
        metric: Compared metric.
        discordance: Mean square of the units' win differences; with one pair per unit it is the fraction of discordant
            pairs. The sample size depends on it. None without data.
        min_attainable_p: Minimum attainable p value with this number of discordant units; 0 for an anytime-valid test.
        without_broken: Comparison that excludes pairs with a broken or invalid episode; None without such pairs.
    """

    metric: Metric
    discordance: float | None = None
    min_attainable_p: float = 1.0
    without_broken: Finding | None = None


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of a comparison.

    Attributes:
        confidence: Confidence level of the intervals.
        at_any_time: Whether tests and intervals must be anytime-valid.
        mean_intervals: Whether the mean differences of all bounded metrics get a betting interval, not only the
            differences of partial credit.
    """

    confidence: float
    at_any_time: bool
    mean_intervals: bool = False


def compare_pair(table: EpisodeTable, metric: Metric, first: str, second: str, settings: Settings) -> Finding:
    """Returns the comparison of two methods for a metric.

    Args:
        table: Finished episodes.
        metric: Compared metric.
        first: First method.
        second: Second method.
        settings: Settings of the comparison.
    """
    matched = table.pairs(metric, first, second)
    return _compare_pairs(replace(_empty_finding(first, second, metric), unit_noun=table.unit_noun), matched, settings)


def _empty_finding(first: str, second: str, metric: Metric) -> Finding:
    return Finding(
        first,
        second,
        PairCounts(
            pairs=0, units=0, won=0, lost=0, failed=0, broken=0, missing=0, unlike=0, unmatched=0, at_random=False
        ),
        metric=metric,
    )


def _compare_pairs(empty: Finding, matched: Pairs, settings: Settings) -> Finding:
    metric = empty.metric
    if settings.at_any_time:
        matched = matched.complete_units()
    outcomes = matched.outcomes(metric.better)
    means, sizes = unit_means(outcomes, _coarser_units(matched))
    finding = replace(empty, counts=_pair_counts(matched, outcomes, len(means)))
    if not len(matched):
        return finding
    finding = replace(
        _with_test(finding, means, sizes, settings),
        first_estimate=_point_estimate(matched.first.scores, metric),
        second_estimate=_point_estimate(matched.second.scores, metric),
        mean_difference=_mean_difference(matched, metric, settings),
        discordance=float(np.mean(means**2)),
        min_attainable_p=0.0 if settings.at_any_time else 2.0 ** (1.0 - np.count_nonzero(means)),
    )
    if not matched.broken.any():
        return finding
    return replace(finding, without_broken=_compare_pairs(empty, matched.select(~matched.broken), settings))


def _coarser_units(matched: Pairs) -> Integers:
    """Returns the unit ids of the method with fewer units; the ids of two methods differ only for random pairs."""
    return min(matched.first.units, matched.second.units, key=lambda partition: len(np.unique(partition)))


def _pair_counts(matched: Pairs, outcomes: Floats, units: int) -> PairCounts:
    sides = (matched.first, matched.second)
    return PairCounts(
        pairs=len(matched),
        units=units,
        won=int(np.sum(outcomes > 0)),
        lost=int(np.sum(outcomes < 0)),
        failed=int(sum(np.isinf(side.scores).sum() for side in sides)),
        broken=int(sum(side.broken.sum() for side in sides)),
        missing=matched.missing,
        unlike=matched.unlike,
        unmatched=matched.unmatched,
        at_random=matched.at_random,
    )


def _with_test(finding: Finding, means: Floats, sizes: Integers, settings: Settings) -> Finding:
    """Returns the finding with the mean win difference over the units and its test."""
    p_value: float | None = None
    interval: Interval | None = None
    if len(means) < MIN_UNITS:
        test = f"none: fewer than {MIN_UNITS} units"
    elif settings.at_any_time:
        test, p_value = "betting test, valid at any time", sequential.anytime_p_value(means)
        interval = sequential.anytime_interval(means, settings.confidence)
    elif np.isin(means, (-1.0, 0.0, 1.0)).all():
        pairs = rates.PairOutcomes(int(np.sum(means > 0)), int(np.sum(means < 0)), len(means))
        test, p_value = "McNemar's exact test", rates.paired_p_value(pairs)
        interval = rates.paired_interval(pairs, settings.confidence)
    else:
        test, p_value = "sign flip test of the units", sign_flip_p_value(means, sizes)
        interval = bounded_mean_interval(means, (-1.0, 1.0), settings.confidence)
    difference = Estimate("win difference", float(np.mean(means)), interval)
    return replace(finding, difference=difference, p_value=p_value, test=test)


def _point_estimate(scores: Floats, metric: Metric) -> float:
    return float(np.mean(scores) if metric.kind is MetricKind.RATE else np.median(scores))


def _mean_difference(matched: Pairs, metric: Metric, settings: Settings) -> Estimate | None:
    """Returns the mean difference over the pairs with two known values; descriptive only."""
    differences = matched.first.values - matched.second.values
    is_known = ~np.isnan(differences)
    if metric.kind is MetricKind.RATE or not is_known.any():
        return None
    means, _ = unit_means(differences[is_known], _coarser_units(matched)[is_known])
    low, high = metric.bounds
    bounds_width, interval = high - low, None
    known = np.concatenate([matched.first.values[is_known], matched.second.values[is_known]])
    is_bounded = math.isfinite(bounds_width) and low <= known.min() and known.max() <= high
    is_wanted = settings.mean_intervals or metric.kind is MetricKind.PARTIAL_CREDIT
    if is_wanted and is_bounded and len(means) >= MIN_UNITS:
        interval = sequential.anytime_interval(means, settings.confidence, bounds_width)
    return Estimate("mean difference", float(np.mean(means)), interval)
