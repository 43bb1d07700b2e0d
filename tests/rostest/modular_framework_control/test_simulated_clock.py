# SPDX-License-Identifier: BSD-3-Clause
"""The controllers under a simulated clock: it sets their pace, may stand still, and may jump back."""

from __future__ import annotations

import contextlib
import threading
import time
import xmlrpc.client
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from rosgraph_msgs.msg import Clock
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.control.ros_controllers import start_controllers

LAUNCH = """
<launch>
  <param name="use_sim_time" value="true"/>
  <rosparam>
    arm:
      type: position_controllers/JointTrajectoryController
      joints: [shoulder]
      constraints: {goal_time: 0.5}   # a cycle after its last point a joint seems to move still
  </rosparam>
  <node pkg="modular_framework_control" type="robot_hw" name="robot_hw" output="screen" required="true">
    <rosparam>{joints: [shoulder], rate: 100}</rosparam>
  </node>
</launch>
"""


class ClockSource:
    """Publishes /clock, half as fast as real time, unless it stands still."""

    def __init__(self) -> None:
        self.time_s = 10.0
        self.running = True
        self._ended = False
        self._publisher = rospy.Publisher("/clock", Clock, queue_size=1)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended:
            if self.running:
                self.time_s += 0.01
                self._publisher.publish(Clock(rospy.Time.from_sec(self.time_s)))
            time.sleep(0.02)

    def close(self) -> None:
        """Publish no more."""
        self._ended = True
        self._thread.join(2.0)


@pytest.fixture(scope="module")
def clock(ros_launch: Callable[..., Any]) -> Iterator[ClockSource]:
    ros_launch(LAUNCH)
    source = ClockSource()
    start_controllers(["arm"])
    yield source
    source.close()


@pytest.fixture
def arm(clock: ClockSource) -> actionlib.SimpleActionClient:
    client = SteadyActionClient("arm/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    return client


def move(client: actionlib.SimpleActionClient, position: float, duration_s: float) -> None:
    point = JointTrajectoryPoint(positions=[position], time_from_start=rospy.Duration.from_sec(duration_s))
    client.send_goal(FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=["shoulder"], points=[point])))


def test_a_goal_takes_its_time_on_the_simulated_clock(clock: ClockSource, arm: actionlib.SimpleActionClient) -> None:
    begun_s = clock.time_s
    move(arm, 0.5, 1.0)
    assert arm.wait_for_result(rospy.Duration(30.0))
    assert arm.get_state() == GoalStatus.SUCCEEDED
    assert clock.time_s - begun_s >= 1.0 - 1e-6, "by real time it would have ended at half of that"


def test_while_the_clock_stands_still_so_does_the_goal(clock: ClockSource, arm: actionlib.SimpleActionClient) -> None:
    move(arm, 0.0, 0.5)
    time.sleep(0.1)
    clock.running = False
    assert not arm.wait_for_result(rospy.Duration(0.8))
    clock.running = True
    assert arm.wait_for_result(rospy.Duration(30.0))
    assert arm.get_state() == GoalStatus.SUCCEEDED


def test_after_the_clock_jumps_back_goals_end_and_new_ones_are_followed(
    clock: ClockSource, arm: actionlib.SimpleActionClient
) -> None:
    move(arm, 3.0, 20.0)
    time.sleep(0.3)
    clock.time_s = 1.0
    assert arm.wait_for_result(rospy.Duration(30.0))
    assert arm.get_state() == GoalStatus.PREEMPTED
    move(arm, 0.2, 0.5)
    assert arm.wait_for_result(rospy.Duration(30.0))
    assert arm.get_state() == GoalStatus.SUCCEEDED
    statuses: list[float] = []
    subscriber = rospy.Subscriber(
        "arm/follow_joint_trajectory/status",
        GoalStatusArray,
        lambda message: statuses.append(message.header.stamp.to_sec()),
    )
    end = time.monotonic() + 30.0
    while len(statuses) < 4:
        assert time.monotonic() < end, "the status topic must survive the jump"
        time.sleep(0.05)
    subscriber.unregister()


def test_while_the_clock_stands_still_the_node_ends_on_request(clock: ClockSource) -> None:
    clock.running = False
    _, _, uri = rospy.get_master().lookupNode("/robot_hw")
    node = xmlrpc.client.ServerProxy(uri)
    _, _, pid = node.getPid("/test")
    with contextlib.suppress(OSError):  # the node may end before it answers
        node.shutdown("/test", "as rosnode kill does")
    end = time.monotonic() + 30.0
    while Path(f"/proc/{pid}").exists():
        assert time.monotonic() < end
        time.sleep(0.02)
