# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory controllers that command velocities, and optionally accelerations, together with positions."""

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
    """pos_vel_controllers/JointTrajectoryController, which commands position [rad|m] and velocity [rad/s|m/s].

    Attributes:
        further_commands: Row of the desired state for each additional command attribute of a joint handle.
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
    """pos_vel_acc_controllers/JointTrajectoryController, which also commands acceleration [rad/s^2|m/s^2]."""

    interface_class = PosVelAccJointInterface
    further_commands: ClassVar[Mapping[str, int]] = {
        "command_velocity": VELOCITY,
        "command_acceleration": ACCELERATION,
    }
