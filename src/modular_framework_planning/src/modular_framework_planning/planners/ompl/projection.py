# SPDX-License-Identifier: BSD-3-Clause
"""Projections of the joint space to few dimensions, which OMPL's cell planners measure coverage in."""

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
    """Projects a state to a link's position; `release` drops the reference to the robot model."""

    def __init__(self, space: Any, position: Callable[[Array], Array], count: int) -> None:
        super().__init__(space)
        self._position: Callable[[Array], Array] | None = position
        self._count = count

    def getDimension(self) -> int:  # noqa: N802 - OMPL calls it by this name
        """Number of dimensions."""
        return 3

    def project(self, state: Any, projection: Any) -> None:
        """Writes the position [m] of the link at a state."""
        if self._position is not None:
            projection[:] = self._position(np.array(state[0 : self._count]))

    def release(self) -> None:
        """Drops the reference to the robot model."""
        self._position = None


def projection_evaluator(text: str, problem: PlanningProblem, space: Any) -> Any:
    """Makes the projection that the parameter `projection_evaluator` describes.

    Args:
        text: "joints(a,b,...)" or "link(name)".
        problem: gives the group's joints and the robot.
        space: OMPL's state space of the group.

    Raises:
        PlanningError: the text is another, or a name does not exist.
    """
    match = re.fullmatch(r"\s*(joints|link)\s*\(([^()]*)\)\s*", text)
    names = [name.strip() for name in match[2].split(",") if name.strip()] if match else []
    joints = problem.group.joints
    if not match or not names or (match[1] == "link" and len(names) != 1):
        raise PlanningError(
            ErrorCode.PLANNING_FAILED,
            f"projection_evaluator '{text}' of group "
            f"'{problem.group.name}': allowed are joints(a,b,...) and link(name)",
        )
    if match[1] == "joints":
        unknown = [name for name in names if name not in joints]
        if unknown:
            raise PlanningError(
                ErrorCode.PLANNING_FAILED,
                f"projection_evaluator '{text}': {', '.join(unknown)} is "
                f"not in group '{problem.group.name}'; its joints are {', '.join(joints)}",
            )
        return ob.RealVectorOrthogonalProjectionEvaluator(space, [joints.index(name) for name in names])
    if not problem.model.has_link(names[0]):
        raise PlanningError(
            ErrorCode.INVALID_LINK_NAME,
            f"projection_evaluator '{text}': the robot has no such link; known: {', '.join(problem.model.frame_ids)}",
        )

    def position(values: Array) -> Array:
        return problem.model.link_transforms(problem.motion.full_positions(values))[names[0]].translation

    return _LinkPosition(space, position, len(joints))
