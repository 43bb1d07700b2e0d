# SPDX-License-Identifier: BSD-3-Clause
"""URDF and SRDF are found by the rules of MoveIt 2's builder, and expanded with the arguments given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from launch_param_builder import ParameterBuilderFileNotFoundError, ParameterFileError
from moveit_configs_utils import MoveItConfigsBuilder

PackageMaker = Callable[..., Path]
SETUP = """moveit_setup_assistant_config:
  {urdf}:
    package: {package}
    relative_path: urdf/robot.urdf.xacro
    xacro_args: "{arguments}"
  {srdf}:
    relative_path: config/other.srdf
"""
OTHER_SRDF = '<robot name="r"><group name="other"/></robot>'


def urdf(origin: str) -> str:
    return (
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        '<xacro:arg name="tool" default="no_tool"/><xacro:arg name="side" default="no_side"/>'
        f'<link name="{origin}"/><link name="$(arg tool)"/><link name="$(arg side)"/></robot>'
    )


def setup(package: str = "r_description", arguments: str = "", upper: bool = False) -> dict[str, str]:
    keys = ("URDF", "SRDF") if upper else ("urdf", "srdf")
    text = SETUP.format(urdf=keys[0], srdf=keys[1], package=package, arguments=arguments)
    return {".setup_assistant": text, "config/other.srdf": OTHER_SRDF}


def links(parameters: dict[str, str], name: str = "robot_description") -> list[str | None]:
    return [link.get("name") for link in ElementTree.fromstring(parameters[name]).iter("link")]


def groups(parameters: dict[str, str], name: str = "robot_description_semantic") -> list[str | None]:
    return [group.get("name") for group in ElementTree.fromstring(parameters[name]).iter("group")]


@pytest.fixture
def described(make_package: PackageMaker) -> Path:
    """A package with the URDF that `.setup_assistant` of others names."""
    return make_package({"urdf/robot.urdf.xacro": urdf("described")}, name="r_description")


def test_the_package_is_called_after_the_robot_unless_it_is_named(make_package: PackageMaker) -> None:
    folder = make_package()
    assert MoveItConfigsBuilder("r").to_moveit_configs().package_path == folder
    folder = make_package(name="planning_of_r")
    assert MoveItConfigsBuilder("r", package_name="planning_of_r").to_moveit_configs().package_path == folder


def test_a_package_that_is_not_there_is_named_with_similar_ones(make_package: PackageMaker) -> None:
    make_package()
    with pytest.raises(ParameterFileError, match="'rr_moveit_config' on ROS_PACKAGE_PATH.*r_moveit_config"):
        MoveItConfigsBuilder("rr")


def test_the_urdf_of_the_package_comes_before_that_of_setup_assistant(
    make_package: PackageMaker, described: Path
) -> None:
    make_package({**setup(), "config/r.urdf.xacro": urdf("own")})
    assert links(MoveItConfigsBuilder("r").to_moveit_configs().robot_description)[0] == "own"


@pytest.mark.parametrize("upper", [False, True])
def test_setup_assistant_names_urdf_and_srdf_in_both_spellings(
    make_package: PackageMaker, described: Path, upper: bool, caplog: pytest.LogCaptureFixture
) -> None:
    make_package(setup(upper=upper))
    configs = MoveItConfigsBuilder("r").to_moveit_configs()
    assert links(configs.robot_description)[0] == "described"
    assert groups(configs.robot_description_semantic) == ["other"]
    assert "URDF" not in caplog.text
    assert "SRDF" not in caplog.text


def test_arguments_of_setup_assistant_also_count_for_the_urdf_of_the_package(
    make_package: PackageMaker, described: Path
) -> None:
    make_package({**setup(arguments="tool:=hand --inorder  side:='left one'"), "config/r.urdf.xacro": urdf("own")})
    assert links(MoveItConfigsBuilder("r").to_moveit_configs().robot_description) == ["own", "hand", "left one"]


def test_arguments_of_setup_assistant_may_be_those_of_the_launch_files(
    make_package: PackageMaker, described: Path
) -> None:
    launch = {"launch/planning_context.launch": '<launch><arg name="hand" default="claw"/></launch>'}
    make_package({**setup(arguments="tool:=$(arg hand) side:=$(arg side) speed:=$(optenv SPEED 1)"), **launch})
    assert links(MoveItConfigsBuilder("r").to_moveit_configs().robot_description) == ["described", "claw", "no_side"]


def test_mappings_take_the_place_of_the_arguments_of_setup_assistant(
    make_package: PackageMaker, described: Path
) -> None:
    make_package(setup(arguments="tool:=hand"))
    configs = MoveItConfigsBuilder("r").robot_description(mappings={"side": "left"}).to_moveit_configs()
    assert links(configs.robot_description) == ["described", "no_tool", "left"]


def test_mappings_may_be_numbers_and_truth_values(make_package: PackageMaker) -> None:
    make_package({"config/r.urdf.xacro": urdf("own")})
    configs = MoveItConfigsBuilder("r").robot_description(mappings={"side": 2, "tool": True}).to_moveit_configs()
    assert links(configs.robot_description) == ["own", "true", "2"]


def test_without_a_hint_the_files_of_the_robots_name_are_taken_with_a_warning(
    make_package: PackageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    folder = make_package()
    configs = MoveItConfigsBuilder("r").to_moveit_configs()
    assert links(configs.robot_description) == ["plain"]
    assert groups(configs.robot_description_semantic) == ["arm"]
    looked_for = f"{folder}: no URDF found (looked for config/r.urdf.xacro and section URDF of .setup_assistant)"
    assert f"{looked_for}; using config/r.urdf" in caplog.text
    assert f"{folder}: no SRDF found (looked for section SRDF of .setup_assistant); using config/r.srdf" in caplog.text


@pytest.mark.parametrize("path", ["urdf/mine.urdf", None])
def test_a_file_may_be_named_relative_to_the_package_or_absolutely(
    make_package: PackageMaker, path: str | None
) -> None:
    folder = make_package({"urdf/mine.urdf": urdf("mine")})
    builder = MoveItConfigsBuilder("r").robot_description(file_path=path or folder / "urdf/mine.urdf")
    assert links(builder.to_moveit_configs().robot_description)[0] == "mine"


def test_a_missing_urdf_is_a_warning_since_somebody_else_may_set_it(
    make_package: PackageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    folder = make_package(without=["config/r.urdf"])
    configs = MoveItConfigsBuilder("r").to_moveit_configs()
    assert configs.robot_description == {}
    assert "robot_description" not in configs.to_dict()
    assert f"File {folder}/config/r.urdf doesn't exist; {folder}/config has" in caplog.text
    assert "another node has to set the parameter robot_description" in caplog.text


def test_a_missing_srdf_is_an_error_that_lists_what_is_there(make_package: PackageMaker) -> None:
    make_package({"config/s.srdf": OTHER_SRDF}, without=["config/r.srdf"])
    with pytest.raises(ParameterBuilderFileNotFoundError, match=r"config/r.srdf doesn't exist; .*s.srdf"):
        MoveItConfigsBuilder("r").to_moveit_configs()


def test_a_missing_package_of_the_urdf_is_named_when_it_is_needed(make_package: PackageMaker) -> None:
    make_package({**setup(package="lost_description"), "config/mine.urdf": urdf("mine")})
    builder = MoveItConfigsBuilder("r").robot_description("config/mine.urdf")
    assert links(builder.to_moveit_configs().robot_description)[0] == "mine"
    with pytest.raises(ParameterFileError, match="no ROS package 'lost_description'"):
        MoveItConfigsBuilder("r").to_moveit_configs()


def test_a_urdf_outside_every_package_is_named_by_its_path(make_package: PackageMaker, tmp_path: Path) -> None:
    path = tmp_path / "elsewhere.urdf"
    path.write_text(urdf("elsewhere"))
    config = f"moveit_setup_assistant_config: {{URDF: {{package: '', relative_path: {path}}}}}"
    make_package({".setup_assistant": config})
    assert links(MoveItConfigsBuilder("r").to_moveit_configs().robot_description)[0] == "elsewhere"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("moveit_setup_assistant_config: [1]", r"moveit_setup_assistant_config is \[1\]; expected a mapping"),
        ("moveit_setup_assistant_config: {urdf: {package: p}}", "urdf has package; expected package and relative"),
        (
            "moveit_setup_assistant_config: {urdf: {package: p, relative_path: u, xacro_args: 'a:=1 b'}}",
            "xacro_args has 'b'; expected arguments name:=value",
        ),
        ("moveit_setup_assistant_config: [", r"\.setup_assistant:1:\d+: is not valid YAML"),
    ],
)
def test_a_faulty_setup_assistant_file_is_named_with_what_is_needed(
    make_package: PackageMaker, text: str, message: str
) -> None:
    make_package({".setup_assistant": text})
    with pytest.raises(ParameterFileError, match=message):
        MoveItConfigsBuilder("r")


def test_the_srdf_may_be_a_xacro_file_with_mappings(make_package: PackageMaker) -> None:
    make_package()
    configs = MoveItConfigsBuilder("r").robot_description_semantic("config/r.srdf", {"group": "leg"})
    assert groups(configs.to_moveit_configs().robot_description_semantic) == ["leg"]


PLANNING_CONTEXT = """<launch>
  <arg name="load_gripper" default="true"/>
  <param name="semantic" command="xacro $(find r)/config/other.srdf tool:=$(arg load_gripper) side:=l"/>
