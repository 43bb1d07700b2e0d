# SPDX-License-Identifier: BSD-3-Clause
"""Base class of controllers, which are constructed without arguments, then initialized, started, updated and stopped.

`init` runs on a thread that may wait; `waiting`, `starting`, `update`, `stopping`, `aborting` and `failed` run in the
control loop and must not block. Start threads and processes in `init`, because a thread started in the control loop
inherits the loop's priority. A controller uses only the time passed to these methods, so that it behaves the same in
simulated and real time.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

from modular_framework_control.controller_interface.pid import Pid
from modular_framework_control.hardware_interface.interfaces import HardwareInterface
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_ros.node_handle import NodeHandle


class ControllerError(Exception):
    """A controller cannot be initialized or used as requested."""


class Controller:
    """Base class of all controllers.

    Attributes:
        interface_class: Hardware interface of the controller.
        robot_hw: Hardware, set before `init`, for controllers that need additional interfaces. All handles that `init`
            gets are claimed for the controller.
        pids: PIDs, set by `init`, by the namespace of their gains relative to the controller. The gains can be changed
            at runtime.
    """

    interface_class: ClassVar[type[HardwareInterface[Any]]]
    robot_hw: RobotHW = RobotHW()
    pids: Mapping[str, Pid] = MappingProxyType({})

    @property
    def moving(self) -> bool:
        """Whether the controller executes a goal or stops joints; simulated time must then not be paused."""
        return False

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        """Gets the joint handles and reads the parameters.

        Args:
            hw: Hardware interface of class `interface_class`; joints of requested handles are claimed.
            root_nh: Namespace of the robot.
            controller_nh: Namespace of the controller's parameters, topics and actions.

        Returns:
            Whether the controller can be used; prefer to raise an exception with the reason instead of returning False.
        """
        del hw, root_nh, controller_nh
        return True

    def waiting(self, time_s: float) -> None:
        """Runs in every cycle until the hardware is ready to start this controller."""

    def aborting(self, time_s: float) -> None:
        """Runs once instead of `starting` if the hardware refused the switch or took too long."""

    def starting(self, time_s: float) -> None:
        """Runs once before the first update after a start."""

    def update(self, time_s: float, period_s: float) -> None:
        """Runs one control cycle.

        Args:
            time_s: Time of this cycle.
            period_s: Time since the last cycle.
        """

    def stopping(self, time_s: float) -> None:
        """Runs once after the last update before a stop."""

    def interrupted(self, time_s: float, reason: str) -> None:
        """Runs instead of `stopping` before an immediate restart; results of active goals contain `reason`."""
        del reason
        self.stopping(time_s)

    def on_hardware_fault(self, time_s: float, reason: str) -> None:
        """Runs once when a hardware fault begins; ends goals, holds the joints and refuses new goals.

        `update` still runs in every cycle. If a controller starts during a fault, this method runs before the first
        update.

        Args:
            time_s: Time of this cycle.
            reason: Reason, for the results of active goals.
        """

    def on_hardware_recovered(self, time_s: float) -> None:
        """Runs once when a hardware fault ends; holds the measured positions, because the joints may have moved."""

    def failed(self, time_s: float, reason: str) -> None:
        """Runs instead of `stopping` if the controller raised; results of active goals contain `reason`."""
        del reason
        self.stopping(time_s)

    def close(self) -> None:
        """Runs once after the controller was unloaded, on a thread that may wait; closes resources opened in `init`."""
