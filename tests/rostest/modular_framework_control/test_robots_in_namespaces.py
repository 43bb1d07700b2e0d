# SPDX-License-Identifier: BSD-3-Clause
"""Two nodes robot_hw in the namespaces of two robots: each serves its own, and takes nothing of the other."""

from __future__ import annotations

import time
from typing import Any

import pytest
import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from controller_manager_msgs.srv import LoadController, SwitchController
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.ros_session import until

ROBOTS = ["left", "right"]


@pytest.fixture(scope="module")
def robots(ros_session: Any) -> Any:
    for robot in ROBOTS:
        manager = f"/{robot}/controller_manager"
        rospy.wait_for_service(f"{manager}/switch_controller", 60.0)
        for name in ("states", "arm"):
            assert rospy.ServiceProxy(f"{manager}/load_controller", LoadController)(name).ok
        switch = rospy.ServiceProxy(f"{manager}/switch_controller", SwitchController)
        assert switch(["states", "arm"], [], 2, False, 0.0).ok
    return ros_session


def test_each_serves_its_own_namespace_and_none_the_root(robots: Any) -> None:
    _, _, services = rosgraph.Master("/test").getSystemState()
    providers = {name: nodes for name, nodes in services if "controller_manager/" in name or "reset_stat" in name}
    assert {name.split("/")[1] for name in providers} == set(ROBOTS)
    for name, nodes in providers.items():
        assert nodes == [f"/{name.split('/')[1]}/robot_hw"], name


@pytest.mark.parametrize("robot", ROBOTS)
def test_each_publishes_the_states_of_its_own_joints(robots: Any, robot: str) -> None:
    assert rospy.wait_for_message(f"/{robot}/joint_states", JointState, 30.0).name == [f"{robot}_joint"]
    assert not any(topic == "/joint_states" for topic, _ in rospy.get_published_topics())


@pytest.mark.parametrize("robot", ROBOTS)
def test_each_moves_its_own_joint_within_its_own_limits(robots: Any, robot: str) -> None:
    client = SteadyActionClient(f"/{robot}/arm/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(30.0))

    def move(position: float) -> int:
        point = JointTrajectoryPoint(positions=[position], time_from_start=rospy.Duration.from_sec(0.3))
        client.send_goal(
            FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=[f"{robot}_joint"], points=[point]))
        )
        assert client.wait_for_result(rospy.Duration(30.0))
        return client.get_state()

    if robot == "left":
        assert move(0.5) == GoalStatus.REJECTED
        assert "position of joint 'left_joint' is 0.5; its limits are -1 to 0.1" in client.get_result().error_string
    reached, deadline = {"left": 0.1, "right": 0.5}[robot], time.monotonic() + 30.0
    assert move(reached) == GoalStatus.SUCCEEDED
    while abs(rospy.wait_for_message(f"/{robot}/joint_states", JointState, 30.0).position[0] - reached) > 1e-6:
        assert time.monotonic() < deadline


def test_readiness_and_figures_are_published_under_the_names_of_each(robots: Any) -> None:
    assert rospy.wait_for_message("/left/arm_ready", Bool, 30.0).data is True
    seen: set[str] = set()
    diagnostics = rospy.Subscriber(
        "/diagnostics", DiagnosticArray, lambda array: seen.update({status.name for status in array.status})
    )
    until(lambda: seen == {"left/robot_hw: control loop", "right/robot_hw: control loop"}, "diagnostics of both robots")
    diagnostics.unregister()


def test_a_description_that_is_not_the_robots_is_not_taken_and_the_log_says_so(robots: Any) -> None:
    assert "/robot_description is ignored, as this robot's parameter is /right/robot_description" in robots.log()
