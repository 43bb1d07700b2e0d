# SPDX-License-Identifier: BSD-3-Clause
"""A task that cannot succeed says so and why; a node that dies ends the launch and is named."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
from roslaunch.config import load_config_default
from roslaunch.rlutil import resolve_launch_arguments

from modular_framework_testing.ros_session import Launch, RosSession

TASK_TIMEOUT_S = 180.0
STOP_TIMEOUT_S = 60.0
HEADLESS = {"gui": "false", "rviz": "false"}
REQUIRED = (
    "gazebo",
    "custom_controller_spawner",
    "move_group",
    "managers",
    "sensors_tf2_broadcaster",
    "launch_grasp_action_server",
    "top_down_grasp_generator",
    "task",
)
LAST_STAMP = """
import sys
from pathlib import Path
import rospy
from modular_framework_testing.ros_session import until
from sensor_msgs.msg import JointState
rospy.init_node("last_stamp", disable_signals=True)
publisher = rospy.Publisher("/joint_states", JointState, queue_size=1)
message = JointState(name=["elbow_joint"], position=[1.3870131566])
message.header.stamp = rospy.Time(2**32 - 1)
def ended():
    publisher.publish(message)
    return not Path("/proc", sys.argv[1]).exists()
until(ended, "robot_state_publisher has ended")
"""
KILLED = ("move_group", "moveit_grasp_action_server", "rosout")
"""A node that the launch file requires, one that another node starts, and the one that comes with the master."""


@pytest.fixture(scope="module")
def nodes() -> dict[str, bool]:
    """The nodes of the launch, and whether it ends with each."""
    (path,) = resolve_launch_arguments(["modular_framework_api", "start_framework.launch"])
    arguments = [f"{name}:={value}" for name, value in HEADLESS.items()]
    config = load_config_default([(path, arguments)], None, verbose=False)
    return {node.name: node.required for node in config.nodes}


@pytest.mark.parametrize("node", REQUIRED)
def test_the_launch_file_requires_the_node(nodes: dict[str, bool], node: str) -> None:
    assert nodes[node]


def test_there_are_no_other_nodes(nodes: dict[str, bool]) -> None:
    assert set(nodes) == {*REQUIRED, "robot_state_publisher"}


def test_a_joint_state_of_the_last_second_that_a_stamp_can_name_does_not_end_the_task(session: RosSession) -> None:
    """Debian's robot_state_publisher dies of that stamp."""
    launch = session.run_framework(**HEADLESS)
    _wait_for_text(launch, "first state running", 120.0)
    before = _pid_of(session, "robot_state_publisher")
    command = [sys.executable, "-c", LAST_STAMP, str(before)]
    subprocess.run(command, env=session.env, check=True, timeout=60.0)
    assert launch.wait(TASK_TIMEOUT_S) == 0, launch.log()
    assert "[robot_state_publisher-" in launch.log() and "restarting process" in launch.log()


def test_object_out_of_reach_ends_the_task_in_failure_and_says_why(session: RosSession) -> None:
    launch = session.run_framework(**HEADLESS, world_file="ur5_table.world")
    _wait_for_text(launch, "first state running", 120.0)
    subprocess.run(
        [
            "roslaunch",
            "modular_framework_api",
            "manage_object.launch",
            "object_type:=cube",
            "object_name:=far_cube",
            "object_position:=0.2 0.88 0.865",
        ],
        env=session.env,
        check=True,
        timeout=120,
        stdout=subprocess.DEVNULL,
    )
    assert launch.wait(TASK_TIMEOUT_S) == 1, launch.log()
    log = launch.log()
    assert "Task 'simulation_pick' ended with outcome 'quit_pipeline': FAILED" in log
    assert "no grasp" in log.lower()
    assert "reach" in log.lower()


def test_the_pick_benchmark_says_why_a_launch_died(session: RosSession) -> None:
    benchmark = Path(__file__).parents[2] / "benchmarks" / "pick_success"
    run = subprocess.run(
        [benchmark, "--quick", "--launch", "world_file:=../../../tests/system/nameless_link.world"],
        env=session.env,
        capture_output=True,
        text=True,
        timeout=TASK_TIMEOUT_S,
        check=True,
    )
    assert re.search(r"FAILURE: the launch died: .*nameless_link\.world:4", run.stdout), run.stdout + run.stderr
    assert "0 of 1 episodes succeeded" in run.stdout


@pytest.mark.parametrize("node", KILLED)
def test_killed_node_ends_the_launch_and_is_named(session: RosSession, node: str) -> None:
    launch = session.run_framework(**HEADLESS)
    _wait_for_text(launch, "first state running", 120.0)
    pid = _pid_of(session, node)
    subprocess.run(["kill", "-KILL", str(pid)], check=True)
    killed = time.monotonic()
    assert launch.wait(STOP_TIMEOUT_S) == 3, launch.log()
    assert time.monotonic() - killed < STOP_TIMEOUT_S
    assert re.search(rf"[Nn]ode '{node}'.* (died|ended)", launch.log()), launch.log()


@pytest.mark.parametrize("node", ["move_group", "gazebo"])
def test_a_frozen_node_is_named_within_ten_seconds_and_ends_the_task(session: RosSession, node: str) -> None:
    launch = session.run_framework(**HEADLESS)
    _wait_for_text(launch, "state machine goes from 'MovePregrasp'", TASK_TIMEOUT_S)
    os.kill(_pid_of(session, node), signal.SIGSTOP)
    _wait_for_text(launch, f"node '/{node}' is frozen", 10.0)
    assert launch.wait(STOP_TIMEOUT_S) == 1, launch.log()
    assert "Task 'simulation_pick' ended with outcome 'preempted': FAILED" in launch.log()


def test_manipulator_node_ends_with_the_spawner_that_started_it(session: RosSession) -> None:
    launch = session.run_framework(**HEADLESS)
    _wait_for_text(launch, "first state running", 120.0)
    server, spawner = (_pid_of(session, node) for node in ("moveit_grasp_action_server", "launch_grasp_action_server"))
    subprocess.run(["kill", "-KILL", str(spawner)], check=True)
    assert launch.wait(STOP_TIMEOUT_S) == 3, launch.log()
    assert "node 'launch_grasp_action_server' died" in launch.log()
    end = time.monotonic() + 30.0
    while Path(f"/proc/{server}").exists():
        assert time.monotonic() < end, "the manipulator's node outlived the launch"
        time.sleep(0.1)


def _wait_for_text(launch: Launch, text: str, timeout_s: float) -> None:
    end = time.monotonic() + timeout_s
    while text not in launch.log():
        assert time.monotonic() < end, f"'{text}' was not printed in {timeout_s} s:\n{launch.log()}"
        assert launch.alive(), launch.log()
        time.sleep(0.1)


def _pid_of(session: RosSession, node: str) -> int:
    """The process id of a node, from its slave interface once that is open."""
    master = rosgraph.Master("/test", master_uri=session.env["ROS_MASTER_URI"])
    end = time.monotonic() + 60.0
    while True:
        try:
            return int(ServerProxy(master.lookupNode("/" + node)).getPid("/test")[2])
        except rosgraph.MasterError:
            assert time.monotonic() < end, f"node '{node}' did not register within 60 s"
            time.sleep(0.1)
