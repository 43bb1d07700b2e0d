# SPDX-License-Identifier: BSD-3-Clause
"""Mappings that are substitutions are looked up when the launch file runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from launch import LaunchContext
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, TextSubstitution
from launch_param_builder import ParameterBuilderFileNotFoundError
from launch_ros.parameter_descriptions import ParameterValue
from moveit_configs_utils import MoveItConfigsBuilder
from moveit_configs_utils.substitutions import Xacro

PackageMaker = Callable[..., Path]
ROBOT = (
    '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="tool" default="none"/>'
    '<xacro:arg name="left_side" default="none"/><link name="$(arg tool)"/><link name="$(arg left_side)"/></robot>'
)


@pytest.fixture
def context() -> LaunchContext:
    context = LaunchContext()
    context.launch_configurations.update({"tool": "hand", "side": "left", "file": "robot.xacro"})
    return context


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    (tmp_path / "robot.xacro").write_text(ROBOT)
    return tmp_path / "robot.xacro"


def links(text: str) -> list[str | None]:
    return [link.get("name") for link in ElementTree.fromstring(text).iter("link")]


def test_file_names_and_values_may_be_made_of_substitutions(robot: Path, context: LaunchContext) -> None:
    xacro = Xacro(
        PathJoinSubstitution([str(robot.parent), LaunchConfiguration("file")]),
        mappings={
            "tool": [LaunchConfiguration("tool"), "_2"],
            (LaunchConfiguration("side"), "_side"): LaunchConfiguration("side"),
        },
    )
    assert links(xacro.perform(context)) == ["hand_2", "left"]


def test_a_file_alone_is_expanded_with_its_defaults(robot: Path, context: LaunchContext) -> None:
    assert links(Xacro(str(robot)).perform(context)) == ["none", "none"]


def test_it_describes_file_and_mappings(robot: Path) -> None:
    text = Xacro(TextSubstitution(text="robot.xacro"), mappings={"tool": LaunchConfiguration("tool")}).describe()
    assert "robot.xacro" in text
    assert "tool" in text


def test_a_missing_file_is_named_when_it_is_expanded(tmp_path: Path, context: LaunchContext) -> None:
    with pytest.raises(ParameterBuilderFileNotFoundError, match="lost.xacro"):
        Xacro(str(tmp_path / "lost.xacro")).perform(context)


def test_the_builder_leaves_substitutions_of_urdf_and_srdf_to_the_launch(
    make_package: PackageMaker, context: LaunchContext
) -> None:
    make_package({"config/r.urdf.xacro": ROBOT})
    parameters = (
        MoveItConfigsBuilder("r")
        .robot_description(mappings={"tool": LaunchConfiguration("tool"), "left_side": 2})
        .robot_description_semantic(mappings={"group": LaunchConfiguration("side")})
        .to_dict()
    )
    urdf, srdf = parameters["robot_description"], parameters["robot_description_semantic"]
    assert isinstance(urdf, ParameterValue)
    assert links(urdf.evaluate(context)) == ["hand", "2"]
    assert [group.get("name") for group in ElementTree.fromstring(srdf.evaluate(context)).iter("group")] == ["left"]
    assert parameters["planning_pipelines"]["ompl"]


def test_a_missing_urdf_is_named_before_the_launch(
    make_package: PackageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    make_package(without=["config/r.urdf"])
    builder = MoveItConfigsBuilder("r").robot_description(mappings={"tool": LaunchConfiguration("tool")})
    assert "robot_description" not in builder.to_dict()
    assert "config/r.urdf doesn't exist" in caplog.text
