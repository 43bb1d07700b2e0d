# SPDX-License-Identifier: BSD-3-Clause
"""What MoveIt 2's tutorial on launch files says about loading a configuration, a test for each thing it says.

The package is made like the tutorial's: an arm of seven joints with a gripper, a xacro file with four arguments, and
files of controllers for MoveIt and for the hardware. The other rules of the builder have their tests beside this file.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from moveit_configs_utils import MoveItConfigs, MoveItConfigsBuilder

from modular_framework_urdf.ros2_control import read_ros2_control

PackageMaker = Callable[..., Path]
PACKAGE = "arm7_with_gripper_moveit_config"
ARGUMENTS = {"robot_ip": "xxx.yyy.zzz.www", "use_fake_hardware": "true", "gripper": "two_fingers", "dof": "7"}
PIPELINES = ["ompl", "stomp", "pilz_industrial_motion_planner"]
URDF = """<robot name="arm7" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="robot_ip" default="none"/>
  <xacro:arg name="use_fake_hardware" default="false"/>
  <xacro:arg name="gripper" default=""/>
  <xacro:arg name="dof" default="6"/>
  <link name="link_0"/>
  <xacro:macro name="joints" params="count">
    <xacro:if value="${count}">
      <link name="link_${count}"/>
      <joint name="joint_${count}" type="continuous">
        <parent link="link_${count - 1}"/><child link="link_${count}"/>
      </joint>
      <xacro:joints count="${count - 1}"/>
    </xacro:if>
  </xacro:macro>
  <xacro:joints count="$(arg dof)"/>
  <xacro:if value="${'$(arg gripper)' != ''}"><link name="$(arg gripper)"/></xacro:if>
  <ros2_control name="arm" type="system"><hardware>
    <xacro:if value="$(arg use_fake_hardware)"><plugin>mock_components/GenericSystem</plugin></xacro:if>
    <xacro:unless value="$(arg use_fake_hardware)">
      <plugin>drivers/Arm7</plugin><param name="robot_ip">$(arg robot_ip)</param>
    </xacro:unless>
  </hardware></ros2_control>
</robot>"""
FILES = {
    ".setup_assistant": "moveit_setup_assistant_config:\n"
    "  urdf: {package: arm7_description, relative_path: robots/arm7.xacro}\n"
    "  srdf: {relative_path: config/arm7.srdf}\n",
    "config/arm7.srdf": '<robot name="arm7"><group name="arm"><joint name="joint_1"/></group></robot>',
    "config/moveit_controllers.yaml": """moveit_simple_controller_manager:
  controller_names: [joint_trajectory_controller, gripper_controller]
  joint_trajectory_controller: {type: FollowJointTrajectory, action_ns: follow_joint_trajectory, joints: [joint_1]}
  gripper_controller: {type: GripperCommand, action_ns: gripper_cmd, joints: [knuckle]}
