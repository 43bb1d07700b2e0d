# SPDX-License-Identifier: BSD-3-Clause
"""Provides an EZGripper as a `RobotHW`, alone or combined with an arm."""

from __future__ import annotations

import logging
import math

from modular_framework_control.hardware_interface.handles import JointHandle, JointStateHandle
from modular_framework_control.hardware_interface.interfaces import JointStateInterface, PositionJointInterface
from modular_framework_control.hardware_interface.joint_limits import JointLimitGuard
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_drivers.ezgripper.ezgripper_device import EzGripper
from modular_framework_drivers.ezgripper.gripper_servos import CLOSED_POSITION
from modular_framework_drivers.ezgripper.gripper_settings import FULL_TORQUE, read_gripper_settings
from modular_framework_drivers.ezgripper.mx64 import TORQUE_MAX
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names
from modular_framework_ros.parameter_declarations import parameters_below

LOGGER = logging.getLogger("rosout.ezgripper_robot_hw")


class EzGripperRobotHW(RobotHW):
    """modular_framework_drivers/EzGripperRobotHW: one joint with position commands and an optional maximum effort.

    `init` starts to connect and calibrate the gripper, which closes the fingers; `initialised` is true once the gripper
    has reached its start position. `fault()` reports faults of the connection and of the motor; the gripper recovers
    automatically and then stands still until the next command.

    Parameters: see `parameters/EzGripperRobotHW.yaml`; `robot_description` and `joint_limits` may contain limits.
    """

    def __init__(self) -> None:
        super().__init__()
        self._gripper: EzGripper | None = None
        self._fault_count, self._missed_fault = 0, ""

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        where = join_names(robot_hw_nh.namespace, "")
        try:
            settings = read_gripper_settings(robot_hw_nh, root_nh)
            parameters = parameters_below("modular_framework_drivers", "EzGripperRobotHW", robot_hw_nh, root_nh)
            joint, self._full_effort = parameters.values("~joint", "~full_effort")
            self._register(joint, root_nh)
        except ParameterError as error:
            LOGGER.error("%s in %s: %s", type(self).__name__, where, error)
            return False
        self._default_torque = settings.rules.hold_torque
        self._gripper = EzGripper(settings)
        self._gripper.start()
        return True

    @property
    def initialised(self) -> bool:
        return self._gripper is not None and self._gripper.state().ready and not self._gripper.state().fault

    def _register(self, joint: str, root_nh: NodeHandle) -> None:
        states, commands = JointStateInterface(), PositionJointInterface()
        state = states.register_handle(JointStateHandle(joint, math.nan))
        self._handle = commands.register_handle(JointHandle(state, supports_max_effort=True))
        self.register_interface(states)
        self.register_interface(commands)
        self._guard = JointLimitGuard(self, root_nh)

    def read(self, time_s: float, period_s: float) -> None:
        if self._gripper is None:
            return
        state, joint = self._gripper.state(), self._handle.state
        if not math.isfinite(state.stamp_s):  # the calibration has not finished
            return
        joint.position, joint.velocity = state.reading.position, 0.0 if state.fault else state.reading.velocity
        joint.stale = self._gripper.stale
        joint.effort = state.reading.load * TORQUE_MAX / FULL_TORQUE * self._full_effort
        self._missed_fault = state.last_fault if state.faults != self._fault_count else ""
        self._fault_count = state.faults
        if state.fault or self._missed_fault or not state.ready:
            self._handle.command = joint.position
            self._guard.reset()

    def write(self, time_s: float, period_s: float) -> None:
        if self._gripper is None or not self._gripper.state().ready:
            return
        self._guard.enforce(period_s)
        position = min(max(self._handle.command, 0.0), CLOSED_POSITION)
        self._gripper.command(position, self._max_torque())

    def _max_torque(self) -> int:
        """Returns the maximum torque allowed by the controller [servo units]."""
        if not self._handle.max_effort > 0.0:
            return self._default_torque
        return round(min(1.0, self._handle.max_effort / self._full_effort) * FULL_TORQUE)

    def fault(self) -> str:
        return (self._gripper.state().fault or self._missed_fault) if self._gripper is not None else ""

    def close(self) -> None:
        if self._gripper is not None:
            self._gripper.close()
