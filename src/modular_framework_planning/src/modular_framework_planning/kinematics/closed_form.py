# SPDX-License-Identifier: BSD-3-Clause
"""Closed-form inverse kinematics of six revolute joints, or of seven with one of them held at chosen values (EAIK)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from eaik.IK_HP import HPRobot

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel

PROBE = 0.37  # [rad]; a generic value, at which no two axes line up by chance
MAX_KEPT = 4096  # solvers kept, one for each value of the held joint


class ClosedForm:
    """Solves a chain whose joints are the group's joints and no other."""

    def __init__(self, model: RobotModel, group: JointGroup, base_link: str, last_link: str) -> None:
        """Reads axes and offsets of the chain from the model with all joints at zero.

        Raises:
            PlanningError: the chain has no known decomposition.
        """
        kinds = {model.document.joint_kinds[name] for name in group.joints}
        if len(group.joints) not in (6, 7) or not kinds <= {"revolute", "continuous"}:
            raise PlanningError(
                ErrorCode.NO_IK_SOLUTION,
                f"group '{group.name}': {len(group.joints)} joints of kind "
                f"{', '.join(sorted(kinds))}; a closed form needs 6 or 7 revolute ones",
            )
        self._axes, self._offsets, self._rotation = _axes_and_offsets(model, group, base_link, last_link)
        self.locked = self._choose_locked(group.name)
        self._robots: dict[float, Any] = {}

    def _choose_locked(self, name: str) -> int | None:
        """Returns the joint to hold, the last one that leaves a solvable chain; None where none need be held."""
        choices = [None] if len(self._axes) == 6 else list(range(6, -1, -1))
        for number in choices:
            held = [] if number is None else [(number, PROBE)]
            if HPRobot(self._axes, self._offsets, held).hasKnownDecomposition():
                return number
        raise PlanningError(ErrorCode.NO_IK_SOLUTION, f"group '{name}': no closed-form solution is known")

    def solve(self, last_in_base: Transform, held: float = 0.0) -> Array:
        """Returns candidate joint vectors, shape (k, joints); some are approximate: the caller refines and checks them.

        Args:
            last_in_base: pose of the chain's last link in the frame of its base link.
            held: value of the held joint of a seven-joint chain [rad].
        """
        target = last_in_base.homogeneous.copy()
        target[:3, :3] = last_in_base.rotation @ self._rotation
        found = np.asarray(self._robot(held).IK(target).Q, dtype=float).reshape(-1, len(self._axes))
        return np.ascontiguousarray(found[np.isfinite(found).all(axis=1)])

    def _robot(self, held: float) -> Any:
        key = 0.0 if self.locked is None else round(held, 9)
        robot = self._robots.get(key)
        if robot is None:
            if len(self._robots) >= MAX_KEPT:
                self._robots.clear()
            robot = HPRobot(self._axes, self._offsets, [] if self.locked is None else [(self.locked, key)])
            self._robots[key] = robot
        return robot


def _axes_and_offsets(
    model: RobotModel, group: JointGroup, base_link: str, last_link: str
) -> tuple[Array, Array, Array]:
    """Returns axes (n, 3) and steps between their points (n + 1, 3) in the base's frame, and the last link's rotation.

    The rotation, transposed, is what turns a pose of the last link into one of a tip that is not turned at zero.
    """
    data = model.pin_model.createData()
    pin.computeJointJacobians(model.pin_model, data, model.with_mimics(np.zeros(len(model.joint_names))))
    pin.updateFramePlacements(model.pin_model, data)
    base = data.oMf[model.frame_ids[base_link]].inverse()
    tip = base * data.oMf[model.frame_ids[last_link]]
    axes, points = [], [np.zeros(3)]
    for name in group.joints:
        number = model.pin_model.getJointId(name)
        axes.append(base.rotation @ data.J[3:, model.pin_model.joints[number].idx_v])
        points.append(base.act(data.oMi[number].translation))
    points.append(tip.translation)
    return np.array(axes), np.diff(np.vstack(points), axis=0), tip.rotation.T.copy()
