# SPDX-License-Identifier: BSD-3-Clause
"""Conformance suite of controllers, with what the control loop and its users require of every controller.

To use the suite, define in a test module a subclass of `ControllerConformance` whose name starts with Test, and set
`controller` and `parameters`. The suite runs the controller on mock hardware with the command interface of the
controller. No topics are opened, so that the tests need no ROS master.
"""

from __future__ import annotations

import math
import statistics
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import pytest

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.controller_manager.controller_types import ControllerTypes
from modular_framework_control.hardware_interface.interfaces import COMMAND_INTERFACES
from modular_framework_testing.control.movable_robot_hw import MovableRobotHW
from modular_framework_testing.control.stepped_loop import SteppedLoop

NAME, TYPE = "tested", "tested_package/TestedController"
START_POSITIONS = (0.0, 0.7, -1.1)
"""Initial positions of the first joint; each further joint is at 0.3 less [rad or m]."""
REST_S = 1.0
MAX_MEDIAN_UPDATE_S = 0.001
"""Maximum median duration of an update, a quarter of the period at 250 Hz [s]."""


class ControllerConformance:
    """Tests of one controller.

    Attributes:
        controller: Class of the controller.
        parameters: Parameters of the controller, as in a controller file without `type`.
        joints: Joints of the hardware.
        joint_parameter: Name of the parameter that lists the joints; empty if the controller has none.
        tolerance: Allowed motion of an idle joint [rad or m].
    """

    controller: ClassVar[type[Controller]]
    parameters: ClassVar[Mapping[str, Any]] = {}
    joints: ClassVar[Sequence[str]] = ("joint_1", "joint_2")
    joint_parameter: ClassVar[str] = "joints"
    tolerance: ClassVar[float] = 1e-3

    @pytest.mark.parametrize("position", START_POSITIONS)
    def test_a_start_moves_no_joint(self, position: float) -> None:
        """Without a goal, each joint stays where the controller found it."""
        loop = self._started_loop(position)
        before = self._positions(loop)
        self._run(loop, REST_S)
        np.testing.assert_allclose(self._positions(loop), before, atol=self.tolerance)

    def test_a_second_start_holds_the_joints_where_they_are_then(self) -> None:
        """Joints that were moved while the controller was stopped do not go back."""
        loop = self._started_loop(0.2)
        self._run(loop, 0.1)
        assert loop.switch([], [NAME]) is None
        moved = [0.6 - 0.3 * index for index in range(len(self.joints))]
        self._move_by_hand(loop, moved)
        assert loop.switch([NAME], []) is None
        loop.robot_hw.by_hand = None
        self._run(loop, REST_S)
        np.testing.assert_allclose(self._positions(loop), moved, atol=self.tolerance)

    def test_joints_moved_during_a_fault_stay_there_afterwards(self) -> None:
        """After a hardware fault, the controller holds the measured positions."""
        loop = self._started_loop(0.2)
        self._run(loop, 0.1)
        loop.robot_hw.reason = "emergency stop"
        moved = [0.5 - 0.3 * index for index in range(len(self.joints))]
        self._move_by_hand(loop, moved)
        loop.robot_hw.reason = ""
        loop.step(2)
        loop.robot_hw.by_hand = None
        self._run(loop, REST_S)
        np.testing.assert_allclose(self._positions(loop), moved, atol=self.tolerance)

    def test_the_controller_uses_only_the_time_of_its_cycles(self) -> None:
        """Cycles that come late in real time give the same commands, as in a slow simulation."""
        commands: list[list[list[float]]] = []
        for pause_s in (0.0, 0.005):
            loop = self._started_loop(0.4)
            rows = []
            for _ in range(20):
                time.sleep(pause_s)
                loop.step()
                rows.append([handle.command for handle in loop.robot_hw.joints])
            commands.append(rows)
        np.testing.assert_array_equal(commands[0], commands[1])

    def test_an_update_does_not_block_the_loop(self) -> None:
        """The median update takes at most `MAX_MEDIAN_UPDATE_S`."""
        loop = self._started_loop(0.0)
        controller = loop.controllers[NAME]
        durations_s = []
        for _ in range(100):
            loop.step()
            begin_s = time.perf_counter()
            controller.update(loop.time_s, loop.period_s)
            durations_s.append(time.perf_counter() - begin_s)
        assert statistics.median(durations_s) <= MAX_MEDIAN_UPDATE_S

    def test_a_joint_that_does_not_exist_is_an_error_with_its_name(self) -> None:
        """The controller is not loaded, and the error names the joint."""
        if not self.joint_parameter:
            pytest.skip("the controller has no parameter that lists joints")
        value: Any = "missing_joint"
        if not isinstance(self.parameters.get(self.joint_parameter), str):
            value = [value]
        loop = self._loop(0.0, {self.joint_parameter: value})
        with pytest.raises(ControllerError, match="missing_joint"):
            loop.manager.load_controller(NAME)

    def test_an_unloaded_controller_leaves_no_thread(self) -> None:
        """Threads that `init` starts end in `close`."""
        before = set(threading.enumerate())
        loop = self._started_loop(0.0)
        self._run(loop, 0.1)
        assert loop.switch([], [NAME]) is None
        loop.manager.unload_controller(NAME)
        left = [thread for thread in threading.enumerate() if thread not in before]
        for thread in left:
            thread.join(1.0)
        assert not [thread.name for thread in left if thread.is_alive()]

    def _loop(self, position: float, more: Mapping[str, Any] | None = None) -> SteppedLoop:
        interface = self.controller.interface_class
        hardware = {
            "joints": list(self.joints),
            "initial_positions": {name: position - 0.3 * index for index, name in enumerate(self.joints)},
            "command_interface": (interface if interface in COMMAND_INTERFACES else COMMAND_INTERFACES[0]).__name__,
        }
        types = ControllerTypes({})
        types.register(TYPE, self.controller)
        controller = {"type": TYPE, **self.parameters, **(more or {})}
        return SteppedLoop({"hw": hardware, NAME: controller}, MovableRobotHW(), types)

    def _started_loop(self, position: float) -> SteppedLoop:
        loop = self._loop(position)
        loop.step()
        loop.spawn(NAME)
        return loop

    def _run(self, loop: SteppedLoop, duration_s: float) -> None:
        """Runs the loop and checks in each cycle that all commands are finite."""
        for _ in range(round(duration_s / loop.period_s)):
            loop.step()
            for handle in loop.robot_hw.joints:
                assert math.isfinite(handle.command), f"{handle.name}: command {handle.command}"

    @staticmethod
    def _positions(loop: SteppedLoop) -> list[float]:
        return [handle.state.position for handle in loop.robot_hw.joints]

    @staticmethod
    def _move_by_hand(loop: SteppedLoop, positions: list[float]) -> None:
        loop.robot_hw.by_hand = positions
        loop.step(3)
