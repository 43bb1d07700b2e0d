# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of inverse kinematics on the poses of a trial (component `kinematics`)."""

from __future__ import annotations

from modular_framework_benchmark.metrics.measurements import EpisodeMeasurements
from modular_framework_ros.reported_figures import (
    POSITION_ERROR,
    ROTATION_ERROR,
    SOLUTIONS,
    SOLVED_SHARE,
    SOLVING_TIME,
    Figure,
)


def _mean(episode: EpisodeMeasurements, figure: Figure) -> float | None:
    values = episode.values_of(figure)
    return sum(values) / len(values) if values else None


def solved_share(episode: EpisodeMeasurements) -> float | None:
    """Fraction of the reachable poses with a solution within bounds that forward kinematics confirms, 0 to 1."""
    return _mean(episode, SOLVED_SHARE)


def solving_time(episode: EpisodeMeasurements) -> float | None:
    """Median time per pose, solved or not [s]."""
    return _mean(episode, SOLVING_TIME)


def solutions(episode: EpisodeMeasurements) -> float | None:
    """Mean number of solutions per pose."""
    return _mean(episode, SOLUTIONS)


def position_error(episode: EpisodeMeasurements) -> float | None:
    """Maximum position error of the tip over the solved poses [m]."""
    return _mean(episode, POSITION_ERROR)


def rotation_error(episode: EpisodeMeasurements) -> float | None:
    """Maximum rotation error of the tip over the solved poses [rad]."""
    return _mean(episode, ROTATION_ERROR)
