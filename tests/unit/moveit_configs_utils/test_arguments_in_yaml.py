# SPDX-License-Identifier: BSD-3-Clause
"""YAML files of MoveIt 1 that hold `$(arg NAME)` are filled in as the package's launch files would."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from moveit_configs_utils import MoveItConfigsBuilder

PackageMaker = Callable[..., Path]
FILES = {
    "config/kinematics.yaml": "$(arg arm_id)_arm: {kinematics_solver: kdl_kinematics_plugin/KDLKinematicsPlugin}\n",
    "config/joint_limits.yaml": "joint_limits: {$(arg arm_id)_joint1: {max_velocity: 2.0}}\n",
    "config/moveit_controllers.yaml": "controller_list: [{name: $(arg arm_id), joints: ['$(arg arm_id)_joint1']}]\n",
    "config/ompl_planning.yaml": "planning_plugin: ompl_interface/OMPLPlanner\n$(arg arm_id)_arm: {longest: 1}\n",
    "launch/demo.launch": '<launch><arg name="arm_id" default="other"/></launch>',
    "launch/planning_context.launch": '<launch><arg name="arm_id" default="panda"/></launch>',
}


def names(builder: MoveItConfigsBuilder) -> tuple[Any, ...]:
    parameters = builder.planning_pipelines(pipelines=["ompl"]).to_dict()
    return (
        *parameters["robot_description_kinematics"],
        *parameters["robot_description_planning"]["joint_limits"],
        parameters["controller_list"][0]["name"],
        parameters["controller_list"][0]["joints"][0],
        *(name for name in parameters["planning_pipelines"]["ompl"] if name.endswith("_arm")),
    )


def expected(robot: str) -> tuple[str, ...]:
    return f"{robot}_arm", f"{robot}_joint1", robot, f"{robot}_joint1", f"{robot}_arm"


def test_defaults_come_from_the_launch_files_that_load_the_robot_first(make_package: PackageMaker) -> None:
    make_package(FILES)
    assert names(MoveItConfigsBuilder("r")) == expected("panda")


def test_arguments_of_setup_assistant_and_then_mappings_come_before_them(make_package: PackageMaker) -> None:
    urdf = {"config/r.urdf.xacro": '<robot name="r"><link name="a"/></robot>'}
    setup = "moveit_setup_assistant_config: {urdf: {package: p, relative_path: u, xacro_args: 'arm_id:=fr3'}}"
    make_package({**FILES, **urdf, ".setup_assistant": setup})
    assert names(MoveItConfigsBuilder("r")) == expected("fr3")
    assert names(MoveItConfigsBuilder("r").robot_description(mappings={"arm_id": "left"})) == expected("left")


def test_an_argument_without_a_value_stays_with_a_warning(
    make_package: PackageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    launch_files = [name for name in FILES if name.startswith("launch/")]
    folder = make_package(FILES, without=launch_files)
    assert names(MoveItConfigsBuilder("r")) == expected("$(arg arm_id)")
    assert f"{folder}/config/kinematics.yaml: no value for $(arg arm_id) (xacro arguments" in caplog.text


def test_a_launch_file_that_is_no_xml_is_a_warning(
    make_package: PackageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    folder = make_package({**FILES, "launch/broken.launch": "<launch>"})
    assert names(MoveItConfigsBuilder("r")) == expected("panda")
    assert f"{folder}/launch/broken.launch: the defaults of its arguments are unknown" in caplog.text
