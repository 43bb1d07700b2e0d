# SPDX-License-Identifier: BSD-3-Clause
"""What MoveIt 2's tutorial on launch files says about the launch file, a test for each thing it says.

The file is the UR5's `demo.launch.py`, which is the tutorial's with the names of another robot. It is visited, and what
it would start and set is looked at. `tests/system/test_demo_launch.py` runs it.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import rospkg
from launch import LaunchContext
from launch.actions import DeclareLaunchArgument
from launch.core.process_request import ProcessRequest
from launch.launch_description_sources import PythonLaunchDescriptionSource
from moveit_configs_utils import MoveItConfigs, MoveItConfigsBuilder

PACKAGE = "ur5_ezgripper_moveit_config"
MOCK, SIMULATED, REAL = {}, {"sim_gazebo": "true"}, {"use_fake_hardware": "false", "robot_ip": "10.0.0.7"}
SHARED = (
    "robot_description",
    "robot_description_semantic",
    "robot_description_kinematics",
    "robot_description_planning",
)


def folder() -> Path:
    return Path(rospkg.RosPack().get_path(PACKAGE))


@functools.cache
def _visited(given: tuple[tuple[str, str], ...]) -> LaunchContext:
    context = LaunchContext()
    context.launch_configurations.update(dict(given))

    def visit(entity: Any) -> None:
        for inner in entity.visit(context) or ():
            visit(inner)

    source = PythonLaunchDescriptionSource(str(folder() / "launch" / "demo.launch.py"))
    visit(source.get_launch_description(context))
    for request in context.requests:
        if request.prepare is not None:
            request.prepare(context.parameters.get)
    return context


def launched(given: Mapping[str, str] = MOCK) -> LaunchContext:
    """The file, visited with these arguments, and its nodes prepared."""
    return _visited(tuple(sorted(given.items())))


def parameters(given: Mapping[str, str] = MOCK) -> dict[str, Any]:
    return launched(given).parameters.values()


def programs(given: Mapping[str, str] = MOCK) -> list[str]:
    return [Path(request.command[0]).name for request in launched(given).requests]


def request_of(program: str, given: Mapping[str, str] = MOCK) -> ProcessRequest:
    return next(each for each in launched(given).requests if Path(each.command[0]).name == program)


def leaves(content: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Values by full name; a mapping without entries is a value."""
    found: dict[str, Any] = {}
    for name, value in content.items():
        found |= (
            leaves(value, f"{prefix}/{name}") if isinstance(value, Mapping) and value else {f"{prefix}/{name}": value}
        )
    return found


@pytest.fixture(scope="module")
def configuration() -> MoveItConfigs:
    """What the builder's steps of the file make, without a launch."""
    return (
        MoveItConfigsBuilder("ur5_with_ezgripper", package_name=PACKAGE)
        .robot_description(mappings={"initial_z": "0.86"})
        .trajectory_execution(file_path="config/moveit_controllers.yaml")
        .planning_scene_monitor(publish_robot_description=True, publish_robot_description_semantic=True)
        .planning_pipelines(pipelines=["ompl", "stomp", "pilz_industrial_motion_planner"])
        .to_moveit_configs()
    )


def test_everything_the_file_describes_is_launched_in_its_order() -> None:
    assert programs() == [
        *("rviz", "interactive_goal", "static_transform_publisher", "robot_state_publisher", "move_group", "robot_hw"),
        *("controller_manager", "controller_manager", "controller_manager"),
    ]


def test_move_group_has_the_entire_set_of_parameters_that_was_loaded(configuration: MoveItConfigs) -> None:
    expected, found = leaves(configuration.to_dict(), "/move_group"), parameters()
    assert len(expected) > 100
    assert {name: found.get(name) for name in expected} == expected


def test_what_move_group_says_is_on_the_screen_and_what_rviz_says_in_a_log() -> None:
    on_screen = {Path(request.command[0]).name: request.on_screen for request in launched().requests}
    assert on_screen["move_group"] and on_screen["robot_state_publisher"] and on_screen["robot_hw"]
    assert not on_screen["rviz"] and not on_screen["static_transform_publisher"]


def test_the_file_for_rviz_is_an_argument_with_default_and_description() -> None:
    source = PythonLaunchDescriptionSource(str(folder() / "launch" / "demo.launch.py"))
    description = source.get_launch_description(LaunchContext())
    arguments = {each.name: each for each in description.get_launch_arguments()}
    assert isinstance(arguments["rviz_config"], DeclareLaunchArgument)
    assert "RViz" in arguments["rviz_config"].description
    assert request_of("rviz").command[1:3] == ["-d", str(folder() / "launch" / "moveit.rviz")]


def test_the_file_for_rviz_is_looked_for_in_a_folder_of_a_known_package() -> None:
    own = {"rviz_config": "mine.rviz"}
    assert request_of("rviz", own).command[1:] == ["-d", str(folder() / "launch" / "mine.rviz"), "__name:=rviz2"]


