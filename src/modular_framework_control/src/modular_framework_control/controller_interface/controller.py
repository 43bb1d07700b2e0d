# SPDX-License-Identifier: BSD-3-Clause
"""What every controller is: a class made without arguments that is initialised, started, updated and stopped.

`init` runs on a thread that may wait; `waiting`, `starting`, `update`, `stopping`, `aborting` and `failed` run in the
control loop and must not block. What is started there inherits the priority of the loop, so start threads and processes
in `init`. All time a controller knows is the time it is given there, so that it behaves alike under simulated and real
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
        robot_hw: the hardware, set before `init`, for who needs another interface besides; what is asked of any of its
            interfaces in `init` is claimed for this controller.
        pids: set by `init` of those that have gains, by the namespace, below the controller's name, in which the gains
            are found and can be adjusted while the controller runs.
    """

    interface_class: ClassVar[type[HardwareInterface[Any]]]
    robot_hw: RobotHW = RobotHW()
    pids: Mapping[str, Pid] = MappingProxyType({})

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        """Get the joint handles and read the parameters.

        Args:
            hw: the interface of class `interface_class`; the joints asked of it are claimed for this controller.
            root_nh: namespace of the robot.
            controller_nh: namespace of this controller's own parameters, topics and actions.

        Returns:
            Whether the controller can be used. Raising an exception that says why not is preferred over False.
        """
        del hw, root_nh, controller_nh
        return True

    def waiting(self, time_s: float) -> None:
        """Called in every cycle in which the hardware is not ready yet for this controller, which is to start."""

    def aborting(self, time_s: float) -> None:
        """Called once in place of `starting` when the hardware refused the switch or took longer than allowed."""

    def starting(self, time_s: float) -> None:
        """Called once before the first update after a start."""

    def update(self, time_s: float, period_s: float) -> None:
        """One control cycle.

        Args:
            time_s: time of this cycle [s].
            period_s: time since the last cycle [s].
        """

    def stopping(self, time_s: float) -> None:
        """Called once after the last update before a stop."""

    def on_hardware_fault(self, time_s: float, reason: str) -> None:
        """Called once when hardware whose joints it commands cannot follow: end goals, hold, refuse new ones.

        `update` goes on being called. A controller that is started meanwhile is told before its first update.

        Args:
            time_s: time of this cycle [s].
            reason: for whoever waits for a result.
        """

    def on_hardware_recovered(self, time_s: float) -> None:
        """Called once when the hardware can follow again; it may stand elsewhere: hold it where it is measured."""

    def failed(self, time_s: float, reason: str) -> None:
        """Called in place of `stopping` when this controller raised; `reason` is for whoever waits for a result."""
        del reason
        self.stopping(time_s)

    def close(self) -> None:
        """Called once, after the controller was unloaded, on a thread that may wait: close what `init` opened."""
