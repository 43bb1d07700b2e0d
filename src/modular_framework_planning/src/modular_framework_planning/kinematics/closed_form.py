# SPDX-License-Identifier: BSD-3-Clause
"""Closed-form inverse kinematics (EAIK) of six revolute joints, or of seven with one joint locked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from eaik.IK_HP import HPRobot
from numpy.typing import NDArray

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel

PROBE_ANGLE = 0.37  # generic angle at which no two axes align by chance [rad]
MAX_CACHED_SOLVERS = 4096  # one solver per value of the locked joint
ALIGNED_WRIST = 0.01  # the wrist is singular if the last three axes span a smaller volume
ON_FIRST_AXIS = 0.01  # the shoulder is singular at a smaller distance of the wrist centre, as a fraction of the length
CENTRE_ERROR = 1e-6  # maximum distance of three axes from their common point, as a fraction of the length


class ClosedForm:
    """Solves a chain that consists of the group's joints only."""

    def __init__(self, model: RobotModel, group: JointGroup, base_link: str, last_link: str) -> None:
        """Reads axes and offsets of the chain from the model with all joints at zero.

        Args:
            model: Robot model.
            group: Joints of the chain.
            base_link: Link at the start of the chain.
            last_link: Link at the end of the chain.

        Raises:
            PlanningError: The chain has no known decomposition.
        """
        kinds = {model.document.joint_kinds[name] for name in group.joints}
        if len(group.joints) not in (6, 7) or not kinds <= {"revolute", "continuous"}:
            raise PlanningError(
                ErrorCode.NO_IK_SOLUTION,
                f"group '{group.name}': {len(group.joints)} joints of kind "
                f"{', '.join(sorted(kinds))}; a closed form needs 6 or 7 revolute joints",
            )
        self._axes, self._offsets, self._rotation = _axes_and_offsets(model, group, base_link, last_link)
        self.locked_joint = self._choose_locked_joint(group.name)
        self._solvers: dict[float, Any] = {}
        first, second, third = self._axes[-3:]
        normal = np.cross(second, third)
        self._wrist_volume = float(first @ normal), float(first @ np.cross(second, normal))
        self._length = float(np.linalg.norm(self._offsets[1:], axis=1).sum())
        self._wrist_in_tip = self._wrist_centre()

    def _wrist_centre(self) -> Array | None:
        """Returns the common point of the last three axes in the tip frame; None without a spherical wrist."""
        points = np.cumsum(self._offsets, axis=0)
        axes, on_axes = self._axes[-3:], points[-4:-1]
        across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
        centre, *_ = np.linalg.lstsq(across.sum(axis=0), np.einsum("ijk,ik->j", across, on_axes), rcond=None)
        gaps = np.linalg.norm(np.einsum("ijk,ik->ij", across, centre - on_axes), axis=1)
        return centre - points[-1] if gaps.max() < CENTRE_ERROR * self._length else None

    def _choose_locked_joint(self, name: str) -> int | None:
        """Returns the last joint that can be locked to get a solvable chain; None if no joint needs to be locked."""
        choices = [None] if len(self._axes) == 6 else list(range(6, -1, -1))
        for joint in choices:
            locked_value = [] if joint is None else [(joint, PROBE_ANGLE)]
            if HPRobot(self._axes, self._offsets, locked_value).hasKnownDecomposition():
                return joint
        raise PlanningError(ErrorCode.NO_IK_SOLUTION, f"group '{name}': no closed-form solution is known")

    def solve(self, last_in_base: Transform, locked_value: float = 0.0) -> Array:
        """Returns candidate joint vectors, shape (k, joints), some of them approximate; the caller must refine them.

        Args:
            last_in_base: Pose of the last link in the frame of the base link.
            locked_value: Value of the locked joint of a seven-joint chain [rad].
        """
        target = last_in_base.homogeneous.copy()
        target[:3, :3] = last_in_base.rotation @ self._rotation
        solutions = np.asarray(self._solver(locked_value).IK(target).Q, dtype=float).reshape(-1, len(self._axes))
        return np.ascontiguousarray(solutions[np.isfinite(solutions).all(axis=1)])

    def has_singular_shoulder(self, last_in_base: Transform) -> bool:
        """Returns whether the centre of a spherical wrist is on the first axis, for a chain without a locked joint.

        The first joint is then free, and the pose has infinitely many solutions. EAIK returns one value of the joint.

        Args:
            last_in_base: Pose of the last link in the frame of the base link.
        """
        if self._wrist_in_tip is None:
            return False
        centre = last_in_base.rotation @ self._rotation @ self._wrist_in_tip + last_in_base.translation
        distance = np.linalg.norm(np.cross(self._axes[0], centre - self._offsets[0]))
        return bool(distance < ON_FIRST_AXIS * self._length)

    def has_aligned_wrist(self, candidates: Array) -> NDArray[np.bool_]:
        """Returns whether the last three axes are linearly dependent, for a chain without a locked joint.

        The pose then has infinitely many solutions. EAIK fixes the last joint, and for three parallel axes (UR) its
        candidates are wrong. The volume of the unit axes a, b and c at zero is
        cos(q) a.(b x c) + sin(q) a.(b x (b x c)), where q is the value of the joint with the axis b.

        Args:
            candidates: Joint vectors, shape (k, joints) [rad].

        Returns:
            Result per joint vector, shape (k,).
        """
        cosine_gain, sine_gain = self._wrist_volume
        angles = candidates[:, -2]
        return np.abs(cosine_gain * np.cos(angles) + sine_gain * np.sin(angles)) < ALIGNED_WRIST

    def _solver(self, locked_value: float) -> Any:
        key = 0.0 if self.locked_joint is None else round(locked_value, 9)
        solver = self._solvers.get(key)
        if solver is None:
            if len(self._solvers) >= MAX_CACHED_SOLVERS:
                self._solvers.clear()
            solver = HPRobot(self._axes, self._offsets, [] if self.locked_joint is None else [(self.locked_joint, key)])
            self._solvers[key] = solver
        return solver


def _axes_and_offsets(
    model: RobotModel, group: JointGroup, base_link: str, last_link: str
) -> tuple[Array, Array, Array]:
    """Returns the axes (n, 3), the offsets between their points (n + 1, 3) and a rotation (3, 3), in the base frame.

    The rotation converts a rotation of the last link to the rotation of a tip that is aligned with the base at zero.
    """
    data = model.pin_model.createData()
    pin.computeJointJacobians(model.pin_model, data, model.with_mimics(np.zeros(len(model.joint_names))))
    pin.updateFramePlacements(model.pin_model, data)
    base = data.oMf[model.frame_ids[base_link]].inverse()
    tip = base * data.oMf[model.frame_ids[last_link]]
    axes, points = [], [np.zeros(3)]
    for name in group.joints:
        joint = model.pin_model.getJointId(name)
        axes.append(base.rotation @ data.J[3:, model.pin_model.joints[joint].idx_v])
        points.append(base.act(data.oMi[joint].translation))
    points.append(tip.translation)
    return np.array(axes), np.diff(np.vstack(points), axis=0), tip.rotation.T.copy()