""",
    "config/ros2_controllers.yaml": "controller_manager: {ros__parameters: {update_rate: 1000}}\n",
}


@pytest.fixture(autouse=True)
def package(make_package: PackageMaker) -> Path:
    """The package, and the one with its URDF."""
    make_package({"robots/arm7.xacro": URDF}, name="arm7_description")
    return make_package(FILES, without=["config/r.urdf", "config/r.srdf"], name=PACKAGE)


def as_in_the_tutorial(mappings: Mapping[str, str] = ARGUMENTS) -> MoveItConfigs:
    return (
        MoveItConfigsBuilder("arm7", package_name=PACKAGE)
        .robot_description(mappings=mappings)
        .trajectory_execution(file_path="config/moveit_controllers.yaml")
        .planning_scene_monitor(publish_robot_description=True, publish_robot_description_semantic=True)
        .planning_pipelines(pipelines=PIPELINES)
        .to_moveit_configs()
    )


def links(configs: MoveItConfigs) -> list[str | None]:
    robot = ElementTree.fromstring(configs.robot_description["robot_description"])
    return [link.get("name") for link in robot.iter("link")]


def test_a_config_package_is_all_that_is_needed_for_what_moveit_requires() -> None:
    parameters = MoveItConfigsBuilder("arm7", package_name=PACKAGE).to_dict()
    assert "<link" in parameters["robot_description"]
    assert "<group" in parameters["robot_description_semantic"]
    assert all(pipeline["planning_plugin"] for pipeline in parameters["planning_pipelines"].values())
    assert parameters["robot_description_kinematics"]["arm"]["kinematics_solver"]
    assert parameters["moveit_controller_manager"] and parameters["controller_list"]
    assert parameters["robot_description_planning"]["joint_limits"]
    assert parameters["planning_scene_monitor"]["publish_planning_scene"]


def test_the_package_is_referred_to_by_its_name_and_the_robot_by_another() -> None:
    configs = as_in_the_tutorial()
    assert configs.package_path is not None and configs.package_path.name == PACKAGE
    assert 'name="arm7"' in configs.robot_description_semantic["robot_description_semantic"]


def test_launch_arguments_are_mapped_to_those_of_the_xacro_file() -> None:
    configs = as_in_the_tutorial()
    assert links(configs) == ["link_0", *(f"link_{number}" for number in range(7, 0, -1)), "two_fingers"]
    (hardware,) = read_ros2_control(configs.robot_description["robot_description"])
    assert hardware.plugin == "mock_components/GenericSystem"


def test_other_values_of_the_same_arguments_are_another_robot() -> None:
    configs = as_in_the_tutorial({**ARGUMENTS, "use_fake_hardware": "false", "gripper": "", "dof": "6"})
    assert links(configs) == ["link_0", *(f"link_{number}" for number in range(6, 0, -1))]
    (hardware,) = read_ros2_control(configs.robot_description["robot_description"])
    assert (hardware.plugin, hardware.parameters) == ("drivers/Arm7", {"robot_ip": "xxx.yyy.zzz.www"})


def test_the_file_of_controllers_is_given_relative_to_the_package() -> None:
    execution = as_in_the_tutorial().trajectory_execution
    assert [(each["name"], each["type"]) for each in execution["controller_list"]] == [
        ("joint_trajectory_controller", "FollowJointTrajectory"),
        ("gripper_controller", "GripperCommand"),
    ]


def test_both_descriptions_are_published_where_the_builder_is_told_so_and_not_otherwise() -> None:
    def published(configs: MoveItConfigs) -> tuple[bool, bool]:
        monitor = configs.planning_scene_monitor["planning_scene_monitor"]
        return monitor["publish_robot_description"], monitor["publish_robot_description_semantic"]

    assert published(as_in_the_tutorial()) == (True, True)
    assert published(MoveItConfigsBuilder("arm7", package_name=PACKAGE).to_moveit_configs()) == (False, False)


def test_the_three_pipelines_of_the_list_are_loaded_and_no_other() -> None:
    loaded = as_in_the_tutorial().planning_pipelines
    assert list(loaded["planning_pipelines"]) == PIPELINES
    assert loaded["default_planning_pipeline"] == "ompl"


def test_what_no_step_asks_for_is_in_the_result_too() -> None:
    configs = as_in_the_tutorial()
    assert configs.robot_description_kinematics["robot_description_kinematics"]["arm"]
    assert configs.joint_limits["robot_description_planning"]["joint_limits"]["j1"] == {"max_velocity": 1.0}
    assert configs.pilz_cartesian_limits["robot_description_planning"]["cartesian_limits"] == {"max_trans_vel": 1.0}


def test_each_section_may_be_given_to_a_node_alone_and_to_dict_is_all_of_them() -> None:
    configs = as_in_the_tutorial()
    everything = configs.to_dict()
    for section in (
        configs.robot_description,
        configs.robot_description_semantic,
        configs.robot_description_kinematics,
        configs.planning_pipelines,
        configs.joint_limits,
    ):
        assert section and _contains(everything, section)


def _contains(whole: Mapping[str, Any], part: Mapping[str, Any]) -> bool:
    """Whether each value of a part is in the whole, under the same names."""
    return all(
        _contains(whole[name], value) if isinstance(value, Mapping) else whole[name] == value
        for name, value in part.items()
    )


def test_the_steps_have_the_names_and_arguments_of_the_public_builder() -> None:
    def arguments(step: Callable[..., Any]) -> list[str]:
        return [name for name in inspect.signature(step).parameters if name != "self"]

    builder = MoveItConfigsBuilder
    assert arguments(builder.__init__) == ["robot_name", "robot_description", "package_name"]
    assert arguments(builder.robot_description) == arguments(builder.robot_description_semantic)
    assert arguments(builder.robot_description) == ["file_path", "mappings"]
    assert arguments(builder.trajectory_execution) == ["file_path", "moveit_manage_controllers"]
    assert arguments(builder.planning_pipelines) == ["default_planning_pipeline", "pipelines", "load_all"]
    for name in ("robot_description_kinematics", "joint_limits", "sensors_3d", "pilz_cartesian_limits", "moveit_cpp"):
        assert arguments(getattr(builder, name)) == ["file_path"]


def test_moveit_cpp_is_not_loaded_unless_its_step_is_called(package: Path) -> None:
    (package / "config/moveit_cpp.yaml").write_text("plan_request_params: {planning_attempts: 3}\n")
    assert "plan_request_params" not in as_in_the_tutorial().to_dict()
    called = MoveItConfigsBuilder("arm7", package_name=PACKAGE).moveit_cpp().to_dict()
    assert called["plan_request_params"] == {"planning_attempts": 3}
