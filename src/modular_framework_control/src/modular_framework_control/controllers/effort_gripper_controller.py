# SPDX-License-Identifier: BSD-3-Clause
"""Gripper controller for an effort-controlled joint: a PID on the position error with bounded effort."""

from __future__ import annotations

from typing import Any

from modular_framework_control.controller_interface.pid import read_pid
from modular_framework_control.controllers.gripper_action_controller import GripperActionController
from modular_framework_control.hardware_interface.interfaces import EffortJointInterface
from modular_framework_control.realtime.goal_handle import GoalStatus
from modular_framework_ros.node_handle import NodeHandle


class EffortGripperActionController(GripperActionController):
    """effort_controllers/GripperActionController.

    Parameters, in addition to GripperActionController: `gains/<joint>/{p, i, d, i_clamp, ...}`. The effort is bounded
    by the goal's `max_effort`, else by the parameter `max_effort`, else only by the hardware. The effort is 0 while the
    controller is stopped or the hardware has a fault.
    """

    interface_class = EffortJointInterface

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        super().init(hw, root_nh, controller_nh)
        gains = f"gains/{self._handle.name}"
        self._pid = read_pid(controller_nh.child(gains))
        self.pids = {gains: self._pid}
        return True

    def starting(self, time_s: float) -> None:
        self._pid.reset()
        super().starting(time_s)

    def _end_goals(self, status: GoalStatus, text: str) -> None:
        super()._end_goals(status, text)
        self._handle.command = 0.0

    def _apply(self, period_s: float) -> None:
        handle = self._handle
        if self._fault:
            self._pid.reset()
            handle.command = 0.0
            return
        effort = self._pid.command(self._command - handle.position, -handle.velocity, period_s)
        if self._max_effort > 0.0:
            effort = min(max(effort, -self._max_effort), self._max_effort)
        handle.command = effort
