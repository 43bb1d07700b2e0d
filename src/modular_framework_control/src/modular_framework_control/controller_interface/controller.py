# SPDX-License-Identifier: BSD-3-Clause
"""Base class of controllers: made without arguments, then initialised, started, updated and stopped.

`init` runs on a thread that may wait; `waiting`, `starting`, `update`, `stopping`, `aborting` and `failed` run in the
control loop and must not block. A thread started there inherits the loop's priority, so start threads and processes
in `init`. A controller uses only the time passed to these methods, so that it behaves alike under simulated and real
time.
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
    """A controller cannot be set up or used as asked."""


class Controller:
    """Base of all controllers.

    Attributes:
        interface_class: the hardware interface this controller works on.
        robot_hw: the hardware, set before `init`, for controllers that need a second interface; the handles that `init`
            gets from any of its interfaces are claimed for this controller.
        pids: set by `init` of controllers with gains; the keys are the namespaces of the gains below the controller's
            name, in which they can be changed while the controller runs.
    """

    interface_class: ClassVar[type[HardwareInterface[Any]]]
    robot_hw: RobotHW = RobotHW()
    pids: Mapping[str, Pid] = MappingProxyType({})

    @property
    def moving(self) -> bool:
        """Whether it carries out a goal or brings the joints to rest: simulated time must pass for it."""
        return False

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        """Gets the joint handles and reads the parameters.

        Args:
            hw: the interface of class `interface_class`; the joints of the handles that are taken are claimed.
            root_nh: namespace of the robot.
            controller_nh: namespace of this controller's own parameters, topics and actions.

        Returns:
            Whether the controller can be used. An exception with the reason is better than False.
        """
        del hw, root_nh, controller_nh
        return True

    def waiting(self, time_s: float) -> None:
        """Called in every cycle in which the hardware is not yet ready to start this controller."""

    def aborting(self, time_s: float) -> None:
        """Called once instead of `starting` if the hardware refused the switch or took too long."""

    def starting(self, time_s: float) -> None:
        """Called once before the first update after a start."""

    def update(self, time_s: float, period_s: float) -> None:
        """Runs one control cycle.

        Args:
            time_s: time of this cycle [s].
            period_s: time since the last cycle [s].
        """

    def stopping(self, time_s: float) -> None:
        """Called once after the last update before a stop."""

    def interrupted(self, time_s: float, reason: str) -> None:
        """Called instead of `stopping` where it is started again at once; `reason` is for the results of its goals."""
        del reason
        self.stopping(time_s)

    def on_hardware_fault(self, time_s: float, reason: str) -> None:
        """Called once when the hardware of its joints cannot follow: end goals, hold, refuse new ones.

        `update` is still called in every cycle. For a controller that starts during a fault this is called before its
        first update.

        Args:
            time_s: time of this cycle [s].
            reason: for the results of the goals.
        """

    def on_hardware_recovered(self, time_s: float) -> None:
        """Called once when the hardware can follow again; the joints may have moved, so hold the measured positions."""

    def failed(self, time_s: float, reason: str) -> None:
        """Called instead of `stopping` if this controller raised; `reason` is for the results of its goals."""
        del reason
        self.stopping(time_s)

    def close(self) -> None:
        """Called once after the controller was unloaded, on a thread that may wait; closes what `init` opened."""
