# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of the execution of motions (component `execution`), from controllers and joint states."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from modular_framework_benchmark.metrics import motion_figures
from modular_framework_benchmark.metrics.measurements import Array, ComponentReport, EpisodeMeasurements


def _executions(episode: EpisodeMeasurements) -> list[ComponentReport]:
    return [report for report in episode.of_component("execution") if report.succeeded]


def _within(times_s: Array, executions: list[ComponentReport]) -> npt.NDArray[np.bool_]:
    chosen = np.zeros(len(times_s), dtype=bool)
    for report in executions:
        chosen |= (times_s >= report.started_s) & (times_s <= report.ended_s)
    return chosen


def execution_time(episode: EpisodeMeasurements) -> float | None:
    """Total simulated duration of the successful motions [s]."""
    executions = _executions(episode)
    return sum(report.ended_s - report.started_s for report in executions) if executions else None


def execution_success(episode: EpisodeMeasurements) -> float | None:
    """Fraction of the motions that were executed completely, 0 to 1."""
    reports = episode.of_component("execution")
    return sum(report.succeeded for report in reports) / len(reports) if reports else None


def _tracking_errors(episode: EpisodeMeasurements) -> Array:
    executions = _executions(episode)
    errors = [samples.errors[_within(samples.times_s, executions)].ravel() for samples in episode.tracking]
    return np.concatenate(errors) if errors else np.empty(0)


def tracking_error(episode: EpisodeMeasurements) -> float | None:
    """Root mean square of measured minus desired joint position, over joints and over time in motion [rad]."""
    return motion_figures.rms(_tracking_errors(episode))


def greatest_tracking_error(episode: EpisodeMeasurements) -> float | None:
    """Maximum deviation of a joint from its desired position during motions [rad]."""
    errors = _tracking_errors(episode)
    return float(np.abs(errors).max()) if errors.size else None


def _over_motions(episode: EpisodeMeasurements, figure: Callable[[Array, Array], float | None]) -> list[float | None]:
    """Returns a figure of the measured times and positions of the joints in each executed motion."""
    samples, figures = episode.joints, []
    for report in _executions(episode):
        if samples is None or report.motion is None:
            continue
        columns = [samples.joints.index(joint) for joint in report.motion.joints if joint in samples.joints]
        rows = (samples.times_s >= report.started_s) & (samples.times_s <= report.ended_s)
        if rows.any() and columns:
            figures.append(figure(samples.times_s[rows], samples.positions[rows][:, columns]))
    return figures


def executed_length(episode: EpisodeMeasurements) -> float | None:
    """Total measured length of the executed motions in joint space [rad]."""
    lengths = _over_motions(episode, lambda times, positions: motion_figures.path_length(positions))
    return sum(length for length in lengths if length is not None) if lengths else None


def executed_smoothness(episode: EpisodeMeasurements) -> float | None:
    """Mean log dimensionless jerk of the executed motions, as measured; nearer to 0 is smoother."""
    values = [value for value in _over_motions(episode, motion_figures.smoothness) if value is not None]
    return math.fsum(values) / len(values) if values else None  # fsum does not depend on the order


def greatest_effort(episode: EpisodeMeasurements) -> float | None:
    """Maximum absolute effort of a joint during the episode [Nm; N for prismatic joints]."""
    if episode.joints is None or not np.isfinite(episode.joints.efforts).any():
        return None
    return float(np.nanmax(np.abs(episode.joints.efforts)))
