# SPDX-License-Identifier: BSD-3-Clause
"""Provides a UR arm as a `RobotHW` with position commands over RTDE."""

from __future__ import annotations

import logging
import time

from modular_framework_control.hardware_interface.handles import (
    ForceTorqueSensorHandle,
    JointHandle,
    JointStateHandle,
    SpeedScalingHandle,
)
from modular_framework_control.hardware_interface.interfaces import (
    ForceTorqueSensorInterface,
    JointStateInterface,
    PositionJointInterface,
    SpeedScalingInterface,
)
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_drivers.ur.arm_messages import ArmState
from modular_framework_drivers.ur.arm_modes import PROGRAM_PLAYING, PROGRAM_STOPPED, robot_fault
from modular_framework_drivers.ur.arm_parameters import read_checked_joints, read_link_settings
from modular_framework_drivers.ur.command_check import CheckedJoint, CommandCheck
from modular_framework_drivers.ur.rtde_link import LinkSettings, RtdeLink
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names
from modular_framework_ros.parameter_declarations import parameters_below

LOGGER = logging.getLogger("rosout.ur_arm")
JOINT_NAMES = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
_PERIOD_SMOOTHING = 0.02
_MIN_PERIOD_S = 0.002
_MAX_PERIOD_S = 0.05  # the motion missed in a longer cycle is made up gradually
_STALE_S = 0.025  # age of a stale state: three cycles of a CB3 controller
_LATE_S = 0.04  # minimum transmission delay of a state that causes a warning [s]
_PROGRAM_START_S = 1.0  # maximum time from the upload of a program to a state with a running program [s]
_MAX_CAUSE_DELAY_S = 0.03  # maximum delay from the end of a program to the state with the cause [s]