def test_rviz_has_the_sections_it_is_given_and_no_other(configuration: MoveItConfigs) -> None:
    expected = {}
    for section in (
        configuration.robot_description,
        configuration.robot_description_semantic,
        configuration.robot_description_kinematics,
        configuration.planning_pipelines,
        configuration.joint_limits,
    ):
        expected |= leaves(section, "/rviz2")
    assert {name: value for name, value in parameters().items() if name.startswith("/rviz2/")} == expected


def test_rviz_brings_motion_planning_with_a_marker_that_is_dragged() -> None:
    assert "interactive_goal" in programs()
    assert not {"rviz", "interactive_goal"} & set(programs({"use_rviz": "false"}))


def test_a_static_frame_stands_between_the_two_that_are_named() -> None:
    request = request_of("static_transform_publisher")
    assert request.command[1:] == [*"0 0 0 0 0 0 map world".split(), "__name:=static_transform_publisher"]


def test_robot_state_publisher_finds_the_urdf_whose_frames_it_calculates(configuration: MoveItConfigs) -> None:
    urdf = configuration.robot_description["robot_description"]
    assert request_of("robot_state_publisher").environment.get("ROS_NAMESPACE", "/") == "/"
    assert parameters()["/robot_description"] == parameters()["/robot_state_publisher/robot_description"] == urdf


@pytest.mark.parametrize("name", SHARED)
def test_scripts_and_rviz_find_what_move_group_knows_of_the_robot(name: str) -> None:
    values = parameters()
    own = {each.removeprefix("/move_group"): values[each] for each in values if each.startswith(f"/move_group/{name}")}
    assert own and {each: values[each] for each in own} == own


@pytest.mark.parametrize(
    ("given", "program", "hardware"),
    [
        (MOCK, "robot_hw", ["modular_framework_control/MockRobotHW"] * 2),
        (REAL, "robot_hw", ["modular_framework_drivers/UrArmRobotHW", "modular_framework_drivers/EzGripperRobotHW"]),
        (SIMULATED, "simulation", []),
    ],
    ids=["mock", "robot", "simulated"],
)
def test_the_hardware_is_chosen_in_the_urdf_by_arguments_of_its_xacro_file(
    given: Mapping[str, str], program: str, hardware: list[str]
) -> None:
    values = parameters(given)
    assert program in programs(given)
    assert [values[f"/{name}/type"] for name in values.get("/robot_hardware", [])] == hardware
    assert values.get("/use_sim_time") is (True if given == SIMULATED else None)
    assert given != REAL or values["/ur_arm/robot_ip_address"] == "10.0.0.7"


@pytest.mark.parametrize("given", [REAL, SIMULATED], ids=["robot", "simulated"])
def test_whichever_hardware_is_launched_controllers_and_spawners_stay_the_same(given: Mapping[str, str]) -> None:
    def controllers(values: Mapping[str, Any]) -> dict[str, Any]:
        own = ("/joint_state_broadcaster/", "/arm_trajectory_controller/", "/ezgripper_controller/")
        return {name: value for name, value in values.items() if name.startswith(own)}

    def spawners(which: Mapping[str, str]) -> list[list[str]]:
        return [each.command for each in launched(which).requests if each.command[0].endswith("/controller_manager")]

    assert controllers(parameters(given)) == controllers(parameters())
    assert spawners(given) == spawners(MOCK)
    assert [each.name for each in launched(given).requests] == [each.name for each in launched().requests]


def test_a_controller_manager_is_launched_and_then_its_controllers_are_spawned() -> None:
    spawned = [words[-1] for words in (each.command for each in launched().requests) if "spawn" in words]
    assert spawned == ["joint_state_broadcaster", "arm_trajectory_controller", "ezgripper_controller"]
    assert programs().index("robot_hw") < programs().index("controller_manager")


def test_joint_states_arm_and_gripper_have_a_controller_each() -> None:
    values = parameters()
    assert values["/joint_state_broadcaster/type"] == "joint_state_controller/JointStateController"
    assert values["/arm_trajectory_controller/type"] == "position_controllers/JointTrajectoryController"
    assert len(values["/arm_trajectory_controller/joints"]) == 6
    assert values["/ezgripper_controller/type"] == "position_controllers/GripperActionController"


def test_trajectories_are_sent_to_controllers_that_are_spawned() -> None:
    spawned = {words[-1] for words in (each.command for each in launched().requests) if "spawn" in words}
    executing = {entry["name"]: entry["action_ns"] for entry in parameters()["/move_group/controller_list"]}
    assert executing == {
        "arm_trajectory_controller": "follow_joint_trajectory",
        "ezgripper_controller": "gripper_cmd",
    }
    assert set(executing) <= spawned
