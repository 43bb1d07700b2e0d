# SPDX-License-Identifier: BSD-3-Clause
"""The window of use_gui:=true publishes joint states, including values of sources and of mimic joints."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Callable
from typing import Any

import pytest
import rospy
from sensor_msgs.msg import JointState

from modular_framework_testing.ros_session import RosSession, executable, until

LIMIT = "<limit lower='-0.3' upper='1.7' effort='1' velocity='1'/>"
MIMIC = "<mimic joint='turn' multiplier='-1'/>"
LINKS = "<link name='a'/><link name='b'/><link name='c'/><link name='d'/>"
URDF = f"""<robot name='rods'>{LINKS}
<joint name='turn' type='revolute'><parent link='a'/><child link='b'/>{LIMIT}</joint>
<joint name='mirror' type='revolute'><parent link='a'/><child link='c'/>{LIMIT}{MIMIC}</joint>
<joint name='wheel' type='continuous'><parent link='a'/><child link='d'/></joint></robot>"""
LAUNCH = """<launch><param name="robot_description" value="{text}"/>
  <node pkg="joint_state_publisher_gui" type="joint_state_publisher_gui" name="window" output="screen"
        launch-prefix="xvfb-run -a">
    <rosparam>{{rate: 5, source_list: [/hand/joint_states], zeros: {{turn: 0.123456}}}}</rosparam>
    <rosparam param="dependent_joints">{{wheel: {{parent: turn, factor: 2.0, offset: 0.5}}}}</rosparam>
  </node></launch>"""


@pytest.fixture(scope="module")
def window(ros_launch: Callable[..., RosSession]) -> RosSession:
    session = ros_launch(LAUNCH.format(text=URDF.replace("<", "&lt;").replace("\n", " ")))
    rospy.wait_for_message("joint_states", JointState, 60.0)
    return session


def wait_for(expected: list[float]) -> Any:
    """Returns the first joint state with these positions."""
    end = rospy.get_time() + 20.0
    while rospy.get_time() < end:
        state = rospy.wait_for_message("joint_states", JointState, 20.0)
        if list(state.position) == pytest.approx(expected, abs=1e-9):
            return state
    raise AssertionError(f"the last positions are {state.position}, expected {expected}")


def test_zero_positions_and_their_mimic_joints_are_published(window: RosSession) -> None:
    state = wait_for([0.123456, -0.123456, 2 * 0.123456 + 0.5])
    assert list(state.name) == ["turn", "mirror", "wheel"]


def test_positions_of_a_source_are_published_with_their_mimic_joints(window: RosSession) -> None:
    publisher = rospy.Publisher("/hand/joint_states", JointState, queue_size=1, latch=True)
    publisher.publish(JointState(name=["turn"], position=[0.7654321]))
    wait_for([0.7654321, -0.7654321, 2 * 0.7654321 + 0.5])


def test_joint_states_come_at_the_rate(window: RosSession) -> None:
    stamps: list[float] = []
    subscriber = rospy.Subscriber("joint_states", JointState, lambda state: stamps.append(state.header.stamp.to_sec()))
    until(lambda: len(stamps) > 10, "ten joint states")
    subscriber.unregister()
    assert stamps[10] - stamps[0] > 1.5, "ten periods of 1/5 s; of the default rate, 1 s"


def test_an_invalid_parameter_ends_the_node_with_the_allowed_values(window: RosSession) -> None:
    command = ["rosrun", "joint_state_publisher_gui", "joint_state_publisher_gui", "__name:=wrong", "_rate:=-1"]
    answer = subprocess.run(command, env=window.env, capture_output=True, text=True, timeout=60, check=False)
    assert answer.returncode == 1
    assert "parameter '/wrong/rate' is -1; allowed: a number, above 0" in answer.stdout + answer.stderr


def test_a_source_may_be_the_topic_that_the_node_publishes(window: RosSession) -> None:
    """The node adopts values of other nodes and ignores its own messages."""
    command = ["rosrun", "joint_state_publisher", "joint_state_publisher", "__name:=own_source", "_rate:=20",
               "_source_list:=[shared_states]", "joint_states:=shared_states"]  # fmt: skip
    states: list[JointState] = []
    subscriber = rospy.Subscriber("shared_states", JointState, states.append)
    other = rospy.Publisher("shared_states", JointState, queue_size=1)
    node = subprocess.Popen(command, env=window.env)

    def turned() -> bool:
        other.publish(JointState(name=["turn"], position=[0.5]))
        own = [state for state in states if "wheel" in state.name]
        return bool(own) and dict(zip(own[-1].name, own[-1].position, strict=True))["turn"] == 0.5

    try:
        until(turned, "the position of another node")
        assert node.poll() is None
    finally:
        node.terminate()
        node.wait(30.0)
        subscriber.unregister()
        other.unregister()


def test_the_publisher_without_a_window_opens_one_for_use_gui(window: RosSession, screen: str) -> None:
    def titles() -> str:
        command = ["xwininfo", "-root", "-tree", "-display", screen]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    states: list[JointState] = []
    subscriber = rospy.Subscriber("old/joint_states", JointState, states.append)
    env = {**window.env, "DISPLAY": screen}
    for use_gui in ("false", "true"):
        states.clear()
        command = [executable("joint_state_publisher", "joint_state_publisher"), "__ns:=old", f"_use_gui:={use_gui}",
                   "robot_description:=/robot_description", f"__name:=publisher_{use_gui}"]  # fmt: skip
        node = subprocess.Popen(command, env=env)
        try:
            until(lambda: bool(states), "joint states", 60.0)
            assert [round(value, 6) for value in states[0].position] == [0.0, 0.0, 0.0]
            if use_gui == "true":
                until(lambda: '"Node: /old/publisher_true"' in titles(), "the window")
            else:
                assert "Node:" not in titles()
        finally:
            node.send_signal(signal.SIGINT)
            assert node.wait(20.0) == 0
    subscriber.unregister()
