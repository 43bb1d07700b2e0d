# SPDX-License-Identifier: BSD-3-Clause
"""The main job: one command, a simulated robot, a picked object."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from modular_framework_testing.ros_session import RosSession

ORIGINAL_CONFIGURATION = Path(__file__).resolve().parents[1] / "original_configuration"
TASK_TIMEOUT_S = 180.0
LIFTED_M = 0.10
BUSY_MACHINE = "still waiting for|no transform from"
"""Warnings of nodes that wait long for others at the start."""
NO_PLAN = r"\w+ failed \([A-Z_]+\)|\bPlan\w*: "
"""Warnings of grasps that the arm does not reach."""
MAX_LINES = 82  # of the log: roslaunch 36, start 15, states 23

# Runs as a node of its own beside the launch and prints how high each model was at first and at last, and how many
# messages said so, the last of them how many seconds after the first.
# heights of the models when the task begins and when it ends; what falls while the launch is stopped does not count
WATCHER = """
import json, sys, threading, time
import rosgraph, rospy
from gazebo_msgs.msg import ModelStates
from rosgraph_msgs.msg import Log
while not rosgraph.is_master_online():
    time.sleep(0.05)
rospy.init_node("watcher", anonymous=True, disable_signals=True)
heights, ended = {}, threading.Event()
def remember(message):
    if not ended.is_set():
        for name, pose in zip(message.name, message.pose):
            heights.setdefault(name, [pose.position.z] * 2)[1] = pose.position.z
def read_log(message):
    if message.name == "/task" and message.msg.startswith("state machine ends"):
        ended.set()
rospy.Subscriber("/gazebo/model_states", ModelStates, remember)
rospy.Subscriber("/rosout", Log, read_log)
sys.stdin.read()
print(json.dumps([heights, ended.is_set()]))
"""


@pytest.mark.parametrize(
    ("robot", "method"),
    [
        ("modular_framework_api", "top_down_grasps"),
        ("panda_hand_robot", "top_down_grasps"),
        ("modular_framework_api", "point_cloud_grasps"),
        ("panda_hand_robot", "point_cloud_grasps"),
    ],
)
def test_simulated_pick_lifts_an_object_and_exits_with_success(session: RosSession, robot: str, method: str) -> None:
    watcher = subprocess.Popen(
        [sys.executable, "-c", WATCHER], env=session.env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        launch = session.run_framework(robot, gui="false", rviz="false", method_launch_file=f"{method}/{method}.launch")
        exit_code = launch.wait(TASK_TIMEOUT_S)
        heights, ended = json.loads(watcher.communicate(timeout=60)[0].splitlines()[-1])
    finally:
        watcher.kill()
    assert exit_code == 0, launch.log()
    assert "Task 'simulation_pick' ended with outcome 'successful_pipeline': SUCCEEDED" in launch.log()
    assert launch.log().splitlines()[-1] == "run_framework: the task succeeded"
    assert "REQUIRED process" not in launch.log() and "Traceback" not in launch.log(), launch.log()
    lines = [line for line in launch.log().splitlines() if not re.search(BUSY_MACHINE, line)]
    reaches_all = (robot, method) == ("modular_framework_api", "top_down_grasps")
    alarms = [line for line in lines if re.search(r"WARN|ERROR|FATAL", line)]
    alarms = [line for line in alarms if reaches_all or not re.search(NO_PLAN, line)]
    assert not alarms, alarms
    assert not reaches_all or len(lines) <= MAX_LINES, launch.log()
    lifted = {name: last - first for name, (first, last) in heights.items()}
    assert ended and max(lifted.values()) > LIFTED_M, f"{lifted}\n{launch.log()}"
    assert sum(height > LIFTED_M for height in lifted.values()) == 1, lifted


def test_a_configuration_folder_of_the_original_picks_with_a_planner_that_is_there(session: RosSession) -> None:
    launch = session.run_framework(
        gui="false", rviz="false", config_directory=str(ORIGINAL_CONFIGURATION), planner_name="RRTConnect"
    )
    assert launch.wait(TASK_TIMEOUT_S) == 0, launch.log()
    assert "Task 'simulation_pick' ended with outcome 'successful_pipeline': SUCCEEDED" in launch.log()
    assert (
        "parameter '/top_down_grasp_generator/gripper_joint' is not set: joint 'ezgripper_knuckle_palm_L1_1' moves the "
        "fingers, the only driven joint of the planning group 'ezgripper'"
    ) in launch.log()


def test_wrong_launch_argument_is_refused_and_named(session: RosSession) -> None:
    launch = session.run_framework(robot_packag="ur5_ezgripper_robot")
    assert launch.wait(90.0) == 2
    assert "unknown argument 'robot_packag'; did you mean 'robot_package'" in launch.log()


@pytest.mark.parametrize(
    ("name", "value", "code", "cause"),
    [
        ("simulation", "flase", 2, "argument 'simulation' is 'flase'; it must be true or false"),
        ("task_constructor_script", "no.yaml", 2, "no.yaml:1:1: there is no such file"),
        ("world_file", "no.world", 2, "argument 'world_file' is 'no.world'.*did you mean 'bin.world'"),
        ("world_file", "../../../tests/system/nameless_link.world", 2, r"nameless_link\.world:4: <link>: has no name"),
    ],
)
def test_the_last_lines_say_what_is_wrong_and_no_interrupted_node_prints_a_traceback(
    session: RosSession, name: str, value: str, code: int, cause: str
) -> None:
    launch = session.run_framework(gui="false", rviz="false", **{name: value})
    assert launch.wait(TASK_TIMEOUT_S) == code, launch.log()
    assert re.search(cause, "\n".join(launch.log().splitlines()[-2:])), launch.log()
    assert "Traceback" not in launch.log(), launch.log()
