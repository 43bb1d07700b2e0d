# SPDX-License-Identifier: BSD-3-Clause
"""Time-optimal parameterization of a path, with blends at waypoints where they are collision-free."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.phase_times import TIMING
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter
from modular_framework_planning.trajectory_processing.blended_path import free_blends
from modular_framework_planning.trajectory_processing.compiled_timing import max_blends
from modular_framework_planning.trajectory_processing.time_parameterization import (
    MAX_PERIOD_S,
    MIN_PERIOD_S,
    parameterize,
)

# Divisors of the accelerations, tried in order under path constraints: in a blend, the motion leaves the path by
# acceleration * window^2 / 24 (see parameterize), 3e-4 rad at 5 rad/s^2, which tight tolerances do not allow.
ACCELERATION_DIVISORS = (1.0, 4.0, 16.0)
VERTEX_TOLERANCE = 1.0e-9  # distance below which consecutive vertices are merged [rad or m]


class AddTimeOptimalParameterization(RequestAdapter):
    """Adds a trajectory to a path without trajectory.

    Parameters of the pipeline: `path_tolerance` (maximum distance between a waypoint and its blend [rad or m],
    blend_deviation by default) and `resample_dt` (maximum time between two points [s], 0.02 by default).
    """

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans and times the path, with smaller blends or stops if the validation fails."""
        path = plan_next(problem)
        return path if path.trajectory is not None else time_path(problem, path)


def time_path(problem: PlanningProblem, path: PlannedPath) -> PlannedPath:
    """Returns the path with a trajectory; raises PlanningError for an invalid limit or parameter."""
    with problem.phases.measure(TIMING):
        return _parameterized_path(problem, path)


def _parameterized_path(problem: PlanningProblem, path: PlannedPath) -> PlannedPath:
    vertices = np.ascontiguousarray(path.vertices, dtype=float)
    differ = np.abs(np.diff(vertices, axis=0)).max(axis=1) >= VERTEX_TOLERANCE
    vertices = vertices[np.append(differ, True)]  # keeps the last of equal vertices, so that the goal is exact
    period = _number(problem.settings.parameters, "resample_dt", MAX_PERIOD_S, MIN_PERIOD_S)
    tolerance = _number(problem.settings.parameters, "path_tolerance", problem.settings.blend_deviation, 0.0)

    def blended_path(blends: Array, divisor: float = 1.0) -> PlannedPath:
        return replace(
            path,
            trajectory=parameterize(
                problem.group.joints,
                vertices,
                blends,
                problem.max_velocity,
                problem.max_acceleration / divisor,
                max_period_s=period,
            ),
        )

    largest = max_blends(vertices, float(tolerance))
    tries_largest = (
        problem.constraints is None and path.path_prefix == 0
    )  # otherwise the validation would not cover all blends
    if tries_largest:  # most often, all blends are collision-free at their maximum size
        rounded = blended_path(largest)
        if not largest.any() or problem.solution_validator.is_valid(problem, rounded):
            return rounded
    blends = free_blends(vertices, largest, lambda curve: _blend_is_valid(problem, curve))
    if blends.any() and not (tries_largest and np.array_equal(blends, largest)):
        for divisor in (1.0,) if problem.constraints is None else ACCELERATION_DIVISORS:
            rounded = blended_path(blends, divisor)
            if problem.solution_validator.is_valid(problem, rounded):
                return rounded
    return blended_path(np.zeros_like(blends))


def _blend_is_valid(problem: PlanningProblem, curve: Array) -> bool:
    """Checks that a blend is free and satisfies the path constraints."""
    if not problem.satisfies_constraints(curve, problem.settings.motion_step):
        return False
    return problem.motion.polyline_is_free(curve, problem.settings.finest_step)


def _number(parameters: Any, name: str, default: float, minimum: float) -> float:
    value = parameters.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not minimum <= value < np.inf:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"parameter {name} of the pipeline is {value!r}; it must be a number of at least {minimum}",
        )
    return float(value)
