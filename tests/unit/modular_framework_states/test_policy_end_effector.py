# SPDX-License-Identifier: BSD-3-Clause
"""End-effector deltas of a policy become joint positions, or are refused with the reason."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from mbf_method.actions import limited_targets
from mbf_method.errors import InvalidOutputError
from mbf_method.observation import GRIPPER_COLUMN
from modular_framework_core.commander.robot_groups import RobotModelError, read_group
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_states.policy_actions import end_effector_spec, joint_action_spec
from modular_framework_states.policy_end_effector import EndEffector
from modular_framework_testing.planning.ur5_limits import LIMITS

ROBOTS = Path(__file__).parents[3] / "src/robots"
START = np.array([3.1376, -1.6560, 1.3870, -1.2662, -1.5708, 0.0])
"""A posture far from singularities [rad]."""
STRETCHED = np.array([0.0, -math.pi / 2, 0.0, -math.pi / 2, -1.0, 0.0])
ALIGNED_WRIST = np.array([3.1376, -1.6560, 1.3870, -1.2662, 0.0, 0.0])


class Arm:
    """The UR5, with forward kinematics of its own."""

    def __init__(self) -> None:
        expand = pytest.importorskip("xacro_rospkg", reason="source the workspace").expand
        self.urdf = expand(ROBOTS / "ur5_ezgripper_robot/urdf/ur5_with_ezgripper.urdf.xacro")
        self.srdf = (ROBOTS / "ur5_ezgripper_moveit_config/config/ur5_with_ezgripper.srdf").read_text()
        model = RobotModel(self.urdf, self.srdf, LIMITS)
        self.solver = InverseKinematics(model, model.group("arm"))
        self.joints = self.solver.group.joints
        self._model = pin.buildModelFromXML(self.urdf)

    def tip(self, positions: np.ndarray) -> pin.SE3:
        data, configuration = self._model.createData(), pin.neutral(self._model)
        for name, position in zip(self.joints, positions, strict=True):
            configuration[self._model.joints[self._model.getJointId(name)].idx_q] = position
        pin.framesForwardKinematics(self._model, data, configuration)
        return data.oMf[self._model.getFrameId("ee_link")]

    def end_effector(self, frame: str = "") -> EndEffector:
        return EndEffector(self.solver, self.joints, frame, lambda names: {})


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Arm()


def test_translations_move_the_tip_along_the_axes_of_the_planning_frame(arm: Arm) -> None:
    step = np.array([0.01, 0.005, -0.02])
    positions = arm.end_effector().follow(np.tile([*step, 0.0, 0.0, 0.0], (5, 1)), START)
    before = arm.tip(START)
    for number, row in enumerate(positions, start=1):
        after = arm.tip(row)
        assert after.translation == pytest.approx(before.translation + number * step, abs=1e-6)
        assert after.rotation == pytest.approx(before.rotation, abs=1e-6)


def test_a_rotation_vector_turns_the_tip_about_its_origin(arm: Arm) -> None:
    positions = arm.end_effector().follow(np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.1], (3, 1)), START)
    before, after = arm.tip(START), arm.tip(positions[-1])
    assert after.translation == pytest.approx(before.translation, abs=1e-6)
    about_z = np.array([[math.cos(0.3), -math.sin(0.3), 0.0], [math.sin(0.3), math.cos(0.3), 0.0], [0.0, 0.0, 1.0]])
    assert after.rotation == pytest.approx(about_z @ before.rotation, abs=1e-6)


def test_the_axes_of_a_link_move_with_the_link(arm: Arm) -> None:
    end_effector = arm.end_effector("ee_link")
    positions = end_effector.follow(np.tile([0.02, 0.0, 0.01, 0.0, 0.2, 0.0], (2, 1)), START)
    expected = arm.tip(START)
    for _ in range(2):
        turned = expected.rotation @ pin.exp3(np.array([0.0, 0.2, 0.0]))
        expected = pin.SE3(turned, expected.translation + expected.rotation @ np.array([0.02, 0.0, 0.01]))
    assert arm.tip(positions[-1]).homogeneous == pytest.approx(expected.homogeneous, abs=1e-6)
    assert end_effector.pose(positions[-1]) == pytest.approx(np.eye(4), abs=1e-9)


def test_joint_vectors_keep_the_order_of_the_actions(arm: Arm) -> None:
    displacements = np.tile([0.01, 0.0, 0.0, 0.0, 0.05, 0.0], (2, 1))
    reverse = EndEffector(arm.solver, arm.joints[::-1], "", lambda names: {})
    positions = reverse.follow(displacements, START[::-1])
    assert positions[:, ::-1] == pytest.approx(arm.end_effector().follow(displacements, START))
    assert reverse.pose(START[::-1]) == pytest.approx(arm.tip(START).homogeneous, abs=1e-9)


@pytest.mark.parametrize(
    ("start", "frame", "displacement", "reason"),
    [
        (STRETCHED, "", [0.0, 0.0, 0.3, 0.0, 0.0, 0.0], "cannot be executed: .*reach"),
        (ALIGNED_WRIST, "ee_link", [0.0, 0.0, 0.0, 0.0, 0.1, 0.1], "would jump .* near a singular posture"),
        ([*START[:5], 6.25], "ee_link", [0.0, 0.0, 0.0, 0.1, 0.0, 0.0], "wrist_3_joint"),
        (START, "", [0.0, 0.0, 0.0, 0.0, 0.0, 90.0], "rotation vector of length 90.0000; it must be at most pi"),
    ],
    ids=["out of reach", "singular", "joint limit", "degrees"],
)
def test_a_displacement_that_the_arm_cannot_follow_is_refused_with_its_reason(
    arm: Arm, start: list[float], frame: str, displacement: list[float], reason: str
) -> None:
    displacements = np.array([[0.0] * 6, displacement])
    with pytest.raises(InvalidOutputError, match=rf"actions\[1\] .*{reason}"):
        arm.end_effector(frame).follow(displacements, np.array(start))


def test_a_displacement_that_is_too_fast_for_a_joint_exceeds_its_velocity_limit(arm: Arm) -> None:
    group = read_group(arm.urdf, arm.srdf, "arm", LIMITS)
    spec = joint_action_spec(group, (), "positions", has_gripper=False, timing=(1, 10.0), accelerates=False)
    positions = arm.end_effector().follow(np.array([[0.0, 0.0, -0.3, 0.0, 0.0, 0.0]]), START)
    assert "the maximum velocity is 3.0000 per s" in limited_targets(positions, spec, START).fault
    limited = joint_action_spec(group, (), "positions", has_gripper=False, timing=(1, 10.0), accelerates=True)
    positions = arm.end_effector().follow(np.array([[0.0, 0.0, -0.06, 0.0, 0.0, 0.0]]), START)
    assert limited_targets(positions, spec, START).fault == ""
    assert "the maximum acceleration is 5.0000 per s^2" in limited_targets(positions, limited, START).fault


def test_the_required_actions_name_the_columns_the_link_and_the_frame(arm: Arm) -> None:
    group = read_group(arm.urdf, arm.srdf, "arm", LIMITS)
    positions = joint_action_spec(group, (), "positions", has_gripper=True, timing=(8, 10.0), accelerates=False)
    spec = end_effector_spec(positions, "ee_link", "world")
    assert spec.names == ("x", "y", "z", "rx", "ry", "rz", GRIPPER_COLUMN)
    assert (spec.link, spec.frame, spec.joint_names) == ("ee_link", "world", ())
    assert spec.upper.tolist() == [math.inf] * 6 + [1.0]


def test_an_unknown_frame_and_other_joints_are_named(arm: Arm) -> None:
    with pytest.raises(RobotModelError, match="'ee_lnk' is neither .* did you mean 'ee_link'"):
        arm.end_effector("ee_lnk")
    with pytest.raises(RobotModelError, match="both must be the same"):
        EndEffector(arm.solver, arm.joints[:5], "", lambda names: {})
