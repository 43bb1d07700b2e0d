# SPDX-License-Identifier: BSD-3-Clause
"""Path repair: replaces each edge that a finer check finds invalid by a detour."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.contacts import describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem

Connect = Callable[[PlanningProblem, Array, Array], Array | None]


class EdgeError(PlanningError):
    """Raised if an edge of a path is invalid and has no detour."""


def repair_path(problem: PlanningProblem, path: Array, connect: Connect) -> Array:
    """Returns the path with all edges valid at the step of the final validation.

    Args:
        problem: Planning problem of the path.
        path: Valid vertices from start to goal, shape (n, joints).
        connect: Returns a valid path between two valid states, or None.

    Raises:
        EdgeError: An edge has no detour; describes the contact and its state.
    """
    step = problem.settings.finest_step
    pieces = [path[:1]]
    for index, (first, second) in enumerate(zip(path[:-1], path[1:], strict=True), start=1):
        if problem.edge_is_valid(first, second, step):
            pieces.append(second[None])
            continue
        detour = None if problem.cancelled() else connect(problem, first, second)
        if detour is None:
            raise EdgeError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"edge {index} of {len(path) - 1} of the path found "
                f"{edge_fault(problem, first, second)}, and no detour was found",
            )
        pieces.append(detour[1:])
    return np.vstack(pieces)


def edge_fault(problem: PlanningProblem, first: Array, second: Array) -> str:
    """Describes why an edge is invalid, and in which state.

    Args:
        problem: Planning problem.
        first: Joint vector at the start of the edge.
        second: Joint vector at the end of the edge.
    """
    step = problem.settings.finest_step
    colliding_values = problem.motion.colliding_state(np.vstack([first, second]), step)
    if colliding_values is not None:
        contacts = problem.checker.contacts(problem.motion.full_positions(colliding_values), include_fixed=False)
        return f"collides: {describe_contacts(contacts)}, at {describe_state(problem, colliding_values)}"
    return f"leaves the path constraints between {describe_state(problem, first)} and {describe_state(problem, second)}"


def describe_state(problem: PlanningProblem, values: Array) -> str:
    """Returns the joint names and values of a state."""
    return ", ".join(f"{name} {value:.4f}" for name, value in zip(problem.group.joints, values, strict=True))
