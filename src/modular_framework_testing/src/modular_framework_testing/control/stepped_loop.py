# SPDX-License-Identifier: BSD-3-Clause
"""A control loop that a test advances cycle by cycle."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.controller_manager.controller_manager import ControllerManager
from modular_framework_control.controller_manager.controller_types import ControllerTypes
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_ros.node_handle import MappingNodeHandle


class SteppedLoop:
    """Hardware and controller manager, advanced by `step`.

    Args:
        parameters: Parameters of the root namespace; those of the hardware are in `hw`, those of a controller in its
            name.
        robot_hw: Hardware; None for `MockRobotHW`.
        types: Controller classes by type; None for the built-in classes and those of packages.
        update_wait_s: Maximum duration of a switch without a cycle [s].

    Attributes:
        controllers: Loaded controllers by name.
        topics_error: Exception raised when the topics of a controller are opened; None to raise nothing.
        period_s: Period of the loop [s].
        time_s: Time of the next cycle [s].
    """

    def __init__(
        self,
        parameters: Mapping[str, Any],
        robot_hw: RobotHW | None = None,
        types: ControllerTypes | None = None,
        update_wait_s: float = 0.5,
    ) -> None:
        root = MappingNodeHandle(parameters)
        self.robot_hw: Any = robot_hw if robot_hw is not None else MockRobotHW()
        if not self.robot_hw.init(root, root.child("hw")):
            raise ValueError("the hardware refuses its parameters; the log gives the reason")
        self.controllers: dict[str, Any] = {}
        self.topics_error: Exception | None = None
        self.update_wait_s = update_wait_s
        self.manager = ControllerManager(self.robot_hw, root, types, attach=self._attach, update_wait_s=update_wait_s)
        self.time_s = 100.0
        self.period_s = 0.01

    def _attach(self, name: str, controller: Controller) -> Callable[[], None]:
        if self.topics_error is not None:
            raise self.topics_error
        self.controllers[name] = controller
        return lambda: None

    def step(self, cycles: int = 1) -> None:
        """Runs some cycles."""
        for _ in range(cycles):
            self.robot_hw.read(self.time_s, self.period_s)
            self.manager.update(self.time_s, self.period_s)
            self.robot_hw.write(self.time_s, self.period_s)
            self.time_s += self.period_s

    def run(self, duration_s: float) -> None:
        """Runs for some time [s]."""
        self.step(round(duration_s / self.period_s))

    def switch(self, start: list[str], stop: list[str], *arguments: Any) -> Exception | None:
        """Starts and stops controllers while the loop runs; returns the exception of the switch.

        Args:
            start: Names of the controllers to start.
            stop: Names of the controllers to stop.
            arguments: Further arguments of `ControllerManager.switch_controller`.
        """
        raised: list[Exception | None] = []

        def ask() -> None:
            try:
                self.manager.switch_controller(start, stop, *arguments)
                raised.append(None)
            except Exception as error:
                raised.append(error)

        thread = threading.Thread(target=ask)
        thread.start()
        while thread.is_alive():
            self.step()
            thread.join(0.002)
        return raised[0]

    def spawn(self, *names: str) -> None:
        """Loads and starts controllers; raises the exception of the switch."""
        for name in names:
            self.manager.load_controller(name)
        error = self.switch(list(names), [])
        if error is not None:
            raise error

    def states(self) -> dict[str, str]:
        """Returns the state of each controller, by name."""
        return {report.info.name: report.state.value for report in self.manager.list_controllers()}
