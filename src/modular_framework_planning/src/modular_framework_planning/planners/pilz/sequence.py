# SPDX-License-Identifier: BSD-3-Clause
"""Joins the motions of a sequence: each starts at the end of the one before, and is blended with it on request.

The motions of one group that follow each other become one trajectory; a change of group begins another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from modular_framework_planning.contacts import describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.planners.pilz.blending import appended, blend
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planning_request import PlanningAnswer, PlanningRequest
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import JointGroup
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

SMALLEST_GAP_M = 1.0e-6  # between two spheres
CheckerSource = Callable[[PlanningScene, JointGroup, Array], CollisionChecker]


@dataclass(frozen=True, slots=True)
class ItemSpec:
    """One item of a sequence, as the rules of sequences see it.

    Attributes:
        group: planning group.
        blend_radius: how close to the motion's end the next one may begin [m]; 0 stops there.
        has_start_state: whether the item names a start.
    """

    group: str
    blend_radius: float
    has_start_state: bool


@dataclass(frozen=True, slots=True, eq=False)
class PlannedItem:
    """One planned motion of a sequence."""

    request: PlanningRequest
    answer: PlanningAnswer
    blend_radius: float


@dataclass(frozen=True, slots=True, eq=False)
class SequencePart:
    """Motions of one group in one trajectory.

    Attributes:
        scene: the world, with the robot at the start of the part.
        answers: of the motions it was made of.
    """

    scene: PlanningScene
    group: JointGroup
    trajectory: Trajectory
    answers: tuple[PlanningAnswer, ...]


def checked_radii(items: Sequence[ItemSpec]) -> tuple[list[float], list[str]]:
    """Checks the rules that need no planning.

    Returns:
        The radii to use, and warnings about those that had to become 0, because the next motion is another group's.

    Raises:
        PlanningError: a radius is below 0 or not finite, the last one is not 0, or an item that is not the first of
            its group has a start state.
    """
    faults = [
        f"items[{number}].blend_radius is {item.blend_radius}; it must be 0 or more"
        for number, item in enumerate(items)
        if not 0.0 <= item.blend_radius < math.inf
    ]
    if items and items[-1].blend_radius != 0.0:
        faults.append(f"items[{len(items) - 1}].blend_radius is {items[-1].blend_radius}; the last one must be 0")
    if faults:
        raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, "; ".join(faults))
    seen: set[str] = set()
    for number, item in enumerate(items):
        if item.has_start_state and item.group in seen:
            raise PlanningError(
                ErrorCode.INVALID_ROBOT_STATE,
                f"items[{number}].start_state: only the first item of "
                f"group '{item.group}' may have one; leave it empty, the motion starts where the one "
                "before it ends",
            )
        seen.add(item.group)
    radii, warnings = [item.blend_radius for item in items], []
    for number, (item, following) in enumerate(zip(items[:-1], items[1:], strict=True)):
        if item.blend_radius > 0.0 and item.group != following.group:
            radii[number] = 0.0
            warnings.append(
                f"items[{number}].blend_radius {item.blend_radius} is taken as 0: the next motion is that "
                f"of group '{following.group}' and not of '{item.group}'"
            )
    return radii, warnings


class SequenceJoiner:
    """Makes trajectories of planned motions."""

    def __init__(self, kinematics: KinematicsPool, checkers: CheckerSource, period_s: float, step: float) -> None:
        """Stores the parts.

        Args:
            kinematics: inverse kinematics of the groups.
            checkers: gives the collision world of a motion from its scene, group and start.
            period_s: between two points of a blended piece.
            step: between two checked states of a blended piece [rad or m].
        """
        self._kinematics, self._checkers = kinematics, checkers
        self._period_s, self._step = period_s, step

    def join(self, items: Sequence[PlannedItem]) -> tuple[SequencePart, ...]:
        """Joins all motions.

        Raises:
            PlanningError: spheres overlap, or two motions cannot be blended; names the item.
        """
        self._require_apart(items)
        parts: list[SequencePart] = []
        for number, item in enumerate(items):
            group = item.request.scene.model.group(item.request.group)
            if not parts or parts[-1].group.name != group.name:
                parts.append(SequencePart(item.request.scene, group, item.answer.trajectory, (item.answer,)))
                continue
            before = parts[-1]
            radius = items[number - 1].blend_radius
            try:
                trajectory = (
                    self._blended(before, items[number - 1], item, radius)
                    if radius > 0.0
                    else appended(before.trajectory, item.answer.trajectory)
                )
            except PlanningError as error:
                raise PlanningError(error.code, f"items[{number - 1}] and items[{number}]: {error.reason}") from error
            parts[-1] = SequencePart(before.scene, group, trajectory, (*before.answers, item.answer))
        return tuple(parts)

    def _follower(self, item: PlannedItem) -> PoseFollower:
        solver = self._kinematics.solver(item.request.group)
        return PoseFollower(solver, solver.group.tip_link, item.answer.start)

    def _require_apart(self, items: Sequence[PlannedItem]) -> None:
        """Raises PlanningError where the spheres of two neighbouring ends overlap."""
        for number, (item, following) in enumerate(zip(items[:-1], items[1:], strict=True)):
            radii = item.blend_radius + following.blend_radius
            if item.request.group != following.request.group or radii == 0.0:
                continue
            follower = self._follower(item)
            indices = follower.group.indices
            ends = [follower.pose(part.answer.goal[indices]).translation for part in (item, following)]
            distance = float(np.linalg.norm(ends[1] - ends[0]))
            if radii > distance - SMALLEST_GAP_M:
                raise PlanningError(
                    ErrorCode.INVALID_MOTION_PLAN,
                    f"items[{number}] and items[{number + 1}]: the "
                    f"blend radii {item.blend_radius} and {following.blend_radius} m overlap: their "
                    f"sum must be below the distance {distance:.4f} m of the two ends",
                )

    def _blended(self, before: SequencePart, item: PlannedItem, following: PlannedItem, radius: float) -> Trajectory:
        trajectory, inside = blend(
            before.trajectory, following.answer.trajectory, radius, self._follower(item), self._period_s
        )
        group, start = before.group, following.answer.start
        checker = self._checkers(following.request.scene, group, start)
        motion = MotionChecker(checker, group.indices, start)
        curve = inside.curve(self._step)
        hit = motion.colliding_state(curve, self._step)
        if hit is not None:
            contacts = describe_contacts(checker.contacts(motion.full_positions(hit), include_fixed=False))
            raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"blended within {radius} m: {contacts}")
        for constraints in (item.request.path_constraints, following.request.path_constraints):
            for values in curve if constraints is not None else ():
                if constraints is not None and not constraints.satisfied(motion.full_positions(values)):
                    raise PlanningError(
                        ErrorCode.INVALID_MOTION_PLAN,
                        f"blended within {radius} m: a path constraint "
                        f"is violated: {constraints.describe(motion.full_positions(values))}",
                    )
        return trajectory