</launch>"""
XACRO_SRDF = (
    '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="tool" default="none"/>'
    '<xacro:arg name="side" default="none"/><group name="$(arg tool)"/><group name="$(arg side)"/></robot>'
)


@pytest.mark.parametrize(
    ("arguments", "launch", "mappings", "expected"),
    [
        ("", False, None, ["none", "none"]),
        ("", True, None, ["true", "l"]),
        ("tool:=hand", True, None, ["hand", "l"]),
        ("tool:=hand", True, {"side": "right"}, ["none", "right"]),
    ],
)
def test_the_srdf_is_expanded_as_the_urdf_and_as_the_launch_files_of_its_package_do(
    make_package: PackageMaker,
    described: Path,
    arguments: str,
    launch: bool,
    mappings: dict[str, str] | None,
    expected: list[str],
) -> None:
    files = {**setup(arguments=arguments), "config/other.srdf": XACRO_SRDF}
    make_package({**files, **({"launch/planning_context.launch": PLANNING_CONTEXT} if launch else {})})
    builder = MoveItConfigsBuilder("r")
    configs = (builder.robot_description(mappings=mappings) if mappings else builder).to_moveit_configs()
    assert groups(configs.robot_description_semantic) == expected


def test_mappings_of_the_srdf_alone_count_for_it(make_package: PackageMaker, described: Path) -> None:
    launch = {"launch/planning_context.launch": PLANNING_CONTEXT}
    make_package({**setup(arguments="tool:=hand"), **launch, "config/other.srdf": XACRO_SRDF})
    builder = MoveItConfigsBuilder("r").robot_description(mappings={"tool": "vacuum"})
    configs = builder.robot_description_semantic(mappings={"side": "right"}).to_moveit_configs()
    assert groups(configs.robot_description_semantic) == ["none", "right"]


def test_where_only_the_xacro_file_of_the_srdf_exists_it_is_taken_with_a_warning(
    make_package: PackageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    folder = make_package({"config/r.srdf.xacro": OTHER_SRDF}, without=["config/r.srdf"])
    assert groups(MoveItConfigsBuilder("r").to_moveit_configs().robot_description_semantic) == ["other"]
    assert f"File {folder}/config/r.srdf doesn't exist; using {folder}/config/r.srdf.xacro" in caplog.text


def test_another_name_of_the_description_is_that_of_all_four_parameters(make_package: PackageMaker) -> None:
    make_package()
    parameters = MoveItConfigsBuilder("r", robot_description="left").to_moveit_configs().to_dict()
    assert links(parameters, "left") == ["plain"]
    assert groups(parameters, "left_semantic") == ["arm"]
    assert parameters["left_kinematics"]["arm"]["kinematics_solver"]
    assert parameters["left_planning"]["joint_limits"]["j1"]["max_velocity"] == 1.0
    assert parameters["left_planning"]["cartesian_limits"]["max_trans_vel"] == 1.0
    assert not [name for name in parameters if name.startswith("robot_description")]
