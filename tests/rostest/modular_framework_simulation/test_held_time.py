# SPDX-License-Identifier: BSD-3-Clause
"""Nodes hold simulated time, let it pass, and begin again with the world as at the start, by services."""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from gazebo_msgs.srv import GetWorldProperties, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from sensor_msgs.msg import JointState
from simulation_time_msgs.srv import AdvanceTime, HoldTime
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_ros.simulated_time import SimulatedTime
from modular_framework_testing.ros_session import until as wait_until

sys.path.insert(0, str(Path(__file__).parent))
from simulated_ur5 import ARM, BALL  # noqa: E402

LAUNCH = """<launch>
  <param name="wait_for_planning" value="true"/>
  <include file="$(find ur5_ezgripper_robot)/launch/ur5_upload.launch"/>
  <include file="$(find modular_framework_simulation)/launch/simulation.launch">
    <arg name="world_file" value="$(find modular_framework_description)/worlds/ur5_table.world"/>
    <arg name="model_path" value="$(find modular_framework_description)/models"/>
    <arg name="real_time_factor" value="0"/>
  </include>
  <node name="spawner" pkg="modular_framework_core" type="robot_controllers_spawner"
        args="ur5_ezgripper_robot ur5_ezgripper_controller_simulation.yaml"/>
</launch>"""
HOLDER = """
import time
import rospy
from modular_framework_ros.simulated_time import SimulatedTime
rospy.init_node("holder")
with SimulatedTime().held("computing"):
    print("holds", flush=True)
    time.sleep(600)
"""

until = functools.partial(wait_until, timeout_s=30.0)


@pytest.fixture(scope="module")
def simulation(ros_session: Any) -> Iterator[Any]:
    launch = ros_session.launch(LAUNCH)
    rospy.wait_for_service("/gazebo/advance_time", 60.0)
    rospy.wait_for_message("joint_states", JointState, 60.0)
    yield launch


def call(name: str, kind: Any, *values: Any) -> Any:
    rospy.wait_for_service(name, 20.0)
    return rospy.ServiceProxy(name, kind)(*values)


def now_s() -> float:
    """Simulated time as the simulation has it, not as the clock's messages have come."""
    return float(call("/gazebo/get_world_properties", GetWorldProperties).sim_time)


def advance(duration_s: float) -> float:
    answer = call("/gazebo/advance_time", AdvanceTime, rospy.Duration.from_sec(duration_s))
    assert answer.success, answer.message
    return float(answer.stamp.to_sec())


def test_held_time_stands_still_and_passes_by_exactly_what_is_asked_for(simulation: Any) -> None:
    with SimulatedTime().held("test"):
        begun_s = now_s()
        time.sleep(0.3)
        assert now_s() == begun_s
        assert advance(0.1) == pytest.approx(begun_s + 0.1, abs=1e-9)
        time.sleep(0.3)
        assert now_s() == pytest.approx(begun_s + 0.1, abs=1e-9)
    until(lambda: now_s() > begun_s + 0.5, "time passes again")


def test_joint_states_of_the_held_time_are_published(simulation: Any) -> None:
    with SimulatedTime().held("test"):
        stamp_s = advance(0.003)  # between two turns of the joint state controller
        states: list[float] = []
        heard = rospy.Subscriber("joint_states", JointState, lambda item: states.append(item.header.stamp.to_sec()))
        until(lambda: any(abs(item - stamp_s) < 1e-6 for item in states), "the joint state of the held time")
        heard.unregister()


def test_a_motion_takes_exactly_its_time_from_the_held_instant(simulation: Any) -> None:
    client = SteadyActionClient("arm_trajectory_controller/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    state = rospy.wait_for_message("joint_states", JointState, 30.0)
    here = dict(zip(state.name, state.position, strict=True))
    goal = FollowJointTrajectoryGoal()
    goal.trajectory.joint_names = ARM
    target = [here[name] + (0.1 if name == "wrist_3_joint" else 0.0) for name in ARM]
    goal.trajectory.points = [JointTrajectoryPoint(positions=target, time_from_start=rospy.Duration(1))]
    with SimulatedTime().held("test"):
        begun_s = advance(0.0)
        client.send_goal(goal)
        until(lambda: client.get_result() is not None, "the end of the motion")
        ended_s = now_s()
        time.sleep(0.3)
        assert now_s() == ended_s
    assert client.get_result().error_code == 0
    assert begun_s + 1.0 <= ended_s <= begun_s + 1.0 + 0.6


def test_a_hold_during_motions_lets_a_goal_wait(simulation: Any) -> None:
    client = SteadyActionClient("arm_trajectory_controller/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    state = rospy.wait_for_message("joint_states", JointState, 30.0)
    here = dict(zip(state.name, state.position, strict=True))
    goal = FollowJointTrajectoryGoal()
    goal.trajectory.joint_names = ARM
    goal.trajectory.points = [
        JointTrajectoryPoint(positions=[here[name] for name in ARM], time_from_start=rospy.Duration(1))
    ]
    with SimulatedTime().held("test"):
        with SimulatedTime().held("planning", during_motions=True):
            begun_s = now_s()
            client.send_goal(goal)
            time.sleep(0.5)
            assert now_s() == begun_s
        until(lambda: client.get_result() is not None, "the end of the motion")


def test_the_hold_of_a_killed_node_ends_and_its_owner_is_named(simulation: Any, ros_session: Any) -> None:
    holder = subprocess.Popen([sys.executable, "-c", HOLDER], stdout=subprocess.PIPE, env=os.environ, text=True)
    assert holder.stdout is not None and holder.stdout.readline().strip() == "holds"
    held_s = now_s()
    time.sleep(0.3)
    assert now_s() == held_s
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    until(lambda: now_s() > held_s, "time passes again once the lease is over", timeout_s=40.0)
    until(lambda: "'/holder computing" in ros_session.log(), "the owner in the log")


def test_the_world_begins_again_without_what_was_spawned(simulation: Any) -> None:
    with SimulatedTime().held("test"):
        pose = Pose(Point(0.2, 0.5, 1.0), Quaternion(0, 0, 0, 1))
        assert call("/gazebo/spawn_sdf_model", SpawnModel, "ball", BALL, "", pose, "world").success
        answer = call("/gazebo/restart", Trigger)
        assert answer.success, answer.message
        world = call("/gazebo/get_world_properties", GetWorldProperties)
        assert "ball" not in world.model_names and "table" in world.model_names
        assert world.sim_time == pytest.approx(0.01, abs=1e-9)


@pytest.mark.parametrize(("owner", "lease_s"), [("", 1.0), ("test", 1e6), ("test", -1.0)])
def test_a_hold_without_owner_or_bound_is_refused_with_the_reason(simulation: Any, owner: str, lease_s: float) -> None:
    answer = call("/gazebo/hold_time", HoldTime, owner, lease_s, False)
    assert not answer.success
    assert "owner" in answer.message or "lease_s" in answer.message
