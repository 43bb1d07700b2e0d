# SPDX-License-Identifier: BSD-3-Clause
"""The launch helpers start what MoveIt 2's start, with their arguments; what ROS 1 has not is refused by name."""

from pathlib import Path

import pytest
from launch import LaunchContext, LaunchDescription
from moveit_configs_utils import MoveItConfigs, launches

URDF = (
    "<robot name='r'><link name='base'/><link name='tip'/><joint name='a' type='continuous'><parent link='base'/>"
    "<child link='tip'/><axis xyz='0 0 1'/></joint></robot>"
)
SRDF = (
    "<robot name='r'><virtual_joint name='v' type='fixed' parent_frame='world' child_link='base'/>"
    "<virtual_joint name='w' type='fixed' parent_frame='base' child_link='base'/></robot>"
)
ARM = {"name": "arm", "type": "FollowJointTrajectory", "action_ns": "follow_joint_trajectory", "joints": ["a"]}


@pytest.fixture
def configs(tmp_path: Path) -> MoveItConfigs:
    return MoveItConfigs(
        package_path=tmp_path,
        robot_description={"robot_description": URDF},
        robot_description_semantic={"robot_description_semantic": SRDF},
        trajectory_execution={
            "controller_list": [ARM],
            "moveit_controller_manager": "moveit_simple_controller_manager/MoveItSimpleControllerManager",
            "moveit_simple_controller_manager": {"controller_names": ["arm"]},
        },
    )


def visited(description: LaunchDescription, **given: str) -> LaunchContext:
    context = LaunchContext()
    context.launch_configurations.update(given)

    def visit(entity) -> None:
        for inner in entity.visit(context) or ():
            visit(inner)

    visit(description)
    return context


def commands(context: LaunchContext) -> list[list[str]]:
    return [[Path(request.command[0]).name, *request.command[1:]] for request in context.requests]


def test_robot_state_publisher_gets_description_and_rate(configs: MoveItConfigs) -> None:
    context = visited(launches.generate_rsp_launch(configs), publish_frequency="30")
    values = context.parameters.values()
    assert values["/robot_description"] == URDF
    assert values["/robot_state_publisher/publish_frequency"] == 30.0
    assert context.requests[0].respawn


def test_rviz_gets_the_file_of_the_package(configs: MoveItConfigs, tmp_path: Path) -> None:
    (tmp_path / "launch").mkdir()
    (tmp_path / "launch" / "moveit.rviz").touch()
    rviz, marker = commands(visited(launches.generate_moveit_rviz_launch(configs)))
    assert rviz[:3] == ["rviz", "-d", str(tmp_path / "launch" / "moveit.rviz")]
    assert marker[0] == "interactive_goal"


def test_a_virtual_joint_between_two_frames_is_a_static_transform(configs: MoveItConfigs) -> None:
    context = visited(launches.generate_static_virtual_joint_tfs_launch(configs))
    positional = "0 0 0 0 0 0 world base".split()
    assert commands(context) == [["static_transform_publisher", *positional, "__name:=static_transform_publisher0"]]


def test_the_controllers_of_the_configuration_are_spawned(configs: MoveItConfigs) -> None:
    spawned = [words[-1] for words in commands(visited(launches.generate_spawn_controllers_launch(configs)))]
    assert spawned == ["arm", "joint_state_broadcaster"]


def test_move_group_has_the_settings_of_its_arguments(configs: MoveItConfigs) -> None:
    description = launches.generate_move_group_launch(configs)
    context = visited(description, debug="true", publish_monitored_planning_scene="false", capabilities="a/B")
    values = context.parameters.values()
    assert values["/move_group/controller_list"] == [ARM]
    assert values["/move_group/capabilities"] == "a/B"
    assert values["/move_group/allow_trajectory_execution"] is True
    assert values["/move_group/planning_scene_monitor/publish_planning_scene"] is False
    assert [words[1] for words in commands(context)] == ["--debug"]


@pytest.mark.parametrize("name", ["monitor_dynamics", "db"])
def test_an_argument_that_does_nothing_here_is_refused_by_name(configs: MoveItConfigs, name: str) -> None:
    generate = launches.generate_demo_launch if name == "db" else launches.generate_move_group_launch
    with pytest.raises(RuntimeError, match=f"argument '{name}' is 'true'; allowed: false"):
        visited(generate(configs), **{name: "true"})


@pytest.mark.parametrize("generate", [launches.generate_warehouse_db_launch, launches.generate_setup_assistant_launch])
def test_a_helper_that_does_nothing_here_is_refused_by_name(configs: MoveItConfigs, generate) -> None:
    with pytest.raises(RuntimeError, match=f"{generate.__name__} is not supported: there is no"):
        generate(configs)


def test_the_demonstration_starts_everything_on_mock_hardware(configs: MoveItConfigs) -> None:
    context = visited(launches.generate_demo_launch(configs), use_rviz="false")
    programs = [words[0] for words in commands(context)]
    assert programs == [
        *("static_transform_publisher", "robot_state_publisher", "move_group", "robot_hw"),
        *("controller_manager", "controller_manager"),
    ]
    for request in context.requests:
        if request.prepare is not None:
            request.prepare(context.parameters.get)
    values = context.parameters.values()
    assert values["/arm/type"] == "position_controllers/JointTrajectoryController"
    assert values["/joint_state_broadcaster/type"] == "joint_state_controller/JointStateController"
    assert values["/controller_manager/joints"] == ["a"]


def test_launch_files_of_the_package_take_the_place_of_the_helpers(configs: MoveItConfigs, tmp_path: Path) -> None:
    (tmp_path / "launch").mkdir()
    (tmp_path / "launch" / "rsp.launch.py").write_text(
        "from launch import LaunchDescription\nfrom launch.actions import SetLaunchConfiguration\n"
        "def generate_launch_description():\n    return LaunchDescription([SetLaunchConfiguration('own', 'yes')])\n"
    )
    context = visited(launches.generate_demo_launch(configs), use_rviz="false")
    assert context.launch_configurations["own"] == "yes"
    assert "robot_state_publisher" not in [words[0] for words in commands(context)]


def test_fake_controllers_of_moveit_1_need_no_hardware(configs: MoveItConfigs) -> None:
    configs.trajectory_execution["moveit_controller_manager"] = (
        "moveit_fake_controller_manager/MoveItFakeControllerManager"
    )
    context = visited(launches.generate_demo_launch(configs), use_rviz="false")
    programs = [words[0] for words in commands(context)]
    assert "joint_state_publisher" in programs and "robot_hw" not in programs
    assert context.parameters.values()["/joint_state_publisher/source_list"] == [
        "move_group/fake_controller_joint_states"
    ]


def test_a_controller_that_mock_hardware_cannot_have_is_named(configs: MoveItConfigs) -> None:
    configs.trajectory_execution["controller_list"] = [{"name": "odd", "type": "Odd", "joints": ["a"]}]
    with pytest.raises(RuntimeError, match="ros2_controllers.yaml is missing, and controller 'odd' .* type 'Odd'"):
        visited(launches.generate_demo_launch(configs), use_rviz="false")
