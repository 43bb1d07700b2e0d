# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of controllers are declared per type; a misspelt parameter is named when the controller is loaded."""

from __future__ import annotations

import ast
import logging
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from modular_framework_control.controller_manager.controller_parameters import (
    controller_declaration,
    parameter_faults,
)
from modular_framework_control.controller_manager.controller_types import BUILT_IN_TYPES

SOURCES = Path(__file__).resolve().parents[3] / "src/modular_framework_control/src/modular_framework_control"
READERS = ("read_number", "read_bool", "read_names", "read_name", "read_positive", "_diagonal")
TRAJECTORY, GRIPPER = "position_controllers/JointTrajectoryController", "effort_controllers/GripperActionController"

# As shipped by franka_ros, the UR driver, the Gazebo tutorial of rrbot, and ros_controllers' own tests
PUBLIC = """
effort_joint_trajectory_controller:
  type: effort_controllers/JointTrajectoryController
  joints: [panda_joint1, panda_joint2]
  gains:
    panda_joint1: {p: 600, d: 30, i: 0}
    panda_joint2: {p: 600, d: 30, i: 0, i_clamp: 1}
  constraints:
    goal_time: 0.5
    panda_joint1: {goal: 0.05}
    panda_joint2: {goal: 0.05}
scaled_pos_joint_traj_controller:
  type: position_controllers/ScaledJointTrajectoryController
  joints: &joints [shoulder_pan_joint, wrist_3_joint]
  constraints:
    goal_time: 0.6
    stopped_velocity_tolerance: 0.05
    shoulder_pan_joint: {trajectory: 0.2, goal: 0.1}
    wrist_3_joint: {trajectory: 0.2, goal: 0.1}
  stop_trajectory_duration: 0.5
  state_publish_rate: 125
  action_monitor_rate: 20
vel_joint_traj_controller:
  type: velocity_controllers/JointTrajectoryController
  joints: *joints
  gains:
    shoulder_pan_joint: {p: 5.0, i: 0.05, d: 0.1, i_clamp: 1}
    wrist_3_joint: {p: 5.0, i: 0.05, d: 0.1, i_clamp: 1}
  velocity_ff: {shoulder_pan_joint: 1.0, wrist_3_joint: 1.0}
joint_state_controller: {type: joint_state_controller/JointStateController, publish_rate: 125}
speed_scaling: {type: scaled_controllers/SpeedScalingStateController, publish_rate: 125}
joint1_position_controller:
  type: effort_controllers/JointPositionController
  joint: joint1
  pid: {p: 100.0, i: 0.01, d: 10.0}
gripper:
  type: position_controllers/GripperActionController
  joint: finger
  action_monitor_rate: 20
  goal_tolerance: 0.002
  max_effort: 100
  stall_velocity_threshold: 0.001
  stall_timeout: 0.2
diffbot_controller:
  type: diff_drive_controller/DiffDriveController
  left_wheel: wheel_0_joint
  right_wheel: wheel_1_joint
  publish_rate: 50.0
  pose_covariance_diagonal: [0.001, 0.001, 1000000.0, 1000000.0, 1000000.0, 1000.0]
  twist_covariance_diagonal: [0.001, 0.001, 1000000.0, 1000000.0, 1000000.0, 1000.0]
  cmd_vel_timeout: 20.0
  wheel_separation: 0.4
  publish_cmd: true
  linear: {x: {has_velocity_limits: true, min_velocity: -1.0, max_velocity: 1.0, has_jerk_limits: true, max_jerk: 5}}
  angular: {z: {has_acceleration_limits: true, max_acceleration: 2.0}}
"""


@pytest.mark.parametrize(
    ("name", "entry"), yaml.safe_load(PUBLIC).items(), ids=lambda value: value if isinstance(value, str) else ""
)
def test_public_controller_files_are_taken_unchanged(name: str, entry: dict[str, Any]) -> None:
    assert parameter_faults(entry["type"], entry) == []


