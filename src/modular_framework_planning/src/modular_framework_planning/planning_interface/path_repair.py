# SPDX-License-Identifier: BSD-3-Clause
"""Repairs a path whose edges a search checked too coarsely: each colliding edge is replaced by a detour."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.contacts import describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem

Connect = Callable[[PlanningProblem, Array, Array], Array | None]


class EdgeError(PlanningError):
    """An edge of a path is not valid and no detour was found."""


def repaired(problem: PlanningProblem, path: Array, connect: Connect) -> Array:
    """Returns the path with every edge valid at the steps of the solution validator.

    Args:
        problem: what the path was searched for.
        path: vertices from start to goal, each of them valid, shape (n, joints).
        connect: gives a valid path between two valid states, or None.

    Raises:
        EdgeError: an edge has no detour; says what touches, and where.
    """
    step = problem.settings.finest_step
    pieces = [path[:1]]
    for number, (first, second) in enumerate(zip(path[:-1], path[1:], strict=True), start=1):
        if problem.edge_is_valid(first, second, step):
            pieces.append(second[None])
            continue
        detour = None if problem.cancelled() else connect(problem, first, second)
        if detour is None:
            raise EdgeError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"edge {number} of {len(path) - 1} of the path found "
                f"{edge_fault(problem, first, second)}, and no way round it was found",
            )
        pieces.append(detour[1:])
    return np.vstack(pieces)


def edge_fault(problem: PlanningProblem, first: Array, second: Array) -> str:
    """Says what is wrong with the straight motion between two states, and in which state."""
    step = problem.settings.finest_step
    hit = problem.motion.colliding_state(np.vstack([first, second]), step)
    if hit is not None:
        contacts = problem.checker.contacts(problem.motion.full_positions(hit), include_fixed=False)
        return f"collides: {describe_contacts(contacts)}, at {describe_state(problem, hit)}"
    return f"leaves the path constraints between {describe_state(problem, first)} and {describe_state(problem, second)}"


def describe_state(problem: PlanningProblem, values: Array) -> str:
    """Returns the joints of a state by their names."""
    return ", ".join(f"{name} {value:.4f}" for name, value in zip(problem.group.joints, values, strict=True))
