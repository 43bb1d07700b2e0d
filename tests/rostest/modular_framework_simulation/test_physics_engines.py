# SPDX-License-Identifier: BSD-3-Clause
"""The launch argument physics_engine: MuJoCo moves robot and models on the same topics and services."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from controller_manager_msgs.srv import ListControllers
from gazebo_msgs.srv import ApplyBodyWrench, DeleteModel, GetModelState, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3, Wrench
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.ros_session import until

sys.path.insert(0, str(Path(__file__).parent))
from simulated_ur5 import ARM, BALL, LAUNCH  # noqa: E402

UNKNOWN = """<launch><include file="$(find gazebo_ros)/launch/empty_world.launch">
  <arg name="physics_engine" value="ode"/><arg name="server_required" value="true"/><arg name="gui" value="false"/>
</include></launch>"""


@pytest.fixture(scope="module")
def simulation(ros_session: Any) -> Iterator[Any]:
    launch = ros_session.launch(LAUNCH, physics_engine="mujoco")
    ros_session.wait_for_service("/gazebo/spawn_sdf_model", 60.0)
    yield launch
    launch.stop()


def height(model: str) -> float:
    state = rospy.ServiceProxy("/gazebo/get_model_state", GetModelState)(model, "world")
    assert state.success, state.status_message
    return float(state.pose.position.z)


def running_controllers() -> list[str]:
    listed = rospy.ServiceProxy("/controller_manager/list_controllers", ListControllers)()
    return [controller.name for controller in listed.controller if controller.state == "running"]


def test_the_log_says_which_engine_it_is(simulation: Any) -> None:
    until(lambda: "physics engine mujoco" in simulation.log(), "the line")


def test_the_arm_follows_a_trajectory(simulation: Any) -> None:
    client = SteadyActionClient("/arm_trajectory_controller/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(60.0))
    until(lambda: "arm_trajectory_controller" in running_controllers(), "the controller", timeout_s=60.0)
    positions = [1.8, -1.3, 1.3, -1.5, -1.4, 0.5]
    goal = FollowJointTrajectoryGoal()
    goal.trajectory.joint_names = ARM
    goal.trajectory.points = [JointTrajectoryPoint(positions=positions, time_from_start=rospy.Duration(2.0))]
    client.send_goal_and_wait(goal, rospy.Duration(30.0))
    assert client.get_result().error_code == 0
    states: list[JointState] = []
    subscriber = rospy.Subscriber("/joint_states", JointState, states.append)
    until(lambda: len(states) > 3, "joint states")
    subscriber.unregister()
    found = dict(zip(states[-1].name, states[-1].position, strict=True))
    assert [found[name] for name in ARM] == pytest.approx(positions, abs=2e-3)


def test_a_model_is_spawned_pushed_and_deleted(simulation: Any) -> None:
    pose = Pose(Point(2.0, 0.0, 1.0), Quaternion(0, 0, 0, 1))
    answer = rospy.ServiceProxy("/gazebo/spawn_sdf_model", SpawnModel)("ball", BALL, "", pose, "world")
    assert answer.success, answer.status_message
    until(lambda: height("ball") == pytest.approx(0.03, abs=1e-3), "the ball at rest on the ground")
    wrench = Wrench(Vector3(0, 0, 1.5), Vector3())
    apply = rospy.ServiceProxy("/gazebo/apply_body_wrench", ApplyBodyWrench)
    assert apply("ball::link", "world", Point(), wrench, rospy.Time(0), rospy.Duration(0.5)).success
    until(lambda: height("ball") > 0.3, "the ball pushed up")
    assert rospy.ServiceProxy("/gazebo/delete_model", DeleteModel)("ball").success
    assert not rospy.ServiceProxy("/gazebo/get_model_state", GetModelState)("ball", "world").success


def test_an_unknown_engine_ends_the_node_and_the_log_says_what_is_allowed(ros_session: Any, simulation: Any) -> None:
    simulation.stop()
    launch = ros_session.launch(UNKNOWN)
    launch.wait(60.0)
    assert "physics_engine' is 'ode'; allowed: pybullet, mujoco" in launch.log()
