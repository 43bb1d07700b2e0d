# SPDX-License-Identifier: BSD-3-Clause
"""Launch files say with which xacro arguments a description is expanded."""

from __future__ import annotations

from pathlib import Path

import pytest

from modular_framework_urdf.launch_arguments import launch_files, xacro_arguments
from modular_framework_urdf.xml_text import parse


def arguments(*commands: str, **values: str) -> dict[str, str]:
    roots = [parse(f'<launch><group><param name="d" command="{each}"/></group></launch>', "f") for each in commands]
    return xacro_arguments(roots, "robot.srdf.xacro", values)


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ("xacro $(find pkg)/robot.srdf.xacro hand:=true side:=left", {"hand": "true", "side": "left"}),
        ("$(find xacro)/xacro --inorder '$(find pkg)/robot.srdf.xacro' hand:=$(arg gripper)", {"hand": "yes"}),
        ("xacro robot.srdf.xacro at:='1 2 3' prefix:=$(arg empty) hand:=x", {"at": "1 2 3", "prefix": "", "hand": "x"}),
        ("xacro robot.srdf.xacro a:=$(arg lost) b:=$(eval arg('lost') + 1) c:=$(optenv C x)_d e:=5", {"e": "5"}),
        ("xacro robot.srdf.xacro a:='1", {}),
        ("xacro other.srdf.xacro hand:=true", {}),
    ],
)
def test_the_words_of_the_command_that_expands_the_file_count_as_in_a_shell(
    command: str, expected: dict[str, str]
) -> None:
    assert arguments(command, gripper="yes", empty="") == expected


def test_of_several_values_the_first_counts() -> None:
    assert arguments("xacro robot.srdf.xacro a:=1", "xacro robot.srdf.xacro a:=2 b:=3") == {"a": "1", "b": "3"}


def test_files_that_load_the_robot_come_first(tmp_path: Path) -> None:
    (tmp_path / "launch").mkdir()
    for name in ("demo.launch", "planning_context.launch", "move_group.launch", "a.launch.xml", "demo.launch.py"):
        (tmp_path / "launch" / name).touch()
    names = [path.name for path in launch_files(tmp_path)]
    assert names == ["move_group.launch", "planning_context.launch", "a.launch.xml", "demo.launch"]
    assert launch_files(tmp_path / "launch") == []
