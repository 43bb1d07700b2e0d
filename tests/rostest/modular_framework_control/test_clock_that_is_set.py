# SPDX-License-Identifier: BSD-3-Clause
"""The node robot_hw while somebody sets the clock of the system: motions go on, stamps of messages follow the clock."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_control.realtime.loop_time import LoopTime
from modular_framework_control.ros.robot_hw_node import RobotHwNode
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.control.ros_controllers import start_controllers
from modular_framework_testing.ros_session import until

HOUR_S = 3600.0


class SetClock:
    """The clock of the system as the node sees it."""

    def __init__(self) -> None:
        self.set_by_s = 0.0
        self.loop_time = LoopTime(self)

    def __call__(self) -> float:
        return time.time() + self.set_by_s


@pytest.fixture(scope="module")
def clock(ros_session: Any) -> Iterator[SetClock]:
    """A node in this process; its clock can be set."""
    for name, value in {"joints": ["shoulder"], "rate": 100, "real_time": False}.items():
        rospy.set_param(f"~{name}", value)
    rospy.set_param("/states", {"type": "joint_state_controller/JointStateController"})
    rospy.set_param(
        "/arm",
        {
            "type": "position_controllers/JointTrajectoryController",
            "joints": ["shoulder"],
            "constraints": {"goal_time": 10.0},
        },
    )
    system, ended = SetClock(), threading.Event()
    node = RobotHwNode(ended, system.loop_time)
    node.connect()
    loop = threading.Thread(target=node.run)
    loop.start()
    start_controllers(["states", "arm"])
    yield system
    ended.set()
    loop.join(10.0)
    node.close()


@pytest.fixture
def arm(clock: SetClock) -> actionlib.SimpleActionClient:
    client = SteadyActionClient("arm/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    return client


def move(client: actionlib.SimpleActionClient, position: float, duration_s: float, stamp_s: float = 0.0) -> None:
    trajectory = JointTrajectory(joint_names=["shoulder"])
    trajectory.header.stamp = rospy.Time.from_sec(stamp_s)
    trajectory.points.append(
        JointTrajectoryPoint(
            positions=[position], velocities=[0.0], time_from_start=rospy.Duration.from_sec(duration_s)
        )
    )
    client.send_goal(FollowJointTrajectoryGoal(trajectory=trajectory))


@pytest.mark.parametrize("step_s", [-HOUR_S, HOUR_S, -0.5])
def test_a_goal_under_way_goes_on_without_a_jump_and_states_are_stamped_by_the_clock_that_was_set(
    clock: SetClock, arm: actionlib.SimpleActionClient, step_s: float
) -> None:
    received: list[tuple[JointState, float]] = []
    here = rospy.wait_for_message("joint_states", JointState, 30.0).position[0]
    subscriber = rospy.Subscriber("joint_states", JointState, lambda message: received.append((message, clock())))
    begun_s = time.monotonic()
    move(arm, here + 1.0, 2.0)
    until(lambda: received and received[-1][0].position[0] > here + 0.1, "the motion under way")
    clock.set_by_s += step_s
    assert arm.wait_for_result(rospy.Duration(30.0))
    assert time.monotonic() - begun_s >= 1.9, "it must not be carried to its end at once"
    assert arm.get_state() == GoalStatus.SUCCEEDED, arm.get_goal_status_text()
    fastest = max(abs(message.velocity[0]) for message, _ in list(received))
    assert fastest < 0.8, "the curve of this goal is never faster than 0.75 rad/s"
    received.clear()
    until(lambda: len(received) >= 5, "joint states at its end")
    subscriber.unregister()
    assert received[-1][0].position[0] == pytest.approx(here + 1.0, abs=1e-6)
    assert -0.01 < min(heard_s - message.header.stamp.to_sec() for message, heard_s in received) < 0.4


def test_a_header_stamp_counts_by_the_clock_as_it_is_now(clock: SetClock, arm: actionlib.SimpleActionClient) -> None:
    before_s = clock.loop_time.ahead_s
    clock.set_by_s += HOUR_S
    until(lambda: clock.loop_time.ahead_s > before_s + HOUR_S / 2, "the loop that knows of the set clock")
    begun_s = time.monotonic()
    move(arm, 0.0, 0.3, stamp_s=clock() + 0.7)
    assert arm.wait_for_result(rospy.Duration(30.0))
    assert arm.get_state() == GoalStatus.SUCCEEDED
    assert time.monotonic() - begun_s > 0.9
    move(arm, 0.5, 0.3, stamp_s=clock() - 5.0)
    assert arm.wait_for_result(rospy.Duration(30.0))
    assert arm.get_state() == GoalStatus.REJECTED and "in the past" in arm.get_goal_status_text()
