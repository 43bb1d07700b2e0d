# SPDX-License-Identifier: BSD-3-Clause
"""Shutdown of the control loop's node: the robot is brought to rest before anything waits for the network."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.ros import robot_hw_node
from modular_framework_ros.node_handle import MappingNodeHandle


class Noted:
    """Stands for whatever the node closes; notes it, and raises where the test says so."""

    def __init__(self, notes: list[str], name: str, raises: bool) -> None:
        self._notes, self._name, self._raises = notes, name, raises
        self.manager = self

    def connect(self) -> None:
        pass

    def wait(self, timeout_s: float, ended: threading.Event, fault: object) -> None:
        ended.wait()

    def stop_all(self) -> None:
        self._notes.append("controllers stop")

    def close(self) -> None:
        self._notes.append(f"{self._name} closes")
        if self._raises:
            raise OSError("no master")


class NotingHardware(MockRobotHW):
    """Notes what is written to it; raises in the last write when the test says so."""

    def __init__(self, notes: list[str], raises: bool) -> None:
        super().__init__()
        self._notes, self._raises = notes, raises

    def write(self, time_s: float, period_s: float) -> None:
        self._notes.append("write")
        if self._raises:
            raise OSError("no line")


@pytest.fixture
def run_node(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], list[str]]:
    def run(raises: bool) -> list[str]:
        notes: list[str] = []
        tree = MappingNodeHandle({"joints": ["a"], "real_time": False})
        monkeypatch.setattr(robot_hw_node, "RosNodeHandle", lambda namespace: tree)
        monkeypatch.setattr(robot_hw_node, "robot_hw_of_type", lambda name: NotingHardware(notes, raises))
        monkeypatch.setattr(robot_hw_node, "prepare_interpreter", lambda: None)
        for attribute, name in (
            ("HardwareReadiness", "readiness"),
            ("RosControllerManager", "manager"),
            ("LoopReport", "report"),
        ):

            def make(*arguments: Any, _name: str = name, **more: Any) -> Noted:
                return Noted(notes, _name, raises)

            monkeypatch.setattr(robot_hw_node, attribute, make)
        ended = threading.Event()
        ended.set()
        node = robot_hw_node.RobotHwNode(ended)
        node.connect()
        assert node.run()
        return notes

    return run


@pytest.mark.parametrize("raises", [False, True])
def test_controllers_stop_and_the_robot_is_written_to_before_anything_is_closed(
    run_node: Callable[[bool], list[str]], raises: bool
) -> None:
    assert run_node(raises) == ["controllers stop", "write", "readiness closes", "manager closes", "report closes"]
