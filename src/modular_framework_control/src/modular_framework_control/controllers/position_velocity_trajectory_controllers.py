# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory controllers for joints that take velocities, or velocities and accelerations, with their positions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from modular_framework_control.controllers.joint_trajectory_controller import JointTrajectoryController
from modular_framework_control.hardware_interface.interfaces import (
    HardwareInterface,
    PosVelAccJointInterface,
    PosVelJointInterface,
)
from modular_framework_control.trajectory.joint_trajectory import ACCELERATION, VELOCITY, Array


class PosVelJointTrajectoryController(JointTrajectoryController):
    """pos_vel_controllers/JointTrajectoryController: commands position [rad|m] and velocity [rad/s|m/s].

    Attributes:
        further_commands: attribute of a joint's handle that takes a command beside the position: row of the desired
            state that it is given.
    """

    interface_class: ClassVar[type[HardwareInterface[Any]]] = PosVelJointInterface
    further_commands: ClassVar[Mapping[str, int]] = {"command_velocity": VELOCITY}

    def _command(self, desired: Array, error: Array, period_s: float) -> None:
        super()._command(desired, error, period_s)
        for attribute, row in self.further_commands.items():
            for handle, value in zip(self._handles, desired[row].tolist(), strict=True):
                setattr(handle, attribute, value)

    def _command_rest(self) -> None:
        super()._command_rest()
        for attribute in self.further_commands:
            for handle in self._handles:
                setattr(handle, attribute, 0.0)


class PosVelAccJointTrajectoryController(PosVelJointTrajectoryController):
    """pos_vel_acc_controllers/JointTrajectoryController: commands acceleration [rad/s^2|m/s^2] besides."""

    interface_class = PosVelAccJointInterface
    further_commands: ClassVar[Mapping[str, int]] = {
        "command_velocity": VELOCITY,
        "command_acceleration": ACCELERATION,
    }
