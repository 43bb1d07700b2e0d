# SPDX-License-Identifier: BSD-3-Clause
"""Converts displacements of an end effector to joint positions, with the kinematics of the planner."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from mbf_method.errors import InvalidOutputError
from modular_framework_core.commander.robot_groups import RobotModelError
from modular_framework_planning.errors import ModelError, PlanningError
from modular_framework_planning.geometry.spatial import Transform
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics, KinematicsPool
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.move_group.robot_parameters import load_kinematics_settings, load_robot_model
from modular_framework_ros.allowed_names import listing, nearest

Array = npt.NDArray[np.float64]

MAX_STEP_M, MAX_STEP_RAD = 0.02, 0.05
"""Steps of a displacement between solutions of the inverse kinematics."""
START_TIMEOUT_S = 10.0


def load_solver(group: str) -> InverseKinematics:
    """Returns the kinematics solver of a planning group, from the parameters of the robot.

    Raises:
        RobotModelError: The robot description is invalid, or the group is not a chain.
    """
    try:
        return KinematicsPool(load_robot_model(START_TIMEOUT_S), load_kinematics_settings()).solver(group)
    except (ModelError, PlanningError) as error:
        raise RobotModelError(f"end_effector_deltas: {error}") from error


class EndEffector:
    """Moves the tip link of a chain by displacements, from the joint positions before each displacement.

    Args:
        solver: Kinematics solver of the chain.
        joints: Joints in the order of the joint vectors.
        frame: Planning frame or a link, whose axes the displacements use; "" for the planning frame.
        positions_of: Function that returns the current positions of joints [rad or m], by name.

    Raises:
        RobotModelError: The chain has other joints, or the frame is unknown.
    """

    def __init__(
        self,
        solver: InverseKinematics,
        joints: Sequence[str],
        frame: str,
        positions_of: Callable[[Iterable[str]], Mapping[str, float]],
    ) -> None:
        self._model, group = solver.model, solver.group
        if set(joints) != set(group.joints):
            raise RobotModelError(
                f"end_effector_deltas: group '{group.name}' moves its tip with the joints {list(group.joints)}, and "
                f"the actions move {list(joints)}; both must be the same"
            )
        self.frame, self.link = frame or self._model.planning_frame, group.tip_link
        if self.frame != self._model.planning_frame and not self._model.has_link(self.frame):
            links = [self._model.planning_frame, *self._model.frame_ids]
            raise RobotModelError(
                f"option frame: '{frame}' is neither the planning frame nor a link; {listing(links)}"
                f"{nearest(frame, links)}"
            )
        self._order = [list(joints).index(name) for name in group.joints]
        rest = self._model.merge(self._model.default_positions(), positions_of(self._model.joint_names))
        self._follower = PoseFollower(solver, self.link, rest)

    def pose(self, positions: Array) -> Array:
        """Returns the pose of the tip link in the frame of the displacements, shape (4, 4).

        Args:
            positions: Joint positions, shape (j,) [rad or m].
        """
        values = positions[self._order]
        pose = self._follower.pose(values)
        if self.frame != self._model.planning_frame:
            pose = self._frame_pose(values).actInv(pose)
        return np.asarray(pose.homogeneous)

    def follow(self, displacements: Array, start: Array) -> Array:
        """Returns the joint positions after each displacement, shape (n, j) [rad or m].

        Args:
            displacements: Translation [m] and rotation vector [rad] of each action, shape (n, 6).
            start: Joint positions before the first action, shape (j,) [rad or m].

        Raises:
            InvalidOutputError: A singular posture, a joint limit or the reach of the arm prevents a displacement.
        """
        indices = self._follower.group.indices
        values = np.clip(start[self._order], self._model.lower[indices], self._model.upper[indices])
        positions = np.zeros((len(displacements), len(start)))
        for index, displacement in enumerate(displacements):
            angle_rad = float(np.linalg.norm(displacement[3:]))
            if angle_rad > math.pi:
                raise InvalidOutputError(
                    f"actions[{index}] has a rotation vector of length {angle_rad:.4f}; it must be at most pi rad"
                )
            try:
                values = self._displaced(values, displacement)
            except PlanningError as error:
                raise InvalidOutputError(f"actions[{index}] cannot be executed: {error}") from error
            positions[index, self._order] = values
        return positions

    def _displaced(self, values: Array, displacement: Array) -> Array:
        """Returns the joint values after a displacement, which is followed in small steps."""
        pose = self._follower.pose(values)
        axes = np.eye(3) if self.frame == self._model.planning_frame else self._frame_pose(values).rotation
        translation, rotation = axes @ displacement[:3], axes @ displacement[3:]
        sizes = np.linalg.norm(translation) / MAX_STEP_M, np.linalg.norm(rotation) / MAX_STEP_RAD
        count = max(1, math.ceil(max(sizes)))
        for number in range(1, count + 1):
            part = number / count
            turned = pin.exp3(part * rotation) @ pose.rotation
            values = self._follower.solve(values, pin.SE3(turned, pose.translation + part * translation))
        return values

    def _frame_pose(self, values: Array) -> Transform:
        return self._model.link_transforms(self._follower.full_positions(values))[self.frame]
