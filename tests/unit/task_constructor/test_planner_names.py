# SPDX-License-Identifier: BSD-3-Clause
"""Planners that a task names are checked before the task runs."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from modular_framework_core.launching.ros_installed_planners import installed_planners
from modular_framework_core.task_constructor.known_names import PlannerNames
from modular_framework_core.task_constructor.pipeline import main
from modular_framework_testing.ros_session import executable

TASK = """name: tiny
source: framework_state_machine
outcomes: [done, gave_up]
states:
  - A: {source: set_planner, %s, transitions: {success: done, fail: gave_up}}
"""
PLANNERS = PlannerNames({"ompl": ("RRT", "RRTConnect"), "pilz": ("LIN",), "own": ()})


@pytest.fixture()
def script(tmp_path: Path) -> Path:
    return tmp_path / "tiny.yaml"


@pytest.mark.parametrize("name", ["RRT", "ompl/RRT", "pilz/LIN", "own/anything"])
def test_planners_that_exist_are_taken(script: Path, name: str) -> None:
    script.write_text(TASK % f"planner_id: {name}")
    assert main([str(script), "--check"], lambda package: PLANNERS) == 0


@pytest.mark.parametrize(
    ("name", "meant"), [("RTT", "RRT"), ("ompl/RTT", "ompl/RRT"), ("omple/RRT", "ompl/RRT"), ("pilz/RRT", "ompl/RRT")]
)
def test_planners_that_do_not_exist_are_refused_with_the_nearest_name(
    script: Path, name: str, meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    script.write_text(TASK % f"planner_id: {name}")
    assert main([str(script), "--check"], lambda package: PLANNERS) == 1
    message = capsys.readouterr().err
    assert f"{script}:5:" in message and f"the planner '{name}' is unknown" in message
    assert message.rstrip().endswith(f"did you mean '{meant}'?")


def test_a_task_without_planner_needs_no_list_of_planners(script: Path) -> None:
    script.write_text(TASK % "planning_time: 2.0")
    assert main([str(script), "--check"], lambda package: pytest.fail("the planners were searched")) == 0


def test_the_planners_of_a_configuration_package_are_those_of_its_pipelines() -> None:
    planners = installed_planners("ur5_ezgripper_moveit_config")
    assert planners is not None
    assert {"RRTConnect", "ompl/RRTConnect", "LIN", "pilz_industrial_motion_planner/LIN", "stomp/stomp"} <= {*planners}
    assert "RRTConect" not in planners and "omple/RRTConnect" not in planners


def test_without_a_configuration_package_planners_are_not_checked() -> None:
    assert installed_planners("no_such_package") is None


def test_the_command_refuses_an_unknown_planner_of_the_installed_robot(script: Path) -> None:
    script.write_text(TASK % "planner_id: BKPIECEE")
    command = [executable("modular_framework_core", "state_machine_generator"), str(script), "--check"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120.0)
    assert done.returncode == 1
    assert "the planner 'BKPIECEE' is unknown" in done.stderr and "did you mean 'BKPIECE'" in done.stderr


def test_a_launch_file_that_cannot_be_read_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_config" / "launch").mkdir(parents=True)
    (tmp_path / "broken_config" / "package.xml").write_text("<package><name>broken_config</name></package>")
    (tmp_path / "broken_config" / "launch" / "move_group.launch").write_text("<launch><include file='none'/></launch>")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path), prepend=":")
    with pytest.raises(ValueError, match=r"move_group\.launch: the planners .* cannot be read"):
        installed_planners("broken_config")