class UrArmHardware(RobotHW):
    """A UR arm with joint position commands.

    Parameters: see `parameters/UrArmRobotHW.yaml`; in the root namespace, `robot_description` and
    `joint_limits/<joint>/...` contain limits and soft limits.

    The efforts of the joint states are motor currents [A], as in ur_robot_driver.
    """

    def __init__(self) -> None:
        super().__init__()
        self._prefix = ""
        self._handles: list[JointHandle] = []
        self._wrench = ForceTorqueSensorHandle("wrench", "base")
        self._scaling = SpeedScalingHandle("speed_scaling_factor", ())
        self._settings: LinkSettings | None = None
        self._link: RtdeLink | None = None
        self._check: CommandCheck | None = None
        self._servo_time_s = 0.008
        self._refusal = ""
        self._robot_fault = "no state of the arm yet"
        self._fault = "not initialised"
        self._following = False

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        where = join_names(robot_hw_nh.namespace, "")
        try:
            parameters = parameters_below("modular_framework_drivers", "UrArmRobotHW", robot_hw_nh, root_nh)
            self._settings = read_link_settings(parameters)
            robot_id, max_jump = parameters.values("~robot_id", "~max_jump_rad")
            self._prefix = f"{robot_id}_" if robot_id else ""
            names = [self._prefix + name for name in JOINT_NAMES]
            joints = read_checked_joints(names, root_nh)
            self._check = CommandCheck(joints, max_jump)
        except ParameterError as error:
            LOGGER.error("%s in %s: %s", type(self).__name__, where, error)
            return False
        unused_parameters = [
            key for key in ("control_pc_ip_address", "robot_program_path") if robot_hw_nh.get_param(key)
        ]
        if unused_parameters:
            LOGGER.info("%s: not used, as RTDE does not need it: %s", where, ", ".join(unused_parameters))
        self._register(joints)
        self._link = RtdeLink(self._settings)
        self._link.connect()
        self._link.request_program()
        self._fault = self._current_fault()
        return True

    def _register(self, joints: list[CheckedJoint]) -> None:
        states, commands = JointStateInterface(), PositionJointInterface()
        for joint in joints:
            handle = JointHandle(states.register_handle(JointStateHandle(joint.name)))
            handle.limits = joint.limits
            self._handles.append(commands.register_handle(handle))
        self._wrench = ForceTorqueSensorHandle(self._prefix + "wrench", self._prefix + "base")
        self._scaling = SpeedScalingHandle(self._prefix + "speed_scaling_factor", [joint.name for joint in joints], 0.0)
        sensors, scaling = ForceTorqueSensorInterface(), SpeedScalingInterface()
        sensors.register_handle(self._wrench)
        scaling.register_handle(self._scaling)
        for interface in (states, commands, sensors, scaling):
            self.register_interface(interface)

    @property
    def address(self) -> str:
        """Returns the address of the arm's controller."""
        return self._settings.address if self._settings is not None else ""

    def read(self, time_s: float, period_s: float) -> None:
        if self._link is None or self._check is None:
            return
        self._link.poll()
        state = self._link.state
        if state is not None:
            self._update_handles(state)
        self._stop_if_program_ended(state)
        following = self._link.commanding and not self._robot_fault and self._program_runs(state)
        if not following or not self._following:
            for handle in self._handles:
                handle.command = handle.position
            self._restart_from_measured(self._check)
        self._following = following
        self._fault = self._current_fault()

    def _update_handles(self, state: ArmState) -> None:
        self._robot_fault = robot_fault(state, self.address)
        connected = self._link is not None and not self._link.lost
        stale = time.monotonic() - state.received_s > _STALE_S
        for handle, position, velocity, current in zip(
            self._handles, state.positions, state.velocities, state.currents, strict=True
        ):
            joint = handle.state
            joint.stale = stale
            joint.position, joint.velocity, joint.effort = position, velocity if connected else 0.0, current
        self._wrench.force = state.wrench[0], state.wrench[1], state.wrench[2]
        self._wrench.torque = state.wrench[3], state.wrench[4], state.wrench[5]
        playing = state.runtime_state == PROGRAM_PLAYING
        self._scaling.factor = min(max(state.speed_fraction * state.speed_scaling, 0.0), 1.0) if playing else 0.0

    def _stop_if_program_ended(self, state: ArmState | None) -> None:
        """Sends no commands after the program has ended for any reason, until `resume` is called."""
        if self._link is None or not self._link.commanding:
            return
        starting = not self._following and (
            state is None or state.received_s < self._link.program_ready_s + _PROGRAM_START_S
        )
        fault = self._robot_fault.partition(";")[0]
        if not starting and (fault or not self._program_runs(state)):
            self._link.drop_program(fault or "the program on the arm was stopped")

    def _program_runs(self, state: ArmState | None) -> bool:
        return state is not None and state.runtime_state != PROGRAM_STOPPED

    def write(self, time_s: float, period_s: float) -> None:
        if self._link is None or self._check is None or not self._following:
            return
        if self._link.state is None or self._link.state.runtime_state != PROGRAM_PLAYING:
            self._restart_from_measured(self._check)  # a paused arm continues from its current position
            return
        period_s = min(period_s, _MAX_PERIOD_S)
        if period_s > 0.0:
            self._servo_time_s += _PERIOD_SMOOTHING * (max(period_s, _MIN_PERIOD_S) - self._servo_time_s)
        for index, handle in enumerate(self._handles):
            if handle.held:  # a joint cannot stop at its measured position and must not reverse
                handle.command, handle.held = self._check.rest_after(index, handle.command, handle.velocity), False
        refusal = self._check.admit([handle.command for handle in self._handles], period_s)
        if refusal and refusal != self._refusal:
            LOGGER.error("command refused: %s", refusal)
        self._refusal = refusal
        self._link.servo(self._check.sent, self._servo_time_s)

    def _restart_from_measured(self, check: CommandCheck) -> None:
        check.reset([handle.position for handle in self._handles])
        self._refusal = ""

    def warning(self) -> str:
        state = self._link.state if self._link is not None else None
        if state is None or state.late_s < _LATE_S:
            return ""
        return f"the states of the arm at {self.address} come {state.late_s:.2f} s late; check the network"

    def fault(self) -> str:
        return self._refusal or self._fault

    @property
    def ready(self) -> bool:
        """Returns whether the arm follows commands."""
        return self._following and not self.fault()

    def close(self) -> None:
        if self._link is not None:
            self._link.close()

    def resume(self, timeout_s: float = 20.0) -> str:
        """Waits until the arm follows commands again after a fault; must not be called in the control loop.

        Args:
            timeout_s: Maximum wait [s].

        Returns:
            The cause of a failure and its remedy; otherwise "".
        """
        if self._link is None:
            return "the arm is not initialised"
        if self._following:
            return ""
        fault = self._link_fault() or self._robot_fault
        if fault:
            return fault
        self._link.request_program()
        deadline_s = time.monotonic() + timeout_s
        while time.monotonic() < deadline_s:
            time.sleep(0.02)
            if self._following:
                return ""
            if self._link.program_failure:
                return self.fault() or self._program_failure(self._link)
        return self.fault() or f"the program on the arm did not start within {timeout_s:g} s"

    def _current_fault(self) -> str:
        return self._link_fault() or self._robot_fault or self._program_fault()

    def _link_fault(self) -> str:
        link = self._link
        if link is None or not link.lost:
            return ""
        if link.state is None:
            return f"not connected to the arm at {self.address} yet: {link.lost}; the driver keeps trying"
        return f"connection to the arm at {self.address} lost: {link.lost}; the driver reconnects"

    def _program_fault(self) -> str:
        link = self._link
        if link is None or self._following:
            return ""
        if link.program_failure:
            return "" if self._cause_may_follow(link) else self._program_failure(link)
        return f"the arm at {self.address} is starting to accept commands: {link.start_step}"

    def _program_failure(self, link: RtdeLink) -> str:
        return f"the arm at {self.address} accepts no commands: {link.program_failure}; call resume"

    def _cause_may_follow(self, link: RtdeLink) -> bool:
        """Returns whether a state that explains the end of the program may still arrive.

        The end of the program may be reported before the stop of the arm that caused this end.
        """
        return link.state is None or link.state.received_s < link.program_failed_s + _MAX_CAUSE_DELAY_S
