# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of inverse kinematics on the poses of a trial (component `kinematics`)."""

from __future__ import annotations

from modular_framework_benchmark.metrics.measurements import EpisodeMeasurements


def _figure(episode: EpisodeMeasurements, name: str) -> float | None:
    values = [report.figures[name] for report in episode.of_component("kinematics") if name in report.figures]
    return sum(values) / len(values) if values else None


def solved_share(episode: EpisodeMeasurements) -> float | None:
    """Share of the reachable poses with a solution within bounds that forward kinematics confirms, 0 to 1."""
    return _figure(episode, "solved_share")


def solving_time(episode: EpisodeMeasurements) -> float | None:
    """Median time to solve a pose, solved or not [s]."""
    return _figure(episode, "solving_time_s")


def solutions(episode: EpisodeMeasurements) -> float | None:
    """Mean number of solutions of a pose."""
    return _figure(episode, "solutions")


def position_error(episode: EpisodeMeasurements) -> float | None:
    """Greatest distance of the tip from a solved pose [m]."""
    return _figure(episode, "position_error_m")


def rotation_error(episode: EpisodeMeasurements) -> float | None:
    """Greatest angle of the tip from a solved pose [rad]."""
    return _figure(episode, "rotation_error_rad")
