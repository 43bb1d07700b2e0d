# SPDX-License-Identifier: BSD-3-Clause
"""An emulated UR arm with node robot_hw and a trajectory controller, as a client sees it; for tests of the driver."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_drivers.ur.ur_arm_robot_hw import JOINT_NAMES
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.emulators.command_port import send_command
from modular_framework_testing.emulators.ur_emulator_process import random_local_address
from modular_framework_testing.ros_session import until

START = [3.1375783963, -1.6559683943, 1.3870131566, -1.2662363723, -1.5707963268, 0.0]
LAUNCH = """<launch>
  <arg name="address"/>
  <arg name="link_timeout" default="" doc="of the hardware [s]; empty: its own"/>
  <include file="$(find modular_framework_testing)/launch/emulators.launch">
    <arg name="gripper" value="false"/>
    <arg name="arm_address" value="$(arg address)"/>
    <arg name="arm_unlock_delay" value="0.0"/>
  </include>
  <rosparam subst_value="true">
    robot_hardware: [ur_robot_hw]
    ur_robot_hw: {type: modular_framework_drivers/UrArmRobotHW, robot_ip_address: $(arg address),
                  topic_to_wait_for: arm_ready}
    joint_state_controller: {type: joint_state_controller/JointStateController, publish_rate: 50}
    arm_controller:
      type: position_controllers/JointTrajectoryController
      joints: [shoulder_pan_joint, shoulder_lift_joint, elbow_joint, wrist_1_joint, wrist_2_joint, wrist_3_joint]
      constraints: {goal_time: 0.6, stopped_velocity_tolerance: 0.05}
    speed_scaling_state_controller: {type: scaled_controllers/SpeedScalingStateController, publish_rate: 100}
  </rosparam>
  <param name="ur_robot_hw/link_timeout" value="$(arg link_timeout)" if="$(eval link_timeout != '')"/>
  <node name="robot_hw" pkg="modular_framework_control" type="robot_hw" output="screen"/>
  <node name="spawner" pkg="controller_manager" type="spawner" output="screen"
        args="joint_state_controller arm_controller speed_scaling_state_controller"/>
</launch>"""


class Arm:
    """The running launch, as a client sees it."""

    def __init__(self, session: Any, address: str) -> None:
        self.session, self.address = session, address
        self.positions: list[float] = []
        self.ready: bool | None = None
        rospy.Subscriber("joint_states", JointState, self._on_joint_state, queue_size=1)
        rospy.Subscriber("arm_ready", Bool, self._on_ready, queue_size=1)
        self.client = SteadyActionClient("arm_controller/follow_joint_trajectory", FollowJointTrajectoryAction)
        assert self.client.wait_for_server(rospy.Duration(60)), session.log()
        self.until(lambda: bool(self.positions) and self.ready is True, "a ready arm")

    def _on_joint_state(self, message: JointState) -> None:
        self.positions = [message.position[message.name.index(name)] for name in JOINT_NAMES]

    def _on_ready(self, message: Bool) -> None:
        self.ready = message.data

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Waits until a condition holds; the failure shows what the driver logged."""
        try:
            until(condition, what)
        except AssertionError as error:
            raise AssertionError(f"{error}\n{self.session.log()}") from error

    def well(self) -> None:
        """End all faults, and have the arm follow."""
        for command in ("restore", "unlock", "release_emergency_stop", "power_on"):
            self.command(command)
        self.command("slider", value=1.0)
        self.until(lambda: self.call("resume")[0], "an arm that follows again")

    def true_positions(self) -> list[float]:
        """Where the emulated joints are, whatever the driver knows [rad]."""
        state = dict(pair.split("=") for pair in self.command("state").split())
        return [float(value) for value in state["q"].split(",")]

    def command(self, command: str, **arguments: object) -> str:
        return send_command(29901, command, self.address, **arguments)

    def call(self, name: str) -> tuple[bool, str]:
        answer = rospy.ServiceProxy(f"ur_robot_hw/{name}", Trigger)()
        return answer.success, answer.message

    def send(self, positions: list[float], duration_s: float) -> threading.Event:
        goal = FollowJointTrajectoryGoal()
        goal.trajectory.joint_names = list(JOINT_NAMES)
        goal.trajectory.points = [
            JointTrajectoryPoint(positions=positions, velocities=[0.0] * 6, time_from_start=rospy.Duration(duration_s))
        ]
        done = threading.Event()
        self.client.send_goal(goal, done_cb=lambda status, result: done.set())
        return done


def launched_arm(ros_launch: Callable[..., Any], **settings: object) -> Arm:
    """Launch everything with an emulator at an address that nobody else uses."""
    address = random_local_address()
    return Arm(ros_launch(LAUNCH, address=address, **settings), address)
