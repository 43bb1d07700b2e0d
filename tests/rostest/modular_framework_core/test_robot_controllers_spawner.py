# SPDX-License-Identifier: BSD-3-Clause
"""The spawner of a robot's controllers, run as the launch file runs it, against fake hardware."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from controller_manager_msgs.srv import ListControllers, LoadController, SwitchController
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from modular_framework_testing.ros_session import executable

CONTROLLERS = """
joint_state_controller: {type: joint_state_controller/JointStateController, publish_rate: 50}
arm: {type: position_controllers/JointTrajectoryController, joints: [shoulder, elbow]}
"""


@pytest.fixture(scope="module")
def robot_package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot package with a good controller file and faulty ones, found through ROS_PACKAGE_PATH."""
    package = tmp_path_factory.mktemp("packages") / "some_robot"
    (package / "controllers").mkdir(parents=True)
    (package / "package.xml").write_text(
        "<package format='2'><name>some_robot</name><version>0.1.0</version>"
        "<description>d</description><maintainer email='a@b.c'>m</maintainer>"
        "<license>BSD</license></package>"
    )
    files = {
        "good.yaml": CONTROLLERS,
        "arm_only.yaml": CONTROLLERS.splitlines()[2],
        "unsafe.yaml": "arm: !!python/object/apply:os.getpid []",
        "wrong_joint.yaml": "leg: {type: position_controllers/JointTrajectoryController, joints: [knee]}",
    }
    for name, text in files.items():
        (package / "controllers" / name).write_text(text)
    return package


@pytest.fixture(scope="module")
def spawn(ros_session: Any, robot_package: Path) -> Iterator[Callable[..., Any]]:
    env = {**ros_session.env, "ROS_PACKAGE_PATH": f"{robot_package.parent}:{os.environ['ROS_PACKAGE_PATH']}"}
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [executable("modular_framework_core", "robot_controllers_spawner"), *arguments],
            env=env,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()


def result(process: subprocess.Popen[str]) -> tuple[int, str]:
    output, _ = process.communicate(timeout=90.0)
    return process.returncode, output


def states() -> dict[str, str]:
    rospy.wait_for_service("controller_manager/list_controllers", 60.0)
    reply = rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)()
    return {entry.name: entry.state for entry in reply.controller}


def test_a_missing_package_file_or_unsafe_file_is_named(spawn: Callable[..., Any]) -> None:
    faulty = {
        ("no_such_robot", "good.yaml"): "robot package 'no_such_robot' is not found",
        ("some_robot", "absent.yaml"): "beside it: arm_only.yaml, good.yaml",
        ("some_robot", "unsafe.yaml"): "not valid YAML",
    }
    processes = {words: spawn(*arguments) for arguments, words in faulty.items()}
    for words, process in processes.items():
        code, output = result(process)
        assert code == 1
        assert words in output
    assert states() == {}


def test_a_file_without_joint_state_controller_gets_one_and_says_so(spawn: Callable[..., Any]) -> None:
    code, output = result(spawn("some_robot", "arm_only.yaml"))
    assert code == 0, output
    assert "lists no joint state controller; 'joint_state_controller'" in output
    assert states() == {"joint_state_controller": "running", "arm": "running"}
    heard = rospy.wait_for_message("joint_states", JointState, timeout=60.0)
    assert set(heard.name) == {"shoulder", "elbow"}
    code, output = result(spawn("some_robot", "arm_only.yaml"))
    assert (code, "lists no joint state controller" in output) == (0, False)


def test_it_waits_for_every_hardware_and_names_the_missing_topic(spawn: Callable[..., Any]) -> None:
    rospy.set_param("/robot_hardware", ["arm_hw", "plain_hw", "hand_hw"])
    rospy.set_param("/arm_hw", {"topic_to_wait_for": "arm_ready"})
    rospy.set_param("/plain_hw", {"type": "some/Hardware"})
    rospy.set_param("/hand_hw", {"topic_to_wait_for": "hand_ready"})
    arm_ready = rospy.Publisher("arm_ready", Bool, queue_size=1, latch=True)
    arm_ready.publish(True)
    code, output = result(spawn("some_robot", "good.yaml", "_timeout:=3.0", "_give_up_after:=4.5"))
    assert code == 1
    assert "topic /hand_ready of hardware 'hand_hw'" in output
    assert "still waiting" in output and "topic /arm_ready" not in output
    hand_ready = rospy.Publisher("hand_ready", Bool, queue_size=1, latch=True)
    hand_ready.publish(False)
    process = spawn("some_robot", "good.yaml")
    time.sleep(0.9)
    hand_ready.publish(True)
    assert result(process)[0] == 0
    assert states() == {"joint_state_controller": "running", "arm": "running"}
    rospy.delete_param("/robot_hardware")


def test_only_what_is_missing_is_loaded_and_started(spawn: Callable[..., Any]) -> None:
    switch = rospy.ServiceProxy("controller_manager/switch_controller", SwitchController)
    assert switch([], ["arm"], 2, False, 0.0).ok
    assert states()["arm"] == "stopped"
    code, output = result(spawn("some_robot", "good.yaml"))
    assert (code, states()["arm"]) == (0, "running")
    assert "loaded now: none" in output


def test_a_controller_that_cannot_be_loaded_is_named(spawn: Callable[..., Any]) -> None:
    code, output = result(spawn("some_robot", "wrong_joint.yaml"))
    assert code == 1
    assert "controller 'leg'" in output
    assert not rospy.ServiceProxy("controller_manager/load_controller", LoadController)("leg").ok


def test_a_wrong_call_shows_the_usage(spawn: Callable[..., Any]) -> None:
    code, output = result(spawn("some_robot"))
    assert code == 2
    assert "usage" in output


def test_it_stays_alive_after_success_when_asked_to(spawn: Callable[..., Any]) -> None:
    process = spawn("some_robot", "good.yaml", "_stay_alive:=true")
    assert any("controllers running" in line for line in process.stdout)
    time.sleep(0.5)
    assert process.poll() is None
