# SPDX-License-Identifier: BSD-3-Clause
"""Arguments of a launch file that passes its own on to another one."""

from __future__ import annotations

from pathlib import Path

import pytest
import roslaunch.core

from modular_framework_core.launching.launch_arguments import argument_values, check_arguments, known_arguments


@pytest.fixture
def robot(tmp_path: Path) -> str:
    (tmp_path / "start.launch").write_text(
        """<launch><arg name="hand" default="one" doc="the hand"/><arg name="gui" default="true"/>
        <arg name="method" default="$(eval 'grasps of ' + arg('hand'))"/><arg name="text" default=""/></launch>"""
    )
    file = tmp_path / "robot.launch"
    file.write_text(
        f"""<launch><arg name="hand" default="two"/><arg name="text" default="z:=0.86"/>
        <include file="{tmp_path}/start.launch" pass_all_args="true"/></launch>"""
    )
    return str(file)


def test_it_has_the_arguments_of_both_files_and_its_own_defaults(robot: str) -> None:
    assert set(known_arguments(robot)) == {"hand", "gui", "method", "text"}
    values = argument_values(robot, ["gui:=false"])
    assert values == {"hand": "two", "gui": "false", "method": "grasps of two", "text": "z:=0.86"}


def test_an_argument_of_neither_and_a_wrong_value_are_refused(robot: str) -> None:
    check_arguments(robot, ["gui:=false", "hand:=three"])
    with pytest.raises(roslaunch.core.RLException, match="unknown argument 'guy'; did you mean 'gui'"):
        check_arguments(robot, ["guy:=false"])
    with pytest.raises(roslaunch.core.RLException, match="'gui' is 'no'; it must be true or false"):
        check_arguments(robot, ["gui:=no"])
