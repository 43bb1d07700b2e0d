# SPDX-License-Identifier: BSD-3-Clause
"""Innermost step of a pipeline: path search from a valid start, path repair and shortening."""

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
from modular_framework_planning.planning_interface.problem_shortening import shorten_path
from modular_framework_planning.trajectory_processing.path_shortening import path_length, shortcut_pieces
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

MAX_SHORTENING_S = 1.0
SHORTENING_FRACTION = 0.3  # fraction of the remaining time for shortening after an anytime planner
BOUNDS_TOLERANCE = 1.0e-6  # [rad or m]


class PathSearch:
    """Checks the start, plans once, repairs and shortens the path."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner
        self._path: PlannedPath | None = None

    def __call__(self, problem: PlanningProblem) -> PlannedPath:
        """Returns the path; later calls repair the same path instead of planning again."""
        _require_start(problem)
        if self._path is None:
            with problem.phases.measure(SEARCH):
                result = self._planner.plan(problem)
            now = time.monotonic()
            self._path = (
                PlannedPath(result.positions, result, found_s=now, keep_shape=True)
                if isinstance(result, Trajectory)
                else replace(result, found_s=now)
            )
        path = self._path
        if path.keep_shape or path.trajectory is not None:
            return path
        simplify, vertices = problem.settings.sampling.simplify_solutions, path.vertices
        if simplify:  # leaves fewer edges to repair
            vertices = _shorten(problem, vertices, _without_vertices)
        if self._planner.repairs_edges:
            with problem.phases.measure(REPAIR):
                vertices = self._planner.repair_path(problem, vertices)
        if simplify and problem.constraints is not None:
            vertices = _shorten(problem, vertices, _cut_along_constraints)
        if simplify:
            vertices = _shorten(problem, vertices, _shortened_path)
        self._path = replace(path, vertices=vertices)
        return self._path


def _require_start(problem: PlanningProblem) -> None:
    """Raises PlanningError unless the start is within bounds, free and satisfies the path constraints."""
    model, group = problem.model, problem.group
    faults = model.bound_violations(problem.start, group.indices, BOUNDS_TOLERANCE, problem.bounds)
    if faults:
        moves_base = model.base is not None and model.base.variables[0] in group.joints
        raise PlanningError(
            ErrorCode.START_STATE_INVALID,
            f"start state: {'; '.join(faults)}; move the robot within its bounds or use the adapter FixStartStateBounds"
            + ("; workspace_parameters bound the base" if moves_base else ""),
        )
    if not problem.motion.state_is_free(problem.start_values):
        contacts = problem.checker.contacts(problem.start, include_fixed=False)
        raise PlanningError(
            ErrorCode.START_STATE_IN_COLLISION,
            f"start state is in collision: "
            f"{describe_contacts(contacts)}; allow this collision, move one of the bodies, or use the adapter "
            "FixStartStateCollision",
            contacts,
        )
    if problem.constraints is not None and not problem.constraints.are_satisfied(problem.start):
        raise PlanningError(
            ErrorCode.START_STATE_VIOLATES_PATH_CONSTRAINTS,
            "start state: "
            f"{problem.constraints.describe(problem.start)}; start from a state that satisfies the "
            "path constraints, or use the adapter FixStartStatePathConstraints",
        )


def _shorten(problem: PlanningProblem, path: Array, method: Callable[[PlanningProblem, Array, float], Array]) -> Array:
    """Shortens a path within the available time, with checks at the step of the final validation."""
    now = time.monotonic()
    limit = min(max(problem.deadline_s, now + SHORTENING_FRACTION * (problem.end_s - now)), now + MAX_SHORTENING_S)
    with problem.phases.measure(SHORTENING):
        return method(problem, path, math.inf if problem.repeatable else limit)


def _shortened_path(problem: PlanningProblem, path: Array, deadline: float) -> Array:
    return shorten_path(problem, path, deadline, problem.rng)


def _without_vertices(problem: PlanningProblem, path: Array, deadline: float) -> Array:
    return shorten_path(problem, path, deadline, None)


def _cut_along_constraints(problem: PlanningProblem, path: Array, deadline: float) -> Array:
    step, connect = problem.settings.finest_step, problem.constrained_motion(problem.step).connect

    def join(start: Array, end: Array, max_length: float) -> Array | None:
        piece = connect(start, end)
        if piece is None or path_length(piece) > max_length or not problem.satisfies_constraints(piece, step):
            return None
        is_free = all(problem.motion.edge_is_free(first, second, step) for first, second in pairwise(piece))
        return piece if is_free else None

    return shortcut_pieces(path, join, deadline, problem.rng)
