# SPDX-License-Identifier: BSD-3-Clause
"""Summarises one method by one metric."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modular_framework_benchmark.records.experiment import Metric, MetricKind
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.comparison import Estimate, Interval, MethodSummary
from modular_framework_benchmark.statistics.findings import figure_name
from modular_framework_benchmark.statistics.observations import EpisodeTable
from modular_framework_benchmark.statistics.rates import rate_interval
from modular_framework_benchmark.statistics.values import (
    interquartile_mean,
    interquartile_mean_interval,
    mean_interval,
    within_bounds,
)

Floats = NDArray[np.float64]


def summarise_method(table: EpisodeTable, metric: Metric, method: str, generator: np.random.Generator) -> MethodSummary:
    """Returns the summary of a method by a metric.

    Args:
        table: The finished episodes.
        metric: What is summarised.
        method: Level of the compared factor.
        generator: What resamples are drawn with.
    """
    seen = table.observations(metric, method)
    present = ~np.isnan(seen.values)
    confidence = table.results.description.confidence
    estimate = _estimate(metric, seen.values[present], confidence, generator)
    unbroken = seen.values[present & ~seen.broken]
    counts = table.counts(metric, method)
    summary = MethodSummary(
        method=method,
        metric=metric.name,
        unit=metric.unit,
        levels="",
        counts=counts,
        estimate=estimate,
        without_broken=_estimate(metric, unbroken, confidence, generator) if seen.broken.any() else None,
        median=None,
        interquartile_mean=None,
        quartiles=None,
        sentence=sentences.summary(metric, method, estimate, counts),
    )
    if metric.kind is MetricKind.RATE or estimate is None:
        return summary
    return _with_quartiles(summary, metric, seen.values[present], confidence, generator)


def _with_quartiles(
    summary: MethodSummary, metric: Metric, values: Floats, confidence: float, generator: np.random.Generator
) -> MethodSummary:
    first, median, third = (float(value) for value in np.quantile(values, [0.25, 0.5, 0.75]))
    interval = interquartile_mean_interval(values, np.zeros(len(values), dtype=np.int64), confidence, generator)
    middle = Estimate("interquartile mean", interquartile_mean(values), within_bounds(interval, metric, values))
    return MethodSummary(
        summary.method, summary.metric, summary.unit, summary.levels, summary.counts, summary.estimate,
        summary.without_broken, median, middle, (first, third), summary.sentence,
    )  # fmt: skip


def _estimate(metric: Metric, values: Floats, confidence: float, generator: np.random.Generator) -> Estimate | None:
    if not len(values):
        return None
    interval: Interval | None
    if metric.kind is MetricKind.RATE:
        interval = rate_interval(int(values.sum()), len(values), confidence)
    else:
        interval = mean_interval(values, np.zeros(len(values), dtype=np.int64), confidence, generator)
        interval = interval and within_bounds(interval, metric, values)
    return Estimate(figure_name(metric), float(values.mean()), interval)
