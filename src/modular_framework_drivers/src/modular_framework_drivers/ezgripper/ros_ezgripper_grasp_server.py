# SPDX-License-Identifier: BSD-3-Clause
"""Serves the Grasp action of an EZGripper without ROS controllers: the node drives the servos directly."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

import rospy
from sensor_msgs.msg import JointState

from modular_framework_core.commander.robot_groups import Group, Joint
from modular_framework_core.grasping.grasp_server import GraspCommandError, Outcome, refuse_no_effort
from modular_framework_core.grasping.ros_grasp_server import GraspServer
from modular_framework_core.grasping.ros_manipulator_drivers import Motion as WantedMotion
from modular_framework_drivers.ezgripper.ezgripper_device import EzGripper, GripperState
from modular_framework_drivers.ezgripper.grip import Motion, StandstillDetector
from modular_framework_drivers.ezgripper.gripper_servos import CALIBRATION_TORQUE, CLOSED_POSITION
from modular_framework_drivers.ezgripper.gripper_settings import FULL_TORQUE, read_gripper_settings
from modular_framework_drivers.ezgripper.mx64 import TORQUE_MAX
from modular_framework_drivers.ezgripper.ros_gripper_report import GripperReport
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.publishing import publish
from modular_framework_ros.ros_node_handle import RosNodeHandle

POLL_S = 0.01
STOP_TIMEOUT_S = 1.0
STANDSTILL_SPEED, STANDSTILL_S = 0.05, 0.1
PRESSING_FRACTION = 0.5
"""Minimum fraction of the allowed torque at which the fingers press on an object."""


class EzGripperManipulator:
    """Moves the gripper for the grasp server and publishes the state of the knuckle joint.

    Publishers: `joint_states` (sensor_msgs/JointState), as long as the servos respond.

    Args:
        gripper: Gripper device.
        joint: Name of the knuckle joint.
    """

    def __init__(self, gripper: EzGripper, joint: str) -> None:
        self._gripper, self._joint = gripper, joint
        self._publisher: rospy.Publisher | None = None

    def connect(self) -> None:
        """Starts to connect the gripper and to publish."""
        self._gripper.start()
        self._publisher = rospy.Publisher("joint_states", JointState, queue_size=10)
        threading.Thread(target=self._publish, name="joint_states", daemon=True).start()

    def joint_state(self, names: Mapping[str, float]) -> JointState:
        """Returns the last measured joint state."""
        del names
        return self._message(self._gripper.state())

    def move(self, motion: WantedMotion) -> Outcome:
        """Moves the fingers until they stand still at their goal or hold an object.

        Raises:
            GraspCommandError: If the gripper has a fault or zero torque, the time is over, or a stop is requested.
        """
        torque = self._gripper.settings.start_torque
        if self._joint in motion.efforts:
            torque = round(motion.efforts[self._joint] * FULL_TORQUE)
            refuse_no_effort(self._joint, torque)
        initial_state = self._gripper.state()
        self._refuse_fault(initial_state)
        position = min(max(motion.targets[self._joint], 0.0), CLOSED_POSITION)  # tolerates rounding errors
        goal_number = self._gripper.command(position, torque)
        end_s = time.monotonic() + motion.timeout_s
        # an object that the fingers hold may give way to the new torque
        standstill = StandstillDetector(STANDSTILL_SPEED, STANDSTILL_S)
        while True:
            state = self._gripper.state()
            self._refuse_fault(state)
            if state.faults != initial_state.faults:  # a fault between two reads may have cancelled the goal
                self._stop()
                raise GraspCommandError(state.last_fault)
            if motion.stop_requested():
                self._stop()
                raise GraspCommandError("stopped on request")
            stands_still = state.goal.number == goal_number and standstill.update(state.reading.velocity, state.stamp_s)
            if stands_still and state.motion is not Motion.MOVING:
                return self._outcome(state)
            if time.monotonic() > end_s:
                self._stop()
                raise GraspCommandError(
                    f"the fingers still moved after {motion.timeout_s:.1f} s, at "
                    f"{state.reading.position:.4f} rad; check that nothing slips"
                )
            time.sleep(POLL_S)

    def _outcome(self, state: GripperState) -> Outcome:
        reading, held = state.reading, state.motion is Motion.HOLDING
        state_text = "press" if held else "stand"
        allowed = min(state.goal.torque, self._gripper.settings.rules.hold_torque)
        pressing = (
            held and allowed >= CALIBRATION_TORQUE and (abs(reading.load) * TORQUE_MAX >= PRESSING_FRACTION * allowed)
        )
        return Outcome(
            {self._joint: reading.position},
            held,
            f"the fingers {state_text} at {reading.position:.4f} rad with {reading.load:.0%} torque",
            pressing,
        )

    def _refuse_fault(self, state: GripperState) -> None:
        if state.fault:
            raise GraspCommandError(state.fault)

    def _stop(self) -> None:
        """Stops the fingers and waits until they stand still."""
        self._gripper.stop()
        requested_s = time.monotonic()
        standstill = StandstillDetector(STANDSTILL_SPEED, STANDSTILL_S)
        while time.monotonic() < requested_s + STOP_TIMEOUT_S:
            state = self._gripper.state()
            if state.fault or (
                state.stamp_s > requested_s and standstill.update(state.reading.velocity, state.stamp_s)
            ):
                return
            time.sleep(POLL_S)
        rospy.logwarn(
            "%s: the fingers still moved %.1f s after the request to stop", self._gripper.settings.name, STOP_TIMEOUT_S
        )

    def _publish(self) -> None:
        last_s = self._gripper.state().stamp_s
        while not rospy.is_shutdown():
            state = self._gripper.state()
            if state.stamp_s > last_s and self._publisher is not None:
                last_s = state.stamp_s
                publish(self._publisher, self._message(state))
            time.sleep(self._gripper.settings.poll_period_s)

    def _message(self, state: GripperState) -> JointState:
        reading = state.reading
        message = JointState(
            name=[self._joint], position=[reading.position], velocity=[reading.velocity], effort=[reading.load]
        )
        message.header.stamp = rospy.Time.now()
        return message


def gripper_group(joint: str) -> Group:
    """Returns the planning group of the gripper: one joint, with efforts as fractions of the full torque."""
    knuckle = Joint(name=joint, lower=0.0, upper=CLOSED_POSITION, effort=1.0)
    return Group("ezgripper", (knuckle,), "", {"closed": {joint: CLOSED_POSITION}})


def main() -> int:
    """Runs the node `ezgripper_grasp_action_server`.

    An absent or faulty gripper does not end the node: goals are aborted with the reason until the gripper is usable.

    Parameters: see `parameters/ezgripper_grasp_action_server.yaml`. The `max_torque` of a goal is in servo units and is
    limited to 800.

    Publishers: `joint_states`; `/diagnostics`, with the fault of the gripper.

    Raises:
        ParameterError: If a parameter is missing or invalid.
    """
    rospy.init_node("ezgripper_grasp_action_server")
    settings = read_gripper_settings(RosNodeHandle("~"), RosNodeHandle("/"))
    read = DeclaredParameters("modular_framework_drivers", "ezgripper_grasp_action_server").values
    joint, name = read("~joint", "/manipulator_controller_action_server_name")
    gripper = EzGripper(settings)
    server = GraspServer(gripper_group(joint), EzGripperManipulator(gripper, joint))
    server.connect(name)
    report = GripperReport(gripper)
    report.connect()
    rospy.loginfo("%s at %s listens to action '%s'.", settings.name, settings.port_name, rospy.resolve_name(name))
    rospy.spin()
    report.close()
    gripper.close()
    return 0
