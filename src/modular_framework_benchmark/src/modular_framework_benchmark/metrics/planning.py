# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of motion planning over all plans of an episode (component `planning`)."""

from __future__ import annotations

import math

from modular_framework_benchmark.metrics import motion_figures
from modular_framework_benchmark.metrics.measurements import EpisodeMeasurements, Motion
from modular_framework_ros.reported_figures import (
    CLEARANCE,
    CONCURRENT,
    PLANNER_METHOD_TIME,
    PLANNER_QUEUE_TIME,
    PLANNER_TRANSPORT_TIME,
    PLANNING_TIME,
    PROCESSOR_TIME,
    SEARCH_TIME,
)


def _motions(episode: EpisodeMeasurements) -> list[Motion]:
    """Returns the planned motions that were executed, or all planned motions if none was executed.

    A plan that only tests feasibility and is repeated later counts once.
    """
    planned = [report.motion for report in episode.of_component("planning") if report.succeeded and report.motion]
    executed = {_key(report.motion) for report in episode.of_component("execution") if report.motion}
    return [motion for motion in planned if _key(motion) in executed] or planned


def _key(motion: Motion) -> tuple[tuple[str, ...], bytes]:
    return motion.joints, motion.positions.tobytes()


def _mean(values: list[float]) -> float | None:
    return math.fsum(values) / len(values) if values else None  # fsum does not depend on the order


def planning_time(episode: EpisodeMeasurements) -> float | None:
    """Mean real time of a plan from request to answer, failed plans included [s].

    Concurrent plans wait for each other: see `concurrent_plans`.
    """
    return _mean([report.figures.get(PLANNING_TIME, report.wall_s) for report in episode.of_component("planning")])


def planning_processor_time(episode: EpisodeMeasurements) -> float | None:
    """Mean processor time of a plan, failed plans included [s]; concurrent plans are measured separately."""
    return _mean(episode.values_of(PROCESSOR_TIME))


def concurrent_plans(episode: EpisodeMeasurements) -> float | None:
    """Maximum number of plans that ran concurrently."""
    return max(episode.values_of(CONCURRENT), default=None)


def search_time(episode: EpisodeMeasurements) -> float | None:
    """Mean time until a path was found, before shortening, timing and checks, if the planner reports it [s]."""
    return _mean(episode.values_of(SEARCH_TIME))


def planner_method_time(episode: EpisodeMeasurements) -> float | None:
    """Mean time of an external planner's function [s]; none for other planners."""
    return _mean(episode.values_of(PLANNER_METHOD_TIME))


def planner_queue_time(episode: EpisodeMeasurements) -> float | None:
    """Mean time for which a plan waits for other plans of the same external planner [s]."""
    return _mean(episode.values_of(PLANNER_QUEUE_TIME))


def planner_transport_time(episode: EpisodeMeasurements) -> float | None:
    """Mean time to exchange messages with an external planner [s]."""
    return _mean(episode.values_of(PLANNER_TRANSPORT_TIME))


def planning_success(episode: EpisodeMeasurements) -> float | None:
    """Fraction of the planning requests that returned a motion, 0 to 1."""
    reports = episode.of_component("planning")
    return _mean([float(report.succeeded) for report in reports])


def path_length(episode: EpisodeMeasurements) -> float | None:
    """Mean length in joint space of the planned paths that were executed [rad]."""
    return _mean([motion_figures.path_length(motion.positions) for motion in _motions(episode)])


def motion_duration(episode: EpisodeMeasurements) -> float | None:
    """Mean duration of the planned motions that were executed [s]."""
    return _mean([motion_figures.motion_duration(motion.times_s) for motion in _motions(episode)])


def smoothness(episode: EpisodeMeasurements) -> float | None:
    """Mean log dimensionless jerk of the planned motions that were executed; nearer to 0 is smoother."""
    values = [motion_figures.smoothness(motion.times_s, motion.positions) for motion in _motions(episode)]
    return _mean([value for value in values if value is not None])


def clearance(episode: EpisodeMeasurements) -> float | None:
    """Minimum distance between the robot and its obstacles along the planned motions [m]."""
    return min(episode.values_of(CLEARANCE), default=None)


def attempts(episode: EpisodeMeasurements) -> float | None:
    """Number of planning requests, successful or not."""
    reports = episode.of_component("planning")
    return float(len(reports)) if reports else None
