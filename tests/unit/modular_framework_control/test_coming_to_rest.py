# SPDX-License-Identifier: BSD-3-Clause
"""After its controllers stopped, the control loop's node writes commands until all joints are at rest, or too long."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.ros import robot_hw_node
from modular_framework_control.ros.robot_hw_node import RobotHwNode, is_moving
from modular_framework_ros.node_handle import MappingNodeHandle

RATE = 125.0
ACCELERATION = 20.0


class WatchedHardware(MockRobotHW):
    """Notes what is written to it; `noise` [rad/s] is measured on top of the velocity."""

    noise = 0.0
    raises = ""

    def __init__(self) -> None:
        super().__init__()
        self.written: list[float] = []
        self.left_by_controllers = False

    def read(self, time_s: float, period_s: float) -> None:
        if self.raises == "read":
            raise OSError("no line")
        super().read(time_s, period_s)
        for handle in self._handles:
            handle.state.velocity += self.noise

    def write(self, time_s: float, period_s: float) -> None:
        super().write(time_s, period_s)
        self.written.append(self._handles[0].command)


class Manager:
    """Stands for the controllers, of which one was commanding `command`."""

    def __init__(self, robot_hw: WatchedHardware) -> None:
        self._robot_hw = robot_hw
        self.manager = self

    def connect(self) -> None:
        pass

    def stop_all(self) -> None:
        self._robot_hw.interfaces[1].handles[0].command = 0.0

    def close(self) -> None:
        self._robot_hw.left_by_controllers = True


class Nothing:
    """Stands for what the node opens besides."""

    def connect(self) -> None:
        pass

    def wait(self, timeout_s: float, ended: threading.Event, fault: object) -> None:
        ended.wait()

    def close(self) -> None:
        pass


@pytest.fixture
def make_node(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[RobotHwNode, WatchedHardware]]:
    def make(velocity: float = 0.0) -> tuple[RobotHwNode, WatchedHardware]:
        robot_hw = WatchedHardware()
        tree = MappingNodeHandle(
            {
                "joints": ["a"],
                "command_interface": "VelocityJointInterface",
                "real_time": False,
                "rate": RATE,
                "joint_limits": {"a": {"has_acceleration_limits": True, "max_acceleration": ACCELERATION}},
            }
        )
        monkeypatch.setattr(robot_hw_node, "RosNodeHandle", lambda namespace: tree)
        monkeypatch.setattr(robot_hw_node, "robot_hw_of_type", lambda name: robot_hw)
        monkeypatch.setattr(robot_hw_node, "prepare_interpreter", lambda: None)
        monkeypatch.setattr(robot_hw_node, "RosControllerManager", lambda *arguments, **more: Manager(robot_hw))
        for name in ("HardwareReadiness", "LoopReport"):
            monkeypatch.setattr(robot_hw_node, name, lambda *arguments: Nothing())
        ended = threading.Event()
        ended.set()
        node = RobotHwNode(ended)
        node.connect()
        for _ in range(20):
            robot_hw.read(0.0, 1.0 / RATE)
            robot_hw.interfaces[1].handles[0].command = velocity
            robot_hw.write(0.0, 1.0 / RATE)
        robot_hw.read(0.0, 1.0 / RATE)
        robot_hw.written.clear()
        return node, robot_hw

    return make


def test_a_moving_joint_is_braked_by_its_limits_until_it_is_at_rest(make_node: Callable[..., Any]) -> None:
    node, robot_hw = make_node(1.0)
    assert is_moving(robot_hw, 0.5) and not moves_after(node, robot_hw)
    steps = [before - after for before, after in zip([1.0, *robot_hw.written], robot_hw.written, strict=False)]
    assert max(steps) <= ACCELERATION / RATE + 1e-9
    assert robot_hw.written[-1] == 0.0
    assert len(robot_hw.written) <= 10, "it is at rest after 7 cycles"


def moves_after(node: RobotHwNode, robot_hw: WatchedHardware) -> bool:
    assert node.run()
    assert robot_hw.left_by_controllers
    return is_moving(robot_hw, 0.0)


def test_a_robot_at_rest_is_written_to_once(make_node: Callable[..., Any]) -> None:
    node, robot_hw = make_node()
    assert not moves_after(node, robot_hw)
    assert robot_hw.written == [0.0]


def test_a_robot_whose_velocities_are_never_0_is_believed_after_a_while(make_node: Callable[..., Any]) -> None:
    node, robot_hw = make_node(1.0)
    robot_hw.noise = 1e-3
    assert moves_after(node, robot_hw)
    assert 10 < len(robot_hw.written) <= robot_hw_node.MIN_WRITE_TIME_S * RATE + 2


def test_a_robot_that_does_not_stop_is_not_waited_for_without_end(
    make_node: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot_hw_node, "MAX_END_TIME_S", 0.3)
    node, robot_hw = make_node(1.0)
    robot_hw.noise = 1.0
    begun_s = time.monotonic()
    assert moves_after(node, robot_hw)
    assert 0.3 <= time.monotonic() - begun_s < 10.0


def test_hardware_that_raises_is_asked_no_more(make_node: Callable[..., Any]) -> None:
    node, robot_hw = make_node(1.0)
    robot_hw.raises = "read"
    assert moves_after(node, robot_hw)
    assert len(robot_hw.written) == 1
