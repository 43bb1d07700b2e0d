# SPDX-License-Identifier: BSD-3-Clause
"""The innermost step of a pipeline: the planner's path from a valid start, repaired and shortened."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

from modular_framework_planning.contacts import describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.phase_times import REPAIR, SEARCH, SHORTENING
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, Planner, PlanningProblem
from modular_framework_planning.planning_interface.problem_shortening import shortened
from modular_framework_planning.trajectory_processing.constrained_shortening import cut_along
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

MAX_SHORTENING_S = 1.0
SHORTENING_SHARE = 0.3  # of the time left where a planner used all of its own
BOUNDS_TOLERANCE = 1.0e-6  # [rad or m]


class PathSearch:
    """Checks the start, runs the planner once, lets it repair its path, shortens that."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner
        self._found: PlannedPath | None = None
        self.repairs = hasattr(planner, "repaired")

    def __call__(self, problem: PlanningProblem) -> PlannedPath:
        """Returns the path; that of the first call, repaired once more, where it is called again."""
        _require_start(problem)
        if self._found is None:
            with problem.phases.measured(SEARCH):
                found = self._planner.plan(problem)
            now = time.monotonic()
            self._found = (
                PlannedPath(found.positions, found, found_s=now, keep_shape=True)
                if isinstance(found, Trajectory)
                else replace(found, found_s=now)
            )
        path = self._found
        if path.keep_shape or path.trajectory is not None:
            return path
        simplify, vertices = problem.settings.sampling.simplify_solutions, path.vertices
        if simplify:  # first, so that fewer edges have to be repaired
            vertices = _shortened(problem, vertices, _without_vertices)
        if self.repairs:
            with problem.phases.measured(REPAIR):
                vertices = self._planner.repaired(problem, vertices)  # type: ignore[attr-defined]
        if simplify and problem.constraints is not None:
            vertices = _shortened(problem, vertices, _cut_along_constraints)
        if simplify:
            vertices = _shortened(problem, vertices, _short)
        self._found = replace(path, vertices=vertices)
        return self._found


def _require_start(problem: PlanningProblem) -> None:
    """Raises PlanningError unless the start is within bounds, free, and keeps the path constraints."""
    model, group = problem.model, problem.group
    faults = model.bound_violations(problem.start, group.indices, BOUNDS_TOLERANCE, problem.bounds)
    if faults:
        moves_base = model.base is not None and model.base.variables[0] in group.joints
        raise PlanningError(
            ErrorCode.START_STATE_INVALID,
            f"start state: {'; '.join(faults)}; move the robot within its bounds or use the adapter FixStartStateBounds"
            + ("; the base's are those of workspace_parameters" if moves_base else ""),
        )
    if not problem.motion.state_is_free(problem.start_values):
        contacts = problem.checker.contacts(problem.start, include_fixed=False)
        raise PlanningError(
            ErrorCode.START_STATE_IN_COLLISION,
            f"start state in collision: "
            f"{describe_contacts(contacts)}; allow the pair, move it, or use the adapter "
            "FixStartStateCollision",
            contacts,
        )
    if problem.constraints is not None and not problem.constraints.satisfied(problem.start):
        raise PlanningError(
            ErrorCode.START_STATE_VIOLATES_PATH_CONSTRAINTS,
            "start state: "
            f"{problem.constraints.describe(problem.start)}; start from a state that satisfies the "
            "path constraints or use the adapter FixStartStatePathConstraints",
        )


def _shortened(
    problem: PlanningProblem, path: Array, shorten_path: Callable[[PlanningProblem, Array, float], Array]
) -> Array:
    """Shortens a path; what it accepts was checked as finely as the solution validator does."""
    now = time.monotonic()
    limit = min(max(problem.deadline_s, now + SHORTENING_SHARE * (problem.end_s - now)), now + MAX_SHORTENING_S)
    with problem.phases.measured(SHORTENING):
        return shorten_path(problem, path, math.inf if problem.repeatable else limit)


def _short(problem: PlanningProblem, path: Array, deadline: float) -> Array:
    return shortened(problem, path, deadline, problem.rng)


def _without_vertices(problem: PlanningProblem, path: Array, deadline: float) -> Array:
    return shortened(problem, path, deadline, None)


def _cut_along_constraints(problem: PlanningProblem, path: Array, deadline: float) -> Array:
    fine = problem.settings.finest_step

    def is_valid(polyline: Array) -> bool:
        return problem.satisfies_constraints(polyline, fine) and all(
            problem.motion.edge_is_free(first, second, fine) for first, second in pairwise(polyline)
        )

    return cut_along(path, problem.constrained_motion(problem.step).way, is_valid, deadline, problem.rng)
