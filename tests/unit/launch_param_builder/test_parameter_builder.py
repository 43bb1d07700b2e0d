# SPDX-License-Identifier: BSD-3-Clause
"""Parameters are collected from the files of a package; what cannot be read is named."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from launch_param_builder import (
    ParameterBuilder,
    ParameterBuilderFileNotFoundError,
    ParameterFileError,
    get_path,
    load_file,
    load_xacro,
    load_yaml,
)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "small_robot"
    folder.mkdir()
    (folder / "package.xml").write_text("<package><name>small_robot</name></package>")
    (folder / "rates.yaml").write_text("rate: 50\nlimits: {speed: 0.5}\n")
    (folder / "robot.xacro").write_text(
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        '<xacro:arg name="tool" default="none"/><link name="$(arg tool)"/></robot>'
    )
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    return folder


def test_steps_add_up_to_one_dictionary(package: Path) -> None:
    parameters = (
        ParameterBuilder("small_robot")
        .yaml("rates.yaml")
        .yaml("rates.yaml", parameter_namespace="servo")
        .parameter("frame", "world")
        .file_parameter("text", "rates.yaml")
        .path_parameter("path", "rates.yaml")
        .xacro_parameter("robot_description", "robot.xacro", mappings={"tool": "hand"})
        .to_dict()
    )
    assert parameters["rate"] == 50
    assert parameters["servo"] == {"rate": 50, "limits": {"speed": 0.5}}
    assert parameters["frame"] == "world"
    assert parameters["text"].startswith("rate: 50")
    assert parameters["path"] == get_path("small_robot", "rates.yaml") == str(package / "rates.yaml")
    assert 'name="hand"' in parameters["robot_description"]


def test_a_package_that_is_not_there_is_named_with_similar_ones(package: Path) -> None:
    with pytest.raises(ParameterFileError, match="'smal_robot'.*small_robot.*setup.bash"):
        ParameterBuilder("smal_robot")


def test_angles_are_read_as_rosparam_reads_them(tmp_path: Path) -> None:
    path = tmp_path / "angles.yaml"
    path.write_text("a: !degrees 180\nb: deg(-90)\nc: !radians 2*pi\nd: rad(pi/2 + 1)\ne: degree\n")
    expected = {"a": math.pi, "b": -math.pi / 2, "c": 2 * math.pi, "d": math.pi / 2 + 1, "e": "degree"}
    assert load_yaml(path) == pytest.approx(expected)


@pytest.mark.parametrize("text", ["rad(__import__)", "!degrees foo", "!degrees 1/0", "deg(1 if 1 else 2)"])
def test_an_angle_that_is_no_sum_of_numbers_is_refused_and_not_executed(tmp_path: Path, text: str) -> None:
    path = tmp_path / "angles.yaml"
    path.write_text(f"ok: 1\nangle: {text}\n")
    with pytest.raises(ParameterFileError, match=r"angles.yaml:2:8: .*is not an angle; allowed: numbers, pi"):
        load_yaml(path)


def test_values_are_those_a_parameter_server_holds(tmp_path: Path) -> None:
    path = tmp_path / "values.yaml"
    path.write_text("empty:\n1: one\nday: 2020-01-01\nlist: [1, null, {a: null}]\n")
    assert load_yaml(path) == {"1": "one", "day": "2020-01-01", "list": [1, {}]}
    path.write_text("# nothing\n")
    assert load_yaml(path) == {}


def test_a_yaml_file_that_is_not_valid_or_no_mapping_is_named_with_the_line(tmp_path: Path) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text("a: 1\nb: [1, 2\nc: 3\n")
    with pytest.raises(ParameterFileError, match=r"broken.yaml:3:\d+: is not valid YAML"):
        load_yaml(path)
    path.write_text("- a\n")
    with pytest.raises(ParameterFileError, match="broken.yaml:1: contains a list; it must be a mapping"):
        load_yaml(path)


def test_a_missing_file_is_named_with_what_is_there(package: Path) -> None:
    with pytest.raises(ParameterBuilderFileNotFoundError) as caught:
        load_file(package / "rate.yaml")
    assert str(caught.value) == (
        f"File {package / 'rate.yaml'} doesn't exist; {package} has package.xml, rates.yaml, robot.xacro"
    )
    with pytest.raises(ParameterBuilderFileNotFoundError, match="is a folder"):
        load_file(package)


def test_faults_of_xacro_name_the_file(tmp_path: Path) -> None:
    path = tmp_path / "robot.xacro"
    path.write_text('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="${nothing}"/></robot>')
    with pytest.raises(ParameterFileError, match="robot.xacro: xacro cannot expand it: name 'nothing' is not defined"):
        load_xacro(path)
    path.write_text("<robot>\n<link>")
    with pytest.raises(ParameterFileError, match=r"robot.xacro: is not valid XML: .*line 2"):
        load_xacro(path)
