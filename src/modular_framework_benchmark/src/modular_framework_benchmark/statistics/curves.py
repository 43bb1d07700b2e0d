# SPDX-License-Identifier: BSD-3-Clause
"""Performance profiles: the fraction of episodes at least as good as each value of a metric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from statsmodels.stats.proportion import proportion_confint

from modular_framework_benchmark.records.experiment import Direction, Metric
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics.observations import EpisodeTable, metrics_of

MAX_POINTS = 200


@dataclass(frozen=True, slots=True)
class Curve:
    """Fraction of episodes as a function of a metric's value.

    Attributes:
        values: Values of the metric in its unit, ascending.
        fractions: Fraction of episodes at each value, from 0 to 1.
        low: Lower end of the confidence interval at each value.
        high: Upper end of the confidence interval at each value.
        confidence: Confidence level at each value, not of the whole band.
        episodes: Number of episodes with a value.
        missing: Number of episodes without a value.
        method: Description of the computation.
    """

    values: tuple[float, ...]
    fractions: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    confidence: float
    episodes: int
    missing: int
    method: str


def performance_profile(
    results: ExperimentResults, metric_name: str, method: str, values: Sequence[float] | None = None
) -> Curve:
    """Returns the fraction of a method's episodes that are at least as good as each value of a metric.

    A failure reaches no value. Source: R. Agarwal and others, Deep
    reinforcement learning at the edge of the statistical precipice, NeurIPS 2021.

    Args:
        results: Finished episodes.
        metric_name: Name of the metric.
        method: Level of the compared factor.
        values: Values of the metric to evaluate; None for up to 200 observed values.

    Raises:
        ValueError: The metric is not measured.
    """
    metric = _metric(results, metric_name)
    observed = EpisodeTable(results).observations(metric, method)
    is_known = ~np.isnan(observed.scores)
    scores, count = observed.scores[is_known], int(is_known.sum())
    grid = _grid(scores[np.isfinite(scores)]) if values is None else np.sort(np.asarray(values, dtype=float))
    confidence = results.description.confidence
    ordered = np.sort(scores)
    if metric.better is Direction.LOWER:
        counts = np.searchsorted(ordered, grid, side="right")
    else:
        counts = count - np.searchsorted(ordered, grid, side="left")
    units = len(np.unique(observed.units[is_known]))
    low, high = _band(counts * units / max(count, 1), units, confidence)
    return Curve(
        values=_floats(grid),
        fractions=_floats(counts / max(count, 1)),
        low=low,
        high=high,
        confidence=confidence,
        episodes=count,
        missing=int(np.sum(~is_known)),
        method="fraction of episodes; Clopper-Pearson interval at each value for as many episodes as units",
    )


def _metric(results: ExperimentResults, name: str) -> Metric:
    for metric in metrics_of(results):
        if metric.name == name:
            return metric
    known_metrics = ", ".join(metric.name for metric in metrics_of(results))
    raise ValueError(f"metric '{name}' is not measured; the measured metrics are: {known_metrics}")


def _grid(values: np.ndarray) -> np.ndarray:
    distinct = np.unique(values)
    if len(distinct) <= MAX_POINTS:
        return distinct
    return np.unique(np.quantile(distinct, np.linspace(0.0, 1.0, MAX_POINTS)))


def _band(counts: np.ndarray, units: int, confidence: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    if not units or not len(counts):
        return (0.0,) * len(counts), (1.0,) * len(counts)
    low, high = proportion_confint(counts, np.full(len(counts), units), alpha=1 - confidence, method="beta")
    return _floats(np.asarray(low)), _floats(np.asarray(high))


def _floats(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
