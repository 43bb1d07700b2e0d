# SPDX-License-Identifier: BSD-3-Clause
"""Gives a path its fastest timing within the limits, with rounded corners where they are free."""

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
from modular_framework_planning.trajectory_processing.compiled_timing import largest_blends
from modular_framework_planning.trajectory_processing.time_parameterization import (
    LONGEST_PERIOD_S,
    SHORTEST_PERIOD_S,
    parameterize,
)

# Of accelerations, one after the other under path constraints: in rounded corners a motion leaves the path by
# acceleration times window squared by 24 (see parameterize), 3e-4 rad at 5 rad/s^2: more than tight tolerances allow.
SLOWNESS = (1.0, 4.0, 16.0)
SAME_POSITION = 1.0e-9  # [rad or m]; neighbouring vertices nearer to each other than this are one


class AddTimeOptimalParameterization(RequestAdapter):
    """Times what is not timed yet.

    Parameters of the pipeline: `path_tolerance` (most distance of a rounded corner from the corner [rad or m], the
    pipeline's blend_deviation by default), `resample_dt` (longest time between two points [s], 0.02 by default).
    """

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans, then times the path, with smaller corners or a stop at each where that fails the last check."""
        path = plan_next(problem)
        return path if path.trajectory is not None else time_path(problem, path)


def time_path(problem: PlanningProblem, path: PlannedPath) -> PlannedPath:
    """Returns the path with a trajectory; raises PlanningError where a limit or a parameter is not usable."""
    with problem.phases.measured(TIMING):
        return _timed(problem, path)


def _timed(problem: PlanningProblem, path: PlannedPath) -> PlannedPath:
    vertices = np.ascontiguousarray(path.vertices, dtype=float)
    differ = np.abs(np.diff(vertices, axis=0)).max(axis=1) >= SAME_POSITION
    vertices = vertices[np.append(differ, True)]  # the last of equal ones: a goal is met exactly
    period = _number(problem.settings.parameters, "resample_dt", LONGEST_PERIOD_S, SHORTEST_PERIOD_S)
    tolerance = _number(problem.settings.parameters, "path_tolerance", problem.settings.blend_deviation, 0.0)

    def timed(blends: Array, slowness: float = 1.0) -> PlannedPath:
        return replace(
            path,
            trajectory=parameterize(
                problem.group.joints,
                vertices,
                blends,
                problem.max_velocity,
                problem.max_acceleration / slowness,
                period,
            ),
        )

    largest = largest_blends(vertices, float(tolerance))
    is_tried = problem.constraints is None and path.path_prefix == 0  # else the last check does not see all corners
    if is_tried:  # most often all corners are free at their full size
        rounded = timed(largest)
        if not largest.any() or problem.solution_validator.is_valid(problem, rounded):
            return rounded
    blends = free_blends(vertices, largest, lambda curve: _corner_is_valid(problem, curve))
    if blends.any() and not (is_tried and np.array_equal(blends, largest)):
        for slowness in (1.0,) if problem.constraints is None else SLOWNESS:
            rounded = timed(blends, slowness)
            if problem.solution_validator.is_valid(problem, rounded):
                return rounded
    return timed(np.zeros_like(blends))


def _corner_is_valid(problem: PlanningProblem, curve: Array) -> bool:
    """Whether a rounded corner is free and keeps the path constraints."""
    if not problem.satisfies_constraints(curve, problem.settings.motion_step):
        return False
    return problem.motion.polyline_is_free(curve, problem.settings.finest_step)


def _number(parameters: Any, name: str, default: float, lowest: float) -> float:
    value = parameters.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not lowest <= value < np.inf:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"parameter {name} of the pipeline is {value!r}; allowed is a number of at least {lowest}",
        )
    return float(value)
