# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory controllers that close the position loop of velocity- or effort-controlled joints with a PID."""

from __future__ import annotations

from typing import Any

from modular_framework_control.controller_interface.pid import read_pid
from modular_framework_control.controllers.joint_trajectory_controller import JointTrajectoryController
from modular_framework_control.hardware_interface.interfaces import EffortJointInterface, VelocityJointInterface
from modular_framework_control.trajectory.joint_trajectory import POSITION, VELOCITY, Array
from modular_framework_ros.node_handle import NodeHandle, read_number


class _ClosedLoopTrajectoryController(JointTrajectoryController):
    """Commands `velocity_ff * desired velocity + PID(position error, velocity error)` per joint.

    Parameters, in addition to JointTrajectoryController: `gains/<joint>/{p, i, d, i_clamp, i_clamp_min, i_clamp_max,
    antiwindup}`; `velocity_ff/<joint>` 0. The command is 0 while the controller is stopped or the hardware has a fault.
    """

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        super().init(hw, root_nh, controller_nh)
        self.pids = {f"gains/{name}": read_pid(controller_nh.child(f"gains/{name}")) for name in self.joint_names}
        feedforward = controller_nh.child("velocity_ff")
        self._velocity_ff = [read_number(feedforward, name, 0.0, None) for name in self.joint_names]
        return True

    def _command_rest(self) -> None:
        for handle, pid in zip(self._handles, self.pids.values(), strict=True):
            pid.reset()
            handle.command = 0.0

    def _command(self, desired: Array, error: Array, period_s: float) -> None:
        for handle, pid, feedforward, velocity, position_error, velocity_error in zip(
            self._handles,
            self.pids.values(),
            self._velocity_ff,
            desired[VELOCITY].tolist(),
            error[POSITION].tolist(),
            error[VELOCITY].tolist(),
            strict=True,
        ):
            handle.command = feedforward * velocity + pid.command(position_error, velocity_error, period_s)


class VelocityJointTrajectoryController(_ClosedLoopTrajectoryController):
    """velocity_controllers/JointTrajectoryController, with gains in [1/s] (p), [1/s^2] (i), [1] (d, velocity_ff)."""

    interface_class = VelocityJointInterface


class EffortJointTrajectoryController(_ClosedLoopTrajectoryController):
    """effort_controllers/JointTrajectoryController, with gains in [Nm/rad] (p), [Nm/(rad s)] (i), [Nm s/rad] (d)."""

    interface_class = EffortJointInterface
