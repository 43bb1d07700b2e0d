# SPDX-License-Identifier: BSD-3-Clause
"""Low-dimensional projections of the joint space, in which OMPL's cell-based planners measure coverage."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import ompl.base as ob

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem


class _LinkPosition(ob.ProjectionEvaluator):
    """Projects a state to the position of a link."""

    def __init__(self, space: Any, position: Callable[[Array], Array], count: int) -> None:
        super().__init__(space)
        self._position: Callable[[Array], Array] | None = position
        self._count = count

    def getDimension(self) -> int:  # noqa: N802 - OMPL calls it by this name
        """Number of dimensions."""
        return 3

    def project(self, state: Any, projection: Any) -> None:
        """Writes the link position at a state [m]."""
        if self._position is not None:
            projection[:] = self._position(np.array(state[0 : self._count]))

    def release(self) -> None:
        """Drops the reference to the robot model."""
        self._position = None


def projection_evaluator(text: str, problem: PlanningProblem, space: Any) -> Any:
    """Returns the projection described by the parameter `projection_evaluator`.

    Args:
        text: Parameter value: "joints(a,b,...)" or "link(name)".
        problem: Problem with the joint group and the robot model.
        space: OMPL's state space of the group.

    Raises:
        PlanningError: The text has a different form, or a name does not exist.
    """
    match = re.fullmatch(r"\s*(joints|link)\s*\(([^()]*)\)\s*", text)
    names = [name.strip() for name in match[2].split(",") if name.strip()] if match else []
    joints = problem.group.joints
    if not match or not names or (match[1] == "link" and len(names) != 1):
        raise PlanningError(
            ErrorCode.PLANNING_FAILED,
            f"projection_evaluator '{text}' of group '{problem.group.name}' must be joints(a,b,...) or link(name)",
        )
    if match[1] == "joints":
        unknown = [name for name in names if name not in joints]
        if unknown:
            raise PlanningError(
                ErrorCode.PLANNING_FAILED,
                f"projection_evaluator '{text}' names {', '.join(unknown)}, but group '{problem.group.name}' "
                f"has only the joints {', '.join(joints)}",
            )
        return ob.RealVectorOrthogonalProjectionEvaluator(space, [joints.index(name) for name in names])
    if not problem.model.has_link(names[0]):
        raise PlanningError(
            ErrorCode.INVALID_LINK_NAME,
            f"projection_evaluator '{text}': the robot has no such link; allowed: {', '.join(problem.model.frame_ids)}",
        )

    def position(values: Array) -> Array:
        return problem.model.link_transforms(problem.motion.full_positions(values))[names[0]].translation

    return _LinkPosition(space, position, len(joints))
