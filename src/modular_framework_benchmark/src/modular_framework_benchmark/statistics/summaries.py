# SPDX-License-Identifier: BSD-3-Clause
"""Summary of a metric for a method."""

from __future__ import annotations

import math

import numpy as np

from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.comparison import Estimate, Interval, MethodSummary
from modular_framework_benchmark.statistics.observations import EpisodeTable, Floats, Integers, Observations, unit_means
from modular_framework_benchmark.statistics.rates import rate_interval
from modular_framework_benchmark.statistics.values import (
    MIN_UNITS,
    bounded_mean_interval,
    episodes_for_restricted_mean,
    median_interval,
    restricted_mean_interval,
)


def summarise_method(
    table: EpisodeTable, metric: Metric, method: str, confidence: float | None = None
) -> MethodSummary:
    """Returns the summary of a metric for a method.

    Args:
        table: Finished episodes.
        metric: Metric to summarise.
        method: Level of the compared factor.
        confidence: Confidence level of the intervals; None for the confidence level of the experiment.
    """
    observed = table.observations(metric, method)
    counts = table.counts(metric, method)
    confidence = table.results.description.confidence if confidence is None else confidence
    present = observed.at_rows(np.flatnonzero(~np.isnan(observed.scores)))
    is_rate = metric.kind is MetricKind.RATE
    estimate = mean = quartiles = None
    if len(present.scores):
        estimate = _rate(present, confidence) if is_rate else _median(present, confidence)
    known = present.at_rows(np.flatnonzero(~np.isnan(present.values)))
    if len(known.values) and not is_rate:
        mean = _mean(known, metric, confidence)
        first, third = np.quantile(known.values, [0.25, 0.75])
        quartiles = float(first), float(third)
    return MethodSummary(
        method=method, metric=metric.name, unit=metric.unit, levels="", counts=counts, estimate=estimate, mean=mean,
        quartiles=quartiles, sentence=sentences.summary_sentence(metric, method, estimate, counts),
    )  # fmt: skip


def _rate(observed: Observations, confidence: float) -> Estimate:
    means, _ = unit_means(observed.values, observed.units)
    interval: Interval | None = None
    if len(means) == len(observed.values) and len(means) >= MIN_UNITS:
        interval = rate_interval(int(means.sum()), len(means), confidence)
    else:
        interval = bounded_mean_interval(means, (0.0, 1.0), confidence)
    return Estimate("rate", float(np.mean(means)), interval)


def _median(observed: Observations, confidence: float) -> Estimate:
    medians = _unit_medians(observed.scores, observed.units)
    return Estimate("median", float(np.median(medians)), median_interval(medians, confidence))


def _unit_medians(scores: Floats, units: Integers) -> Floats:
    order = np.argsort(units, kind="stable")
    starts = np.unique(units[order], return_index=True)[1]
    if len(starts) == len(scores):
        return scores
    return np.array([np.median(part) for part in np.split(scores[order], starts[1:])])


def _mean(observed: Observations, metric: Metric, confidence: float) -> Estimate:
    """Returns the mean or restricted mean over the units, with an interval if the metric's bounds allow one."""
    means, sizes = unit_means(observed.values, observed.units)
    mean, single = float(np.mean(means)), len(means) == len(observed.values)
    low, high = metric.bounds
    if metric.limit is not None:
        limits = (metric.limit, low if metric.better is Direction.LOWER else high)
        interval = restricted_mean_interval(observed.values, observed.censored, limits, confidence) if single else None
        needed = episodes_for_restricted_mean(observed.censored) if single and interval is None else None
        return Estimate("restricted mean", mean, interval, needed)
    within_bounds = low <= observed.values.min() and observed.values.max() <= high
    bounded = math.isfinite(low) and math.isfinite(high) and within_bounds
    return Estimate("mean", mean, bounded_mean_interval(means, (low, high), confidence) if bounded else None)
