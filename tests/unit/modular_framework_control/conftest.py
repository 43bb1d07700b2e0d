# SPDX-License-Identifier: BSD-3-Clause
"""A control loop with fake hardware, stepped by the test, for the tests of controllers."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

import pytest

from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.controller_manager.controller_manager import ControllerManager
from modular_framework_control.controller_manager.controller_types import ControllerTypes
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_ros.node_handle import MappingNodeHandle


class Loop:
    """Hardware and controller manager, advanced by `step`; requests of the service side run beside it.

    Attributes:
        fault_of_topics: raised where a controller's topics are to be opened, unless None.
    """

    def __init__(
        self,
        parameters: Mapping[str, Any],
        robot_hw: RobotHW | None = None,
        types: ControllerTypes | None = None,
        update_wait_s: float = 0.5,
    ) -> None:
        root = MappingNodeHandle(parameters)
        self.robot_hw = robot_hw if robot_hw is not None else MockRobotHW()
        assert self.robot_hw.init(root, root.child("hw"))
        self.controllers: dict[str, Controller] = {}
        self.fault_of_topics: Exception | None = None
        self.update_wait_s = update_wait_s
        self.manager = ControllerManager(self.robot_hw, root, types, attach=self._attach, update_wait_s=update_wait_s)
        self.time_s = 100.0
        self.period_s = 0.01

    def _attach(self, name: str, controller: Controller) -> Callable[[], None]:
        if self.fault_of_topics is not None:
            raise self.fault_of_topics
        self.controllers[name] = controller
        return lambda: None

    def step(self, cycles: int = 1) -> None:
        """Run some cycles."""
        for _ in range(cycles):
            self.robot_hw.read(self.time_s, self.period_s)
            self.manager.update(self.time_s, self.period_s)
            self.robot_hw.write(self.time_s, self.period_s)
            self.time_s += self.period_s

    def run(self, duration_s: float) -> None:
        """Run for some time [s]."""
        self.step(round(duration_s / self.period_s))

    def switch(self, start: list[str], stop: list[str], *arguments: Any) -> Exception | None:
        """Switch while the loop runs; returns what the switch raised."""
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
        """Load and start."""
        for name in names:
            self.manager.load_controller(name)
        assert self.switch(list(names), []) is None

    def states(self) -> dict[str, str]:
        """State by controller name."""
        return {report.info.name: report.state.value for report in self.manager.list_controllers()}


@pytest.fixture
def make_loop() -> type[Loop]:
    """The class of loops."""
    return Loop
