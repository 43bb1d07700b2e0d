# SPDX-License-Identifier: BSD-3-Clause
"""Why a node ended is found in its log file, and a wrong launch argument is refused before anything starts."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import roslaunch.core

from modular_framework_core.launching.launch_arguments import check_arguments
from modular_framework_core.launching.launch_runner import EndWatcher, cause_of_death, verdict

LAUNCH = """<launch><arg name="simulation" default="true"/><arg name="gui" default="$(eval 1 == 2)"/>
<arg name="world_file" default="a.world"/></launch>"""
LOG = """[rospy.client][INFO] 2026-11-22 13:21:26,514: init_node, name[/gazebo], pid[28214]
[rosout][ERROR] 2026-11-22 13:21:26,520: a bad day
[rosout][CRITICAL] 2026-11-22 13:21:26,834: The task could not be run: 1 fault in the task:
  pick.yaml:3:1: unknown key 'sorce'
[rospy.core][INFO] 2026-11-22 13:21:26,842: signal_shutdown [atexit]
"""


def test_the_last_fatal_message_is_the_cause_with_all_its_lines(tmp_path: Path) -> None:
    (tmp_path / "task-10.log").write_text(LOG)
    assert cause_of_death(tmp_path / "task-10.log") == (
        "The task could not be run: 1 fault in the task:\n  pick.yaml:3:1: unknown key 'sorce'"
    )
    (tmp_path / "quiet.log").write_text(LOG.replace("CRITICAL", "WARNING"))
    assert cause_of_death(tmp_path / "quiet.log") == ""
    assert cause_of_death(tmp_path / "none.log") == ""


@pytest.mark.parametrize(
    ("argument", "hint"),
    [
        ("simulation:=flase", "argument 'simulation' is 'flase'; it must be true or false"),
        ("gui:=", "argument 'gui' is ''"),
        ("worldfile:=b", "did you mean 'world_file'"),
        ("b.world", "not of the form name:=value"),
        ("world_file:=a:=b", "argument 'world_file' is 'a:=b'; roslaunch does not support values with ':='"),
        ("gui=false", "'gui=false' is not of the form name:=value; did you mean 'gui:=false'"),
    ],
)
def test_a_wrong_argument_is_refused_with_what_is_allowed(tmp_path: Path, argument: str, hint: str) -> None:
    (tmp_path / "a.launch").write_text(LAUNCH)
    with pytest.raises(roslaunch.core.RLException, match=hint):
        check_arguments(str(tmp_path / "a.launch"), [argument])
    check_arguments(str(tmp_path / "a.launch"), ["simulation:=False", "gui:=1", "world_file:=true.world"])


METHOD = """<launch><arg name="method_launch_file" default=""/><arg name="config_directory" default=""/></launch>"""


@pytest.mark.parametrize(
    ("argument", "hint"),
    [
        (
            "method_launch_file:=top_down_grasp/a.launch",
            "is 'top_down_grasp/a.launch', and there is no package 'top_down_grasp'; it must be PACKAGE/FILE with a "
            "file in the package's folder launch, the path of a launch file from /, or none; correct it, or build and "
            "source the workspace with the package; did you mean 'top_down_grasps'?",
        ),
        (
            "method_launch_file:=top_down_grasps/top_down.launch",
            "and the package has no such file; allowed: top_down_grasps/top_down_grasps.launch; did you mean "
            "'top_down_grasps/top_down_grasps.launch'?",
        ),
        ("method_launch_file:=modular_framework_msgs", "which is not a launch file; it must be PACKAGE/FILE"),
        ("method_launch_file:=/nowhere/a.launch", "and there is no such file; it must be PACKAGE/FILE"),
        (
            "config_directory:=/nowhere",
            "argument 'config_directory' is '/nowhere'; it must be the path of a folder from /",
        ),
        ("config_directory:=config", "argument 'config_directory' is 'config'; it must be the path of a folder from /"),
    ],
)
def test_a_method_or_a_configuration_that_is_not_there_is_refused(tmp_path: Path, argument: str, hint: str) -> None:
    (tmp_path / "a.launch").write_text(METHOD)
    with pytest.raises(roslaunch.core.RLException, match=re.escape(hint)):
        check_arguments(str(tmp_path / "a.launch"), [argument])
    for file in ("", "none", "top_down_grasps/top_down_grasps.launch", tmp_path / "a.launch"):
        check_arguments(str(tmp_path / "a.launch"), [f"method_launch_file:={file}", f"config_directory:={tmp_path}"])


def test_a_misspelt_path_is_answered_with_the_nearest_one(tmp_path: Path) -> None:
    (tmp_path / "a.launch").write_text(METHOD)
    (tmp_path / "my_config").mkdir()
    for argument, meant in (("config_directory", "my_config"), ("method_launch_file", "a.launch")):
        with pytest.raises(roslaunch.core.RLException, match=re.escape(f"; did you mean '{tmp_path / meant}'")):
            check_arguments(str(tmp_path / "a.launch"), [f"{argument}:={tmp_path / meant[:-1]}"])


def test_a_wrong_default_is_refused_like_a_wrong_argument(tmp_path: Path) -> None:
    (tmp_path / "a.launch").write_text(METHOD.replace('default=""', 'default="nothing/a.launch"', 1))
    with pytest.raises(roslaunch.core.RLException, match="there is no package 'nothing'"):
        check_arguments(str(tmp_path / "a.launch"), [])


@pytest.mark.parametrize(
    ("died", "code", "last"),
    [
        (("task-10", 0), 0, "run_framework: the task succeeded"),
        (("task-10", 1), 1, "run_framework: the task did not succeed: because"),
        (("task-10", 2), 2, "run_framework: the task could not be run: because"),
        (("gazebo-2", 1), 3, "run_framework: node 'gazebo' died (exited with 1), and everything was stopped: because"),
        (
            ("gazebo-2", -9),
            3,
            "run_framework: node 'gazebo' died (was killed by signal 9), and everything was stopped: because",
        ),
    ],
)
def test_the_cause_is_the_last_line(
    capsys: pytest.CaptureFixture[str], died: tuple[str, int], code: int, last: str
) -> None:
    watcher = EndWatcher("task", ends_with_task=True)
    watcher.process_died(*died)
    watcher.process_died("late-3", 1)
    assert watcher.last_process == died[0]
    assert verdict(watcher, "because") == code
    printed = capsys.readouterr()
    assert (printed.out + printed.err).splitlines() == [last]
