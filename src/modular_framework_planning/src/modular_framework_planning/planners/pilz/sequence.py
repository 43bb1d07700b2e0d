# SPDX-License-Identifier: BSD-3-Clause
"""Motion sequences: joins consecutive motions, with blending between motions that have a blend radius.

Consecutive motions of one group become one trajectory; a change of group starts a new trajectory.
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
from modular_framework_planning.planners.pilz.blending import append_trajectory, blend
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planning_request import PlanningRequest, PlanningResult
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import JointGroup
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

MIN_GAP_M = 1.0e-6  # minimum gap between two blend spheres
CheckerSource = Callable[[PlanningScene, JointGroup, Array], CollisionChecker]


@dataclass(frozen=True, slots=True)
class ItemSpec:
    """Properties of a sequence item that can be checked before planning.

    Attributes:
        group: Planning group.
        blend_radius: Radius of the blend into the next motion [m]; 0 for a stop.
        has_start_state: Whether the item has a start state.
    """

    group: str
    blend_radius: float
    has_start_state: bool


@dataclass(frozen=True, slots=True, eq=False)
class PlannedItem:
    """A planned motion of a sequence."""

    request: PlanningRequest
    answer: PlanningResult
    blend_radius: float


@dataclass(frozen=True, slots=True, eq=False)
class SequencePart:
    """Consecutive motions of one group, joined to one trajectory.

    Attributes:
        scene: Planning scene with the robot at the start of the part.
        group: Joints of the planning group.
        trajectory: Joined trajectory.
        answers: Planning results of the joined motions.
    """

    scene: PlanningScene
    group: JointGroup
    trajectory: Trajectory
    answers: tuple[PlanningResult, ...]


def checked_radii(items: Sequence[ItemSpec]) -> tuple[list[float], list[str]]:
    """Checks the items of a sequence before planning.

    Returns:
        The blend radii to use, and warnings about radii set to 0 because the planning group changes.

    Raises:
        PlanningError: A radius is negative or not finite, the last radius is not 0, or an item other than the first
            of its group has a start state.
    """
    faults = [
        f"items[{index}].blend_radius is {item.blend_radius}; it must be 0 or more"
        for index, item in enumerate(items)
        if not 0.0 <= item.blend_radius < math.inf
    ]
    if items and items[-1].blend_radius != 0.0:
        faults.append(f"items[{len(items) - 1}].blend_radius is {items[-1].blend_radius}; the last radius must be 0")
    if faults:
        raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, "; ".join(faults))
    seen: set[str] = set()
    for index, item in enumerate(items):
        if item.has_start_state and item.group in seen:
            raise PlanningError(
                ErrorCode.INVALID_ROBOT_STATE,
                f"items[{index}].start_state: only the first item of "
                f"group '{item.group}' may have a start state; leave it empty, because the motion starts where the "
                "previous motion ends",
            )
        seen.add(item.group)
    radii, warnings = [item.blend_radius for item in items], []
    for index, (item, next_item) in enumerate(zip(items[:-1], items[1:], strict=True)):
        if item.blend_radius > 0.0 and item.group != next_item.group:
            radii[index] = 0.0
            warnings.append(
                f"items[{index}].blend_radius {item.blend_radius} is taken as 0: the next motion moves "
                f"group '{next_item.group}' and not '{item.group}'"
            )
    return radii, warnings


class SequenceJoiner:
    """Joins planned motions to trajectories."""

    def __init__(self, kinematics: KinematicsPool, checkers: CheckerSource, period_s: float, step: float) -> None:
        """Stores the arguments.

        Args:
            kinematics: Kinematics solvers of the groups.
            checkers: Creates the collision checker for a scene, a group and a start.
            period_s: Sampling period of a blend [s].
            step: Distance between collision checks of a blend [rad or m].
        """
        self._kinematics, self._checkers = kinematics, checkers
        self._period_s, self._step = period_s, step

    def join(self, items: Sequence[PlannedItem]) -> tuple[SequencePart, ...]:
        """Returns the joined motions.

        Raises:
            PlanningError: Blend spheres overlap, or two motions cannot be blended; names the items.
        """
        self._require_disjoint_blends(items)
        parts: list[SequencePart] = []
        for index, item in enumerate(items):
            group = item.request.scene.model.group(item.request.group)
            if not parts or parts[-1].group.name != group.name:
                parts.append(SequencePart(item.request.scene, group, item.answer.trajectory, (item.answer,)))
                continue
            previous = parts[-1]
            radius = items[index - 1].blend_radius
            try:
                trajectory = (
                    self._blended_trajectory(previous, items[index - 1], item, radius)
                    if radius > 0.0
                    else append_trajectory(previous.trajectory, item.answer.trajectory)
                )
            except PlanningError as error:
                raise PlanningError(error.code, f"items[{index - 1}] and items[{index}]: {error.reason}") from error
            parts[-1] = SequencePart(previous.scene, group, trajectory, (*previous.answers, item.answer))
        return tuple(parts)

    def _follower(self, item: PlannedItem) -> PoseFollower:
        solver = self._kinematics.solver(item.request.group)
        return PoseFollower(solver, solver.group.tip_link, item.answer.start)

    def _require_disjoint_blends(self, items: Sequence[PlannedItem]) -> None:
        """Raises PlanningError if consecutive blend spheres overlap."""
        for index, (item, next_item) in enumerate(zip(items[:-1], items[1:], strict=True)):
            radii = item.blend_radius + next_item.blend_radius
            if item.request.group != next_item.request.group or radii == 0.0:
                continue
            follower = self._follower(item)
            indices = follower.group.indices
            ends = [follower.pose(part.answer.goal[indices]).translation for part in (item, next_item)]
            distance = float(np.linalg.norm(ends[1] - ends[0]))
            if radii > distance - MIN_GAP_M:
                raise PlanningError(
                    ErrorCode.INVALID_MOTION_PLAN,
                    f"items[{index}] and items[{index + 1}]: the blends with radii "
                    f"{item.blend_radius} and {next_item.blend_radius} m overlap: the sum of the "
                    f"radii must be below the distance {distance:.4f} m between the ends of the motions",
                )

    def _blended_trajectory(
        self, previous: SequencePart, item: PlannedItem, next_item: PlannedItem, radius: float
    ) -> Trajectory:
        trajectory, blended = blend(
            previous.trajectory, next_item.answer.trajectory, radius, self._follower(item), self._period_s
        )
        group, start = previous.group, next_item.answer.start
        checker = self._checkers(next_item.request.scene, group, start)
        motion = MotionChecker(checker, group.indices, start)
        curve = blended.curve(self._step)
        colliding_values = motion.colliding_state(curve, self._step)
        if colliding_values is not None:
            contacts = describe_contacts(checker.contacts(motion.full_positions(colliding_values), include_fixed=False))
            raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"blend with radius {radius} m: {contacts}")
        for constraints in (item.request.path_constraints, next_item.request.path_constraints):
            for values in curve if constraints is not None else ():
                if constraints is not None and not constraints.are_satisfied(motion.full_positions(values)):
                    raise PlanningError(
                        ErrorCode.INVALID_MOTION_PLAN,
                        f"blend with radius {radius} m: a path constraint "
                        f"is violated: {constraints.describe(motion.full_positions(values))}",
                    )
        return trajectory
