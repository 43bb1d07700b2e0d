# SPDX-License-Identifier: BSD-3-Clause
"""Curve of a metric: the share of episodes that are at least as good as each value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from statsmodels.stats.proportion import proportion_confint

from modular_framework_benchmark.records.experiment import Direction, Metric
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics.observations import EpisodeTable, metrics_of

MOST_POINTS = 200


@dataclass(frozen=True, slots=True)
class Curve:
    """A share of episodes over a value of the metric.

    Attributes:
        at: Values of the metric, rising, in its unit.
        share: Share of the episodes at each, from 0 to 1.
        low: Lower end of its interval at each.
        high: Upper end.
        confidence: Level of the interval at each point (not of the whole band).
        episodes: How many episodes it is of.
        left_out: Episodes that are in none of it because they have no value.
        method: How it was computed, in words.
    """

    at: tuple[float, ...]
    share: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    confidence: float
    episodes: int
    left_out: int
    method: str


def performance_profile(
    results: ExperimentResults, metric_name: str, method: str, at: Sequence[float] | None = None
) -> Curve:
    """Returns the share of a method's episodes that are at least as good as each value of a metric.

    A failure reaches no value. Source: R. Agarwal and others, Deep
    reinforcement learning at the edge of the statistical precipice, NeurIPS 2021.

    Args:
        results: The finished episodes.
        metric_name: Name of the metric.
        method: Level of the compared factor.
        at: Values of the metric; None: up to 200 of those that were seen.

    Raises:
        ValueError: The metric is not measured.
    """
    metric = _metric(results, metric_name)
    seen = EpisodeTable(results).observations(metric, method)
    known = ~np.isnan(seen.scores)
    reached, present = seen.scores[known], int(known.sum())
    values = _points(reached[np.isfinite(reached)]) if at is None else np.sort(np.asarray(at, dtype=float))
    confidence = results.description.confidence
    ranked = np.sort(reached)
    if metric.better is Direction.LOWER:
        counts = np.searchsorted(ranked, values, side="right")
    else:
        counts = present - np.searchsorted(ranked, values, side="left")
    units = len(np.unique(seen.units[known]))
    low, high = _band(counts * units / max(present, 1), units, confidence)
    return Curve(
        at=_floats(values),
        share=_floats(counts / max(present, 1)),
        low=low,
        high=high,
        confidence=confidence,
        episodes=present,
        left_out=int(np.sum(~known)),
        method="share of episodes, Clopper-Pearson interval of as many as there are units at each value",
    )


def _metric(results: ExperimentResults, name: str) -> Metric:
    for metric in metrics_of(results):
        if metric.name == name:
            return metric
    known = ", ".join(metric.name for metric in metrics_of(results))
    raise ValueError(f"metric '{name}' is not measured; measured are: {known}")


def _points(values: np.ndarray) -> np.ndarray:
    found = np.unique(values)
    if len(found) <= MOST_POINTS:
        return found
    return np.unique(np.quantile(found, np.linspace(0.0, 1.0, MOST_POINTS)))


def _band(counts: np.ndarray, units: int, confidence: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    if not units or not len(counts):
        return (0.0,) * len(counts), (1.0,) * len(counts)
    low, high = proportion_confint(counts, np.full(len(counts), units), alpha=1 - confidence, method="beta")
    return _floats(np.asarray(low)), _floats(np.asarray(high))


def _floats(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