@pytest.mark.parametrize(
    ("kind", "parameters", "words"),
    [
        (TRAJECTORY, {"constraints": {"goal_tme": 0.6}}, "'constraints/goal_tme' names no joint or param.*'goal_time'"),
        (TRAJECTORY, {"constraints": {"a": {"gaol": 0.1}}}, "'constraints/a/gaol' names no parameter.*'goal'"),
        (TRAJECTORY, {"constraints": {"c": {"goal": 0.1}}}, "names no joint or parameter: 'c'; allowed: .*a, b"),
        (TRAJECTORY, {"stop_trajectory_duratin": 0.5}, "did you mean 'stop_trajectory_duration'"),
        (TRAJECTORY, {"state_publish_rate": -1}, "'state_publish_rate' is -1; allowed: a number, at least 0"),
        (TRAJECTORY, {"allow_partial_joints_goal": "no"}, "is 'no'; allowed: true or false"),
        (TRAJECTORY, {"joints": None}, "parameter 'joints' is not set"),
        (GRIPPER, {"joint": "a", "stalled_velocity_threshold": 0.1}, "did you mean 'stall_velocity_threshold'"),
        (GRIPPER, {"joint": "a", "gains": {"a": {"P": 1.0}}}, "'gains/a/P' names no parameter"),
        ("effort_controllers/JointGroupPositionController", {"a": {"pdi": {"p": 1.0}}}, "did you mean 'pid'"),
        ("imu_sensor_controller/ImuSensorController", {"publish_rat": 1.0}, "did you mean 'publish_rate'"),
    ],
)  # fmt: skip
def test_wrong_parameters_are_named_with_the_nearest_name_or_the_allowed_values(
    kind: str, parameters: dict[str, Any], words: str
) -> None:
    base = {"type": kind} if "joint" in parameters or "imu" in kind else {"type": kind, "joints": ["a", "b"]}
    (fault,) = parameter_faults(kind, base | parameters)
    assert re.search(words, fault), fault


@pytest.mark.parametrize("kind", BUILT_IN_TYPES)
def test_every_type_declares_its_parameters(kind: str) -> None:
    declared = controller_declaration(kind)
    assert declared is not None and declared.closed
    assert "type" in declared.parameters


def _read_keys() -> Iterator[tuple[str, str, Any]]:
    """Yields the file, the name and the default (an unset default is None) of the parameters that controllers read."""
    files = [*SOURCES.glob("controllers/*.py"), *SOURCES.glob("mobile_base/*.py")]
    for file in (*files, SOURCES / "trajectory/tolerances.py", SOURCES / "controller_interface/pid.py"):
        for call in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            name = getattr(call.func, "id", getattr(call.func, "attr", "")) if isinstance(call, ast.Call) else ""
            position = 1 if name in READERS else 0 if name in ("get_param", "has_param") else None
            if position is None or not isinstance(call.args[position], ast.Constant):
                continue
            default = call.args[position + 1 :][:1]
            is_literal = bool(default) and isinstance(default[0], ast.Constant)
            yield file.stem, call.args[position].value, default[0].value if is_literal else None


def test_controllers_read_no_parameter_past_their_declarations() -> None:
    declared: dict[str, list[Any]] = {"robot_description": []}
    for kind in BUILT_IN_TYPES:
        for name, item in controller_declaration(kind).parameters.items():
            declared.setdefault(name.rpartition("/")[2], []).append(item.default)
    found = list(_read_keys())
    assert len(found) > 40
    for file, key, default in found:
        assert key in declared, f"{file} reads {key}"
        is_checked = default is not None and not key.startswith(("wheel_", "p"))  # the geometry has no constant default
        assert not is_checked or default in declared[key], f"{file}: default of {key}"


def test_a_loaded_controller_warns_of_parameters_that_it_does_not_read_and_runs(
    make_loop: Callable[..., Any], caplog: pytest.LogCaptureFixture
) -> None:
    arm = {"type": TRAJECTORY, "joints": ["a"], "constraints": {"goal_tme": 0.6}, "state_publish_rat": 25}
    loop = make_loop({"hw": {"joints": ["a"]}, "arm": arm})
    with caplog.at_level(logging.WARNING):
        loop.manager.load_controller("arm")
    warnings = [record.getMessage() for record in caplog.records if "'arm'" in record.getMessage()]
    assert len(warnings) == 2
    assert "'constraints/goal_tme'" in warnings[0] and "did you mean 'goal_time'?" in warnings[0]
    assert "did you mean 'state_publish_rate'?" in warnings[1] and warnings[1].endswith("it is ignored")
    assert "arm" in loop.controllers
