# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of a launch are held against what its nodes, and their hardware, declare."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from modular_framework_core.launching.ros_declared_names import DeclaredNames
from modular_framework_core.launching.ros_launch_preview import LaunchedNode, LaunchPreview, preview_launch

ROBOT_HW = LaunchedNode("modular_framework_control", "robot_hw", "/robot_hw", "/")
UR, EZGRIPPER = (f"modular_framework_drivers/{name}RobotHW" for name in ("UrArm", "EzGripper"))
COMBINED: dict[str, Any] = {
    "/robot_hardware": ["arm_hw", "hand_hw"],
    "/arm_hw/type": UR,
    "/arm_hw/robot_ip_address": "192.168.56.101",
    "/hand_hw/type": EZGRIPPER,
    "/port_name": "/dev/ttyUSB0",
}


MOVE_GROUP = LaunchedNode("moveit_ros_move_group", "move_group", "/move_group", "/")
PACKAGES = Path(__file__).resolve().parents[2] / "packages"


def faults(parameters: dict[str, Any]) -> list[str]:
    names = DeclaredNames(LaunchPreview((ROBOT_HW,), parameters))
    return [fault.text for fault in (*names.misspelt(), *names.wrong_values())]


def test_hardware_that_is_right_has_no_faults() -> None:
    assert faults(COMBINED) == []
    assert faults({"/robot_hw/type": UR, "/robot_hw/robot_ip_address": "10.0.0.2", "/robot_hw/rate": 500}) == []


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"/arm_hw/robot_ip_address": None}, "needs the parameter '/arm_hw/robot_ip_address'"),
        (
            {"/arm_hw/speed_scale": 2.0},
            "parameter '/arm_hw/speed_scale' is 2.0; allowed: a number, at least 0 and at most 1",
        ),
        (
            {"/arm_hw/servoj_gian": 300},
            "does not read the parameter '/arm_hw/servoj_gian'; did you mean '/arm_hw/servoj_gain'",
        ),
        (
            {"/hand_hw/poll_rate": 0},
            "parameter '/hand_hw/poll_rate' is 0; allowed: a number, at least 1 and at most 200",
        ),
        ({"/servo_ids": [1, 1]}, "parameter '/servo_ids' is [1, 1]; allowed: a list that is not empty, each a whole"),
        ({"/robot_hw/rate": "fast"}, "parameter '/robot_hw/rate' is 'fast'; allowed: a number, at least 1"),
    ],
)
def test_parameters_of_hardware_are_checked_by_the_declaration_of_its_class(changes: dict[str, Any], text: str) -> None:
    given = {name: value for name, value in {**COMBINED, **changes}.items() if value is not None}
    (found,) = faults(given)
    assert text in found


def test_names_in_lists_are_names_too() -> None:
    parameters = {"/robot_hw/type": "modular_framework_control/MockRobotHW", "/robot_hw/joints": ["a", "b"]}
    names = DeclaredNames(LaunchPreview((ROBOT_HW,), parameters))
    assert list(names.naming("joint")) == [("/robot_hw/joints", "a"), ("/robot_hw/joints", "b")]


def test_parameters_that_change_nothing_are_known() -> None:
    names = DeclaredNames(LaunchPreview((ROBOT_HW, MOVE_GROUP), COMBINED))
    assert {"/arm_hw/robot_program_path", "/move_group/max_safe_path_cost"} <= {*names.without_effect()}
    assert "/arm_hw/robot_ip_address" not in names.without_effect()


def test_hardware_of_others_without_a_declaration_may_have_any_parameter() -> None:
    assert faults({"/robot_hardware": ["arm"], "/arm/type": "my_arm/MyArm", "/arm/joints": 3}) == []
    assert faults({"/robot_hw/type": "my_arm/MyArm", "/robot_hw/joints": 3, "/robot_hw/real_time_priority": 80}) == []


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"/robot_hw/type": UR, "/robot_hw/robot_ip_address": "10.0.0.2", "/robot_hw/speed": 1.0}, "does not read"),
        ({**COMBINED, "/robot_hw/joints": ["a"]}, "node '/robot_hw' does not read the parameter '/robot_hw/joints'"),
        ({"/robot_hw/joints": ["a"], "/robot_hw/inital_positions": {}}, "did you mean '/robot_hw/initial_positions'"),
        ({"/robot_hw/type": "my_arm/MyArm", "/robot_hw/rte": 500}, "did you mean '/robot_hw/rate'"),
        ({"/robot_hardware": ["a"], "/a/type": "my/A", "/a/topic_to_wait_fr": "b"}, "mean '/a/topic_to_wait_for'"),
        ({**COMBINED, "/robot_hardwares": ["arm_hw"]}, "did you mean '/robot_hardware'"),
        ({**COMBINED, "/joint_limts/elbow_joint/max_velocity": 1.0}, "mean '/joint_limits/elbow_joint/max_velocity'"),
    ],
)
def test_a_misspelt_parameter_of_the_robots_hardware_is_a_fault(parameters: dict[str, Any], text: str) -> None:
    (found,) = faults(parameters)
    assert text in found


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("allow_trajectory_executon", "allow_trajectory_execution"),
        ("trajectory_execution/allowed_start_tolerence", "trajectory_execution/allowed_start_tolerance"),
        ("trajectry_execution/allowed_start_tolerance", "trajectory_execution/allowed_start_tolerance"),
        ("planning_piplines/ompl/planning_plugin", "planning_pipelines/ompl/planning_plugin"),
        ("octomap_resoluton", "octomap_resolution"),
        ("serach_threads", "search_threads"),
    ],
)
def test_a_misspelt_parameter_of_move_group_is_a_fault(name: str, meant: str) -> None:
    launch = LaunchPreview((MOVE_GROUP,), {f"/move_group/{name}": 1})
    (found,) = DeclaredNames(launch).misspelt()
    assert found.text == f"no node reads the parameter '/move_group/{name}'; did you mean '/move_group/{meant}'?"


def test_parameters_that_only_moveit_or_a_plugin_knows_are_no_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    names = (
        "use_controller_manager", "controller_manager_name", "moveit_sensor_manager", "monitor_dynamics",
        "sense_for_plan/max_safe_path_cost", "pick_place/max_consecutive_fail_attempts", "pick_place/jump_factor",
        "trajectory_execution/control_multi_dof_joint_variables", "ompl/minimum_waypoint_count",
        # one pipeline in the namespace of the node, as before Noetic
        "planning_plugin", "request_adapters", "jiggle_fraction", "planner_configs/RRT/range",
        "manipulator/longest_valid_segment_fraction", "planning_time_limit", "ridge_factor", "collision_clearance",
        # inverse kinematics and a capability of somebody
        "manipulator/solve_type", "position_only_ik", "my_capability/rate",
    )  # fmt: skip
    launch = LaunchPreview((MOVE_GROUP,), {f"/move_group/{name}": 1 for name in names})
    assert list(DeclaredNames(launch).misspelt()) == []
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(PACKAGES), prepend=":")
    written = preview_launch(str(PACKAGES / "panda_moveit_config/launch/move_group.launch"), ["pipeline:=chomp"])
    assert any(name.startswith("/move_group/planning_pipelines/chomp/") for name in written.parameters)
    assert list(DeclaredNames(written).misspelt()) == []
