# SPDX-License-Identifier: BSD-3-Clause
"""The controllers' file is chosen by MoveIt 2's rule and those of MoveIt 1's packages, and comes out as a list."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from launch_param_builder import ParameterBuilderFileNotFoundError, ParameterFileError
from moveit_configs_utils import MoveItConfigsBuilder

PackageMaker = Callable[..., Path]
SIMPLE = "moveit_simple_controller_manager/MoveItSimpleControllerManager"
MOVEIT2 = """trajectory_execution: {allowed_start_tolerance: 0.02}
moveit_controller_manager: moveit_simple_controller_manager/MoveItSimpleControllerManager
moveit_simple_controller_manager:
  controller_names: [arm_controller, hand_controller]
  arm_controller: {action_ns: follow_joint_trajectory, type: FollowJointTrajectory, default: true, joints: [j1, j2]}
  hand_controller: {action_ns: gripper_cmd, type: ParallelGripperCommand, joints: [f1]}
"""
ROS_CONTROL_ONLY = "arm_controller: {type: position_controllers/JointTrajectoryController, joints: [j1]}\n"


def listing(name: str) -> str:
    return f"controller_list: [{{name: {name}, type: FollowJointTrajectory, joints: [j1]}}]\n"


@pytest.fixture
def execution(make_package: PackageMaker) -> Callable[..., dict[str, Any]]:
    """Loads the controllers of a package with these files, given without `config/` and `.yaml`."""

    def load(files: dict[str, str], robot: str = "r", **arguments: Any) -> dict[str, Any]:
        named = {f"config/{name}.yaml": text for name, text in files.items()}
        make_package(named, without=["config/moveit_controllers.yaml"] if "moveit_controllers" not in files else [])
        builder = MoveItConfigsBuilder(robot, package_name="r_moveit_config")
        return builder.trajectory_execution(**arguments).to_moveit_configs().trajectory_execution

    return load


def names(parameters: dict[str, Any]) -> list[str]:
    return [entry["name"] for entry in parameters["controller_list"]]


@pytest.mark.parametrize(
    ("files", "chosen"),
    [
        (["odd_controllers"], "odd_controllers"),
        (["r_controllers", "moveit2_controllers", "moveit_controllers"], "moveit_controllers"),
        (["r_controllers", "moveit2_controllers"], "moveit2_controllers"),
        (["r_controllers", "ros2_controllers"], "r_controllers"),
        (["controllers"], "controllers"),
        (
            ["fake_controllers", "ros_controllers", "controllers", "simple_moveit_controllers"],
            "simple_moveit_controllers",
        ),
        (["fake_controllers", "ros_controllers", "controllers"], "controllers"),
        (["fake_controllers", "gazebo_controllers", "ros_controllers"], "ros_controllers"),
        (["fake_controllers", "controllers"], "controllers"),
    ],
)
def test_the_file_is_chosen_by_its_name(
    execution: Callable[..., dict[str, Any]], files: list[str], chosen: str
) -> None:
    assert names(execution({name: listing(name) for name in files})) == [chosen]


def test_of_moveit_1_a_file_that_lists_no_controllers_is_passed_over(
    execution: Callable[..., dict[str, Any]],
) -> None:
    files = {"simple_moveit_controllers": "controller_list: []\n", "ros_controllers": ROS_CONTROL_ONLY}
    assert names(execution({**files, "fake_controllers": listing("fake")})) == ["fake"]


def test_fake_controllers_are_not_taken_while_another_file_lists_real_ones(
    execution: Callable[..., dict[str, Any]],
) -> None:
    with pytest.raises(RuntimeError, match="- arm_controllers.yaml\n - fake_controllers.yaml"):
        execution({"fake_controllers": listing("fake"), "arm_controllers": listing("arm")})


def test_files_of_which_none_is_meant_more_than_others_are_an_error_with_the_options(
    execution: Callable[..., dict[str, Any]],
) -> None:
    with pytest.raises(RuntimeError) as caught:
        execution({"left_controllers": listing("left"), "right_controllers": listing("right")})
    assert "\n - left_controllers.yaml\n - right_controllers.yaml" in str(caught.value)
    assert "moveit_controllers.yaml, moveit2_controllers.yaml, r_controllers.yaml" in str(caught.value)


def test_without_a_file_there_is_a_warning_and_no_controllers(
    execution: Callable[..., dict[str, Any]], caplog: pytest.LogCaptureFixture
) -> None:
    assert execution({}) == {"moveit_manage_controllers": True}
    assert "config/*_controllers.yaml" in caplog.text


def test_a_file_without_controllers_is_a_warning(
    execution: Callable[..., dict[str, Any]], caplog: pytest.LogCaptureFixture
) -> None:
    execution({"ros2_controllers": ROS_CONTROL_ONLY})
    assert "ros2_controllers.yaml: lists no controllers (looked for controller_list and" in caplog.text


def test_a_named_file_counts_and_has_to_exist(execution: Callable[..., dict[str, Any]]) -> None:
    files = {"moveit_controllers": listing("moveit"), "gripper_moveit_controllers": listing("gripper")}
    assert names(execution(files, file_path="config/gripper_moveit_controllers.yaml")) == ["gripper"]
    with pytest.raises(ParameterBuilderFileNotFoundError, match="config/lost.yaml doesn't exist"):
        execution(files, file_path="config/lost.yaml")


def test_moveit_2s_controllers_become_moveit_1s_list(execution: Callable[..., dict[str, Any]]) -> None:
    parameters = execution({"moveit_controllers": MOVEIT2})
    arm = {
        "action_ns": "follow_joint_trajectory",
        "type": "FollowJointTrajectory",
        "default": True,
        "joints": ["j1", "j2"],
    }
    assert parameters["controller_list"] == [
        {"name": "arm_controller", **arm},
        {"name": "hand_controller", "action_ns": "gripper_cmd", "type": "GripperCommand", "joints": ["f1"]},
    ]
    assert parameters["moveit_controller_manager"] == SIMPLE
    assert parameters["trajectory_execution"] == {"allowed_start_tolerance": 0.02}
    assert parameters["moveit_manage_controllers"] is True


def test_the_names_are_also_where_launch_files_of_moveit_2_look_for_them(
    execution: Callable[..., dict[str, Any]],
) -> None:
    parameters = execution({"moveit_controllers": listing("arm_controller")}, moveit_manage_controllers=False)
    assert parameters["moveit_simple_controller_manager"]["controller_names"] == ["arm_controller"]
    assert parameters["moveit_controller_manager"] == SIMPLE
    assert parameters["moveit_manage_controllers"] is False


def test_fake_controllers_of_moveit_1_are_run_by_the_manager_of_fake_ones(
    execution: Callable[..., dict[str, Any]], caplog: pytest.LogCaptureFixture
) -> None:
    text = "controller_list: [{name: fake_arm, type: $(arg fake_execution_type), joints: [j1]}]\n"
    parameters = execution({"fake_controllers": text})
    assert "fake_controllers.yaml: the controllers are fake controllers; no robot or simulation" in caplog.text
    assert parameters["moveit_controller_manager"] == "moveit_fake_controller_manager/MoveItFakeControllerManager"
    assert parameters["controller_list"] == [{"name": "fake_arm", "type": "interpolate", "joints": ["j1"]}]


@pytest.mark.parametrize("controllers", ["", listing("arm")])
def test_managers_of_ros2_control_have_the_names_of_ros_control_and_need_no_list(
    execution: Callable[..., dict[str, Any]], controllers: str, caplog: pytest.LogCaptureFixture
) -> None:
    text = f"moveit_controller_manager: moveit_ros_control_interface/Ros2ControlManager\n{controllers}"
    parameters = execution({"moveit_controllers": text})
    assert "lists no controllers" not in caplog.text
    assert parameters["moveit_controller_manager"] == "moveit_ros_control_interface::MoveItControllerManager"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "moveit_simple_controller_manager: {controller_names: [a, b], a: {type: FollowJointTrajectory}}",
            "controller_names has b without parameters; controllers with parameters: a",
        ),
        ("controller_list: {a: 1}", r"controller_list is {'a': 1}; expected a list of mappings with a name each"),
        ("controller_list: [{joints: [a]}]", "expected a list of mappings with a name each"),
    ],
)
def test_a_faulty_list_is_named_with_what_is_needed(
    execution: Callable[..., dict[str, Any]], text: str, message: str
) -> None:
    with pytest.raises(ParameterFileError, match=f"moveit_controllers.yaml: .*{message}"):
        execution({"moveit_controllers": text})
