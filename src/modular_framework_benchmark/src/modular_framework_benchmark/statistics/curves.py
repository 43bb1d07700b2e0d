# SPDX-License-Identifier: BSD-3-Clause
"""Curves of a metric: the share of episodes that reach a value, and the share that are finished by a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats
from statsmodels.duration.survfunc import SurvfuncRight
from statsmodels.stats.proportion import proportion_confint

from modular_framework_benchmark.records.experiment import Direction, Metric
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics.observations import EpisodeTable, Observations, metrics_of

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

    An episode that counts at the limit reaches no value better than it. Source: R. Agarwal and others, Deep
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
    reached = _reached(seen, metric)
    present = int(np.sum(~np.isnan(seen.values)))
    values = _points(reached[np.isfinite(reached)]) if at is None else np.sort(np.asarray(at, dtype=float))
    confidence = results.description.confidence
    ranked = np.sort(reached)
    if metric.better is Direction.LOWER:
        counts = np.searchsorted(ranked, values, side="right")
    else:
        counts = present - np.searchsorted(ranked, values, side="left")
    low, high = _band(counts, present, confidence)
    return Curve(
        at=_floats(values),
        share=_floats(counts / max(present, 1)),
        low=low,
        high=high,
        confidence=confidence,
        episodes=present,
        left_out=len(seen.values) - present,
        method="share of episodes, Wilson interval at each value",
    )


def share_finished(results: ExperimentResults, metric_name: str, method: str) -> Curve:
    """Returns the share of a method's episodes that are finished by each time: 1 minus the Kaplan-Meier estimate.

    An episode at the limit is not finished by then. A broken episode says nothing of the method: it is taken out when
    it broke, where that is known, otherwise at the start.

    Args:
        results: The finished episodes.
        metric_name: Name of a metric with a limit, usually a time.
        method: Level of the compared factor.

    Raises:
        ValueError: The metric is not measured, has no limit, or higher values of it are better.
    """
    metric = _metric(results, metric_name)
    if metric.limit is None or metric.better is Direction.HIGHER:
        raise ValueError(f"metric '{metric_name}' is no time with a limit, so it has no share finished by a time")
    seen = EpisodeTable(results).observations(metric, method)
    times = np.where(seen.broken, _broken_at(results, metric.limit, method), seen.values)
    known = times > 0.0
    confidence = results.description.confidence
    left_out = int(np.sum(~known))
    if not np.any(known & ~seen.censored):
        return Curve((), (), (), (), confidence, int(known.sum()), left_out, "Kaplan-Meier: no episode finished")
    found = SurvfuncRight(times[known], (~seen.censored)[known])
    chosen = np.unique(np.linspace(0, len(found.surv_times) - 1, MOST_POINTS).astype(int))
    survival, error = found.surv_prob[chosen], found.surv_prob_se[chosen]
    low, high = _log_log_band(survival, error, confidence)
    return Curve(
        at=_floats(found.surv_times[chosen]),
        share=_floats(1.0 - survival),
        low=_floats(1.0 - high),
        high=_floats(1.0 - low),
        confidence=confidence,
        episodes=int(known.sum()),
        left_out=left_out,
        method="Kaplan-Meier, log-log interval at each time",
    )


def _metric(results: ExperimentResults, name: str) -> Metric:
    for metric in metrics_of(results):
        if metric.name == name:
            return metric
    known = ", ".join(metric.name for metric in metrics_of(results))
    raise ValueError(f"metric '{name}' is not measured; measured are: {known}")


def _reached(seen: Observations, metric: Metric) -> np.ndarray:
    """Returns the value that each episode reached, shape (n,) without missing ones; infinitely bad at the limit."""
    never = np.inf if metric.better is Direction.LOWER else -np.inf
    present = ~np.isnan(seen.values)
    return np.where(seen.censored, never, seen.values)[present]


def _points(values: np.ndarray) -> np.ndarray:
    found = np.unique(values)
    if len(found) <= MOST_POINTS:
        return found
    return np.unique(np.quantile(found, np.linspace(0.0, 1.0, MOST_POINTS)))


def _band(counts: np.ndarray, episodes: int, confidence: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    if not episodes or not len(counts):
        return (0.0,) * len(counts), (1.0,) * len(counts)
    low, high = proportion_confint(counts, np.full(len(counts), episodes), alpha=1 - confidence, method="wilson")
    return _floats(np.asarray(low)), _floats(np.asarray(high))


def _log_log_band(survival: np.ndarray, error: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns Greenwood's interval on the log-log scale, which stays between 0 and 1."""
    inner = (survival > 0.0) & (survival < 1.0)
    low, high = survival.copy(), survival.copy()
    logs = np.log(survival[inner])
    width = stats.norm.isf((1 - confidence) / 2) * error[inner] / (survival[inner] * logs)
    low[inner], high[inner] = survival[inner] ** np.exp(-width), survival[inner] ** np.exp(width)
    return low, high


def _broken_at(results: ExperimentResults, limit: float, method: str) -> np.ndarray:
    """Returns the simulated time of each episode of a method [s], 0 where it has none, at most the limit."""
    of_method = results.episodes[results.description.compared] == method
    if "simulated_s" not in results.episodes:
        return np.zeros(int(of_method.sum()))
    times = results.episodes.loc[of_method, "simulated_s"].to_numpy(float)
    return np.minimum(np.nan_to_num(times, nan=0.0), limit)


def _floats(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
