# SPDX-License-Identifier: BSD-3-Clause
"""The UR arm as the framework runs it: node robot_hw, trajectory controller, action client, and faults of the arm."""
from __future__ import annotations

import os
import random
import threading
import time
from collections.abc import Callable
from typing import Any

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_drivers.emulators.command_port import send_command
from modular_framework_drivers.ur.ur_arm_robot_hw import JOINT_NAMES

START = [3.1375783963, -1.6559683943, 1.3870131566, -1.2662363723, -1.5707963268, 0.0]
LAUNCH = """<launch>
  <arg name="address"/>
  <include file="$(find modular_framework_drivers)/launch/emulators.launch">
    <arg name="gripper" value="false"/>
    <arg name="arm_address" value="$(arg address)"/>
    <arg name="arm_unlock_delay" value="0.0"/>
  </include>
  <rosparam subst_value="true">
    robot_hardware: [ur_robot_hw]
    ur_robot_hw: {type: modular_framework_drivers/UrArmRobotHW, robot_ip_address: $(arg address),
                  topic_to_wait_for: arm_ready, link_timeout: 1.0}
    joint_state_controller: {type: joint_state_controller/JointStateController, publish_rate: 50}
    arm_controller:
      type: position_controllers/JointTrajectoryController
      joints: [shoulder_pan_joint, shoulder_lift_joint, elbow_joint, wrist_1_joint, wrist_2_joint, wrist_3_joint]
      constraints: {goal_time: 0.6, stopped_velocity_tolerance: 0.05}
  </rosparam>
  <node name="robot_hw" pkg="modular_framework_control" type="robot_hw" output="screen"/>
  <node name="spawner" pkg="controller_manager" type="spawner" output="screen"
        args="joint_state_controller arm_controller"/>
</launch>"""


def until(condition: Callable[[], bool], timeout_s: float = 20.0) -> None:
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, f"waited {timeout_s} s in vain"
        time.sleep(0.01)


class Arm:
    """The running launch, as a client sees it."""

    def __init__(self, session: Any, address: str) -> None:
        self.session, self.address = session, address
        self.positions: list[float] = []
        self.ready: bool | None = None
        rospy.Subscriber("joint_states", JointState, self._on_joint_state, queue_size=1)
        rospy.Subscriber("arm_ready", Bool, self._on_ready, queue_size=1)
        self.client = actionlib.SimpleActionClient("arm_controller/follow_joint_trajectory",
                                                   FollowJointTrajectoryAction)
        assert self.client.wait_for_server(rospy.Duration(60)), session.log()
        until(lambda: bool(self.positions) and self.ready is True)

    def _on_joint_state(self, message: JointState) -> None:
        self.positions = [message.position[message.name.index(name)] for name in JOINT_NAMES]

    def _on_ready(self, message: Bool) -> None:
        self.ready = message.data

    def order(self, command: str, **arguments: object) -> str:
        return send_command(29901, command, self.address, **arguments)

    def call(self, name: str) -> tuple[bool, str]:
        answer = rospy.ServiceProxy(f"ur_robot_hw/{name}", Trigger)()
        return answer.success, answer.message

    def send(self, positions: list[float], duration_s: float) -> threading.Event:
        goal = FollowJointTrajectoryGoal()
        goal.trajectory.joint_names = list(JOINT_NAMES)
        goal.trajectory.points = [JointTrajectoryPoint(positions=positions, velocities=[0.0] * 6,
                                                       time_from_start=rospy.Duration(duration_s))]
        done = threading.Event()
        self.client.send_goal(goal, done_cb=lambda status, result: done.set())
        return done


@pytest.fixture(scope="module")
def running(ros_launch: Callable[..., Any]) -> Arm:
    draw = random.Random(os.urandom(8))
    address = f"127.{draw.randint(16, 254)}.{draw.randint(0, 254)}.{draw.randint(1, 254)}"
    return Arm(ros_launch(LAUNCH, address=address), address)


@pytest.fixture
def arm(running: Arm) -> Arm:
    """The arm, well and following."""
    for order in ("restore", "unlock", "release_emergency_stop", "power_on"):
        running.order(order)
    running.order("slider", value=1.0)
    until(lambda: running.call("resume")[0])
    return running


def test_a_trajectory_is_followed_to_its_end(arm: Arm) -> None:
    assert arm.positions == pytest.approx(START, abs=1e-3)
    target = [position + 0.3 for position in START]
    assert arm.send(target, 1.5).wait(20.0)
    assert arm.client.get_result().error_code == 0, arm.client.get_goal_status_text()
    until(lambda: arm.positions == pytest.approx(target, abs=5e-3))


def test_a_slider_at_a_third_makes_it_three_times_as_long(arm: Arm) -> None:
    target = [position - 0.2 for position in arm.positions]
    arm.order("slider", value=1.0 / 3.0)
    time.sleep(0.1)
    begun_s = time.monotonic()
    assert arm.send(target, 1.0).wait(20.0)
    assert arm.client.get_result().error_code == 0, arm.client.get_goal_status_text()
    assert 2.8 < time.monotonic() - begun_s < 6.0


def test_a_pause_makes_a_goal_wait(arm: Arm) -> None:
    target = [position + 0.2 for position in arm.positions]
    done = arm.send(target, 1.0)
    assert arm.call("dashboard/pause") == (True, "Pausing program")
    assert not done.wait(1.5)     # longer than the motion takes
    assert arm.call("dashboard/play") == (True, "Starting program")
    assert done.wait(20.0)
    assert arm.client.get_result().error_code == 0, arm.client.get_goal_status_text()


@pytest.mark.parametrize(("order", "reason"), [
    ("protective_stop", "protective stop of the arm"), ("emergency_stop", "emergency stop of the arm"),
    ("cut", "link to the arm"), ("freeze", "link to the arm")])
def test_a_fault_ends_the_goal_with_its_reason_and_resume_goes_on_where_the_arm_stands(arm: Arm, order: str,
                                                                                      reason: str) -> None:
    start = arm.positions
    done = arm.send([position + 0.5 for position in start], 4.0)
    time.sleep(0.7)
    arm.order(order)
    assert done.wait(10.0)
    assert arm.client.get_state() == GoalStatus.ABORTED
    assert reason in arm.client.get_result().error_string
    until(lambda: arm.ready is False)
    success, text = arm.call("resume")
    assert not success and reason in text
    assert arm.send(start, 1.0).wait(5.0) and reason in arm.client.get_result().error_string
    arm.order("restore")
    if order == "protective_stop":
        assert arm.call("dashboard/unlock_protective_stop") == (True, "Protective stop releasing")
    elif order == "emergency_stop":
        arm.order("release_emergency_stop")
        assert arm.call("dashboard/power_on")[0] and arm.call("dashboard/brake_release")[0]
    until(lambda: arm.call("resume")[0])
    until(lambda: arm.ready is True)
    stopped = arm.positions
    time.sleep(0.3)
    assert arm.positions == pytest.approx(stopped, abs=1e-3)
    assert arm.send(start, 1.5).wait(20.0)
    assert arm.client.get_result().error_code == 0, arm.client.get_goal_status_text()


def test_a_dashboard_that_does_not_answer_is_told(arm: Arm) -> None:
    arm.order("cut")
    success, text = arm.call("dashboard/power_on")
    assert not success and f"{arm.address}:29999" in text


def test_the_node_stops_the_arm_and_its_program_at_its_end(arm: Arm) -> None:
    os.system("rosnode kill /robot_hw > /dev/null 2>&1")
    until(lambda: "runtime_state=STOPPED" in arm.order("state") and "connections=0" in arm.order("state"))
