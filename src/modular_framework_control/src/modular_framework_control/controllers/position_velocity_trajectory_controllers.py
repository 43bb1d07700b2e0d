# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory controllers for joints that take velocities, or velocities and accelerations, with their positions."""

from __future__ import annotations

from typing import Any, ClassVar

from modular_framework_control.controllers.joint_trajectory_controller import JointTrajectoryController
from modular_framework_control.hardware_interface.interfaces import (
    HardwareInterface,
    PosVelAccJointInterface,
    PosVelJointInterface,
)
from modular_framework_control.trajectory.joint_trajectory import ACCELERATION, VELOCITY, Array


class PosVelJointTrajectoryController(JointTrajectoryController):
    """pos_vel_controllers/JointTrajectoryController: commands position [rad|m] and velocity [rad/s|m/s]."""

    interface_class: ClassVar[type[HardwareInterface[Any]]] = PosVelJointInterface

    def _command(self, desired: Array, error: Array, period_s: float) -> None:
        super()._command(desired, error, period_s)
        for handle, velocity in zip(self._handles, desired[VELOCITY].tolist(), strict=True):
            handle.command_velocity = velocity

    def _command_rest(self) -> None:
        super()._command_rest()
        for handle in self._handles:
            handle.command_velocity = 0.0


class PosVelAccJointTrajectoryController(PosVelJointTrajectoryController):
    """pos_vel_acc_controllers/JointTrajectoryController: commands acceleration [rad/s^2|m/s^2] besides."""

    interface_class = PosVelAccJointInterface

    def _command(self, desired: Array, error: Array, period_s: float) -> None:
        super()._command(desired, error, period_s)
        for handle, acceleration in zip(self._handles, desired[ACCELERATION].tolist(), strict=True):
            handle.command_acceleration = acceleration

    def _command_rest(self) -> None:
        super()._command_rest()
        for handle in self._handles:
            handle.command_acceleration = 0.0
