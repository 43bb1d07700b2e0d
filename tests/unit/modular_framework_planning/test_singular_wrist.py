# SPDX-License-Identifier: BSD-3-Clause
"""A singular wrist (two parallel axes) has infinitely many solutions; near and constrained solutions are found."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from pose_difference import pose_difference

pytest.importorskip("moveit_msgs.msg", reason="source the workspace: the messages are not built")

from geometry_msgs.msg import Point, Pose, Quaternion  # noqa: E402
from moveit_msgs.msg import JointConstraint, MoveItErrorCodes  # noqa: E402
from moveit_msgs.srv import GetPositionIKRequest  # noqa: E402

from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics, KinematicsPool  # noqa: E402
from modular_framework_planning.move_group import capability_names as names  # noqa: E402
from modular_framework_planning.move_group.capabilities import kinematics_service  # noqa: E402
from modular_framework_planning.planning_scene.planning_scene import empty_scene  # noqa: E402
from modular_framework_planning.robot_model.robot_model import RobotModel  # noqa: E402

GROUP, TIP = "arm_and_manipulator", "eg_manipulator"
WRIST_1, WRIST_2 = 3, 4
TOLERANCE = 0.01  # of the held joint [rad]
SEED = (0.1, -1.0, 1.0, 0.2, 0.3, 0.1)


def with_arm_at(model: RobotModel, values: Any) -> np.ndarray:
    positions = model.default_positions().copy()
    positions[model.group(GROUP).indices] = values
    return positions


def aligned(rng: np.random.Generator, wrist_2: float) -> np.ndarray:
    """Arm positions with a given value of wrist_2."""
    values = rng.uniform(-1.5, 1.5, 6)
    values[WRIST_2] = wrist_2
    return values


def tip_pose(model: RobotModel, positions: np.ndarray) -> pin.SE3:
    data = model.pin_model.createData()
    pin.framesForwardKinematics(model.pin_model, data, positions)
    return data.oMf[model.frame_ids[TIP]].copy()


@pytest.mark.parametrize("wrist_2", [0.0, np.pi, 1e-6, 1e-3])
def test_the_nearest_solution_to_a_posture_with_a_singular_wrist_is_the_posture(
    model: RobotModel, wrist_2: float
) -> None:
    solver, rng = InverseKinematics(model, model.group(GROUP)), np.random.default_rng(1)
    for _ in range(20):
        positions = with_arm_at(model, aligned(rng, wrist_2))
        target = tip_pose(model, positions)
        found = solver.solutions(TIP, target, positions)
        assert found and np.abs(found[0] - positions).max() < 1e-4
        for item in found[:: max(1, len(found) // 8)]:
            assert max(pose_difference(tip_pose(model, item), target)) < 1e-6
            assert not model.bound_violations(item, solver.group.indices)


@pytest.fixture
def compute_ik(model: RobotModel, monkeypatch: pytest.MonkeyPatch) -> Callable[[Any], Any]:
    """The service compute_ik of a robot that stands at SEED."""
    monitor = SimpleNamespace(
        snapshot=lambda: empty_scene(model, with_arm_at(model, SEED)), wait_for_state=lambda: None
    )
    reporter = SimpleNamespace(
        report=lambda *arguments, **details: None,
        failure=lambda kind, error, **details: MoveItErrorCodes.NO_IK_SOLUTION,
    )
    context: Any = SimpleNamespace(model=model, monitor=monitor, kinematics=KinematicsPool(model), reporter=reporter)
    services: dict[str, Callable[[Any], Any]] = {}
    monkeypatch.setattr(kinematics_service.rospy, "Service", lambda name, kind, serve: services.setdefault(name, serve))
    monkeypatch.setattr(kinematics_service, "launch_seed", lambda: None)
    kinematics_service.KinematicsService(context).connect()
    return services[names.IK_SERVICE]


@pytest.mark.parametrize("wrist_2", [0.0, np.pi, 1.0])
def test_compute_ik_keeps_a_held_joint_of_a_singular_wrist(
    model: RobotModel, compute_ik: Callable[[Any], Any], wrist_2: float
) -> None:
    rng, joints = np.random.default_rng(1), model.group(GROUP).joints
    for _ in range(10):
        values = aligned(rng, wrist_2)
        target = tip_pose(model, with_arm_at(model, values))
        request = GetPositionIKRequest()
        request.ik_request.group_name, request.ik_request.ik_link_name = GROUP, TIP
        rotation = pin.Quaternion(target.rotation).coeffs().tolist()
        request.ik_request.pose_stamped.pose = Pose(Point(*target.translation), Quaternion(*rotation))
        request.ik_request.timeout.secs = 1
        held = JointConstraint(joints[WRIST_1], values[WRIST_1], TOLERANCE, TOLERANCE, 1.0)
        request.ik_request.constraints.joint_constraints = [held]
        request.ik_request.robot_state.is_diff = True
        response = compute_ik(request)
        assert response.error_code.val == MoveItErrorCodes.SUCCESS, values
        state = response.solution.joint_state
        found = model.merge(model.default_positions(), dict(zip(state.name, state.position, strict=True)))
        assert abs(found[model.index[joints[WRIST_1]]] - values[WRIST_1]) < TOLERANCE + 2e-6
        assert max(pose_difference(tip_pose(model, found), target)) < 1e-5
