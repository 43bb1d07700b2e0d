# SPDX-License-Identifier: BSD-3-Clause
"""An EZGripper as a `RobotHW`, alone or combined with an arm."""

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
    """modular_framework_drivers/EzGripperRobotHW: one joint, commanded by position, its effort bounded on request.

    `init` begins to connect and calibrate the gripper, which closes it; `initialised` is true once it has been at its
    start position. A fault of the link or of the motor is `fault()`; the gripper comes back by itself and then stands
    still until it is commanded.

    Parameters: see `parameters/EzGripperRobotHW.yaml`; limits come from `robot_description` and from
    `joint_limits`, when they are there.
    """

    def __init__(self) -> None:
        super().__init__()
        self._gripper: EzGripper | None = None
        self._faults, self._missed = 0, ""

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
        if not math.isfinite(state.stamp_s):  # nothing is measured before the calibration
            return
        joint.position, joint.velocity = state.reading.position, 0.0 if state.fault else state.reading.velocity
        joint.stale = self._gripper.stale
        joint.effort = state.reading.load * TORQUE_MAX / FULL_TORQUE * self._full_effort
        self._missed = state.last_fault if state.faults != self._faults else ""
        self._faults = state.faults
        if state.fault or self._missed or not state.ready:
            self._handle.command = joint.position
            self._guard.reset()

    def write(self, time_s: float, period_s: float) -> None:
        if self._gripper is None or not self._gripper.state().ready:
            return
        self._guard.enforce(period_s)
        position = min(max(self._handle.command, 0.0), CLOSED_POSITION)
        self._gripper.command(position, self._torque())

    def _torque(self) -> int:
        """The greatest torque the controller allows [units of the servo]."""
        if not self._handle.max_effort > 0.0:
            return self._default_torque
        return round(min(1.0, self._handle.max_effort / self._full_effort) * FULL_TORQUE)

    def fault(self) -> str:
        return (self._gripper.state().fault or self._missed) if self._gripper is not None else ""

    def close(self) -> None:
        if self._gripper is not None:
            self._gripper.close()
