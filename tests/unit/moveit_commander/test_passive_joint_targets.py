# SPDX-License-Identifier: BSD-3-Clause
"""Approximate inverse kinematics and random joint values do not move the passive joint of a group."""

from __future__ import annotations

import random
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_commander.group_joint_targets import GroupJointTargets
from moveit_commander.robot_model import RobotModel
from moveit_msgs.msg import MoveItErrorCodes, RobotState
from moveit_msgs.srv import GetPositionFKResponse, GetPositionIKResponse

JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="0 0 {height}"/><axis xyz="{axis}"/><limit lower="{low}" upper="{high}" velocity="2" effort="9"/></joint>
<link name="{child}"/>"""
SPRING, SPRING_AT = "spring", 0.015  # position of the passive joint [m]
TURNING = {"turn": "0 0 1", "lift": "0 1 0", "elbow": "0 1 0", "wrist": "0 1 0"}


def urdf() -> str:
    """An arm whose palm is on a spring."""
    text, parent = '<robot name="sprung"><link name="base"/>', "base"
    for name, axis in TURNING.items():
        own = {"name": name, "parent": parent, "child": f"{name}_link", "axis": axis}
        text += JOINT.format(**own, kind="revolute", height=0.25, low=-2.5, high=2.5)
        parent = f"{name}_link"
    own = {"name": SPRING, "parent": parent, "child": "palm", "axis": "0 0 1"}
    return text + JOINT.format(**own, kind="prismatic", height=0.25, low=-0.01, high=0.03) + "</robot>"


SRDF = f"""<robot name="sprung"><group name="arm"><chain base_link="base" tip_link="palm"/></group>
<passive_joint name="{SPRING}"/></robot>"""
LIBRARY_MODEL = pin.buildModelFromXML(urdf())


def link_pose(link: str, values: dict[str, float]) -> pin.SE3:
    """The pose of a link by Pinocchio, with the spring at SPRING_AT."""
    positions, data = np.zeros(LIBRARY_MODEL.nq), LIBRARY_MODEL.createData()
    for name, value in {**values, SPRING: SPRING_AT}.items():
        positions[LIBRARY_MODEL.joints[LIBRARY_MODEL.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(LIBRARY_MODEL, data, positions)
    return data.oMf[LIBRARY_MODEL.getFrameId(link)].copy()


class UnsolvableServers:
    """A move_group for which no pose has an exact solution."""

    ik_state = RobotState()

    def call(self, name: str, kind: Any, request: Any) -> Any:
        if name == "compute_ik":
            self.ik_state = request.ik_request.robot_state
            return GetPositionIKResponse(error_code=MoveItErrorCodes(MoveItErrorCodes.NO_IK_SOLUTION))
        state = request.robot_state.joint_state
        found = link_pose(request.fk_link_names[0], dict(zip(state.name, state.position, strict=True)))
        pose = Pose(Point(*found.translation), Quaternion(*pin.Quaternion(found.rotation).coeffs().tolist()))
        return GetPositionFKResponse(
            pose_stamped=[PoseStamped(pose=pose)], error_code=MoveItErrorCodes(MoveItErrorCodes.SUCCESS)
        )


class SprungArm(GroupJointTargets):
    """The arm's targets without a node."""

    def __init__(self) -> None:
        self._model = RobotModel(urdf(), SRDF)
        self._group = self._model.group("arm")
        self.servers = UnsolvableServers()
        self._servers: Any = self.servers
        positions = {**dict.fromkeys(TURNING, 0.0), SPRING: SPRING_AT}

        def message_of(values: dict[str, float]) -> RobotState:
            state = RobotState()
            state.joint_state.name, state.joint_state.position = list(values), list(values.values())
            return state

        self._state: Any = SimpleNamespace(positions=lambda names: positions, message_of=message_of)
        self._joint_target = dict.fromkeys((*TURNING, SPRING), 0.0)
        self._joint_tolerance, self._random = 1e-4, random.Random(1)
        self._end_effector_link, self._pose_reference_frame = "palm", "base"


def test_approximate_ik_takes_the_passive_joint_as_it_is() -> None:
    arm = SprungArm()
    bent = {"turn": 0.3, "lift": 0.4, "elbow": 0.9, "wrist": 0.4}
    wanted = link_pose("palm", bent)
    pose = Pose(Point(*wanted.translation), Quaternion(*pin.Quaternion(wanted.rotation).coeffs().tolist()))
    arm.set_joint_value_target(pose, True)
    target = dict(zip((*TURNING, SPRING), arm.get_joint_value_target(), strict=True))
    assert SPRING not in arm.servers.ik_state.joint_state.name
    reached = link_pose("palm", {name: target[name] for name in TURNING})
    assert np.linalg.norm(pin.log6(reached.actInv(wanted)).vector) < 1e-4


def test_a_pose_beyond_reach_does_not_move_the_passive_joint() -> None:
    arm = SprungArm()
    stretched = link_pose("palm", dict.fromkeys(TURNING, 0.0)).translation
    arm.set_joint_value_target(Pose(Point(0.0, 0.0, stretched[2] + 0.02), Quaternion(0.0, 0.0, 0.0, 1.0)), True)
    target = dict(zip((*TURNING, SPRING), arm.get_joint_value_target(), strict=True))
    assert target == pytest.approx({**dict.fromkeys(TURNING, 0.0), SPRING: 0.0}, abs=1e-3)
    assert link_pose("palm", {name: target[name] for name in TURNING}).translation == pytest.approx(stretched, abs=1e-4)


def test_random_values_keep_the_passive_joint() -> None:
    arm = SprungArm()
    values = arm.get_random_joint_values()
    assert len(values) == len(TURNING) + 1 and values[-1] == 0.0 and all(values[:-1])
    arm.set_random_target()
    assert arm.get_joint_value_target()[-1] == 0.0
