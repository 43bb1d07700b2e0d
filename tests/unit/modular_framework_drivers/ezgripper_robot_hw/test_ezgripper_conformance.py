# SPDX-License-Identifier: BSD-3-Clause
"""The conformance suite of `RobotHW` over an EZGripper against its emulator, alone and with another hardware."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar

import pytest

from modular_framework_control.hardware_interface.combined_robot_hw import CombinedRobotHW
from modular_framework_control.hardware_interface.joint_limits import JointLimits
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.hardware_interface.robot_hw_conformance import RobotHWConformance
from modular_framework_drivers.ezgripper.ezgripper_robot_hw import EzGripperRobotHW
from modular_framework_ros.node_handle import MappingNodeHandle
from modular_framework_testing.emulators.dynamixel_finger import Finger, FingerModel
from modular_framework_testing.emulators.dynamixel_line import DynamixelLine
from modular_framework_testing.emulators.dynamixel_servo import DynamixelServo

JOINT = "ezgripper_knuckle_palm_L1_1"

KNUCKLE = {"has_velocity_limits": True, "max_velocity": 2.0}
SHOULDER = {**KNUCKLE, "has_position_limits": True, "min_position": -1.0, "max_position": 1.0}


def started_line(folder: Path) -> DynamixelLine:
    """An open gripper on a pseudo-terminal in `folder`."""
    folder.mkdir(exist_ok=True)
    finger = Finger(DynamixelServo(), FingerModel(top_speed=12000.0, time_constant_s=0.015), opening=200.0)
    line = DynamixelLine([finger], folder / "gripper")
    line.connect()
    return line


def calibrated(robot_hw: RobotHW) -> RobotHW:
    """The hardware, once its gripper is calibrated and has been read."""
    end_s = time.monotonic() + 15.0
    while not robot_hw.initialised:
        assert time.monotonic() < end_s, robot_hw.fault()
        time.sleep(0.01)
    robot_hw.read(0.0, 0.0)
    return robot_hw


class TestEzGripper(RobotHWConformance):
    """A gripper whose servo is emulated on a pseudo-terminal."""

    period_s = 0.008
    settle_s = 0.6
    jump = 1.0
    real_time = True
    close_after_test = False
    robot_hw: ClassVar[RobotHW]

    @pytest.fixture(autouse=True, scope="class")
    @classmethod
    def robot_hw_of_all(cls, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
        line = started_line(tmp_path_factory.mktemp("line"))
        cls.robot_hw = cls.initialised({"port_name": str(line.link), "start_position": 1.7, "link_timeout": 0.5}, {})
        yield
        cls.robot_hw.close()
        cls.robot_hw.close()
        line.close()

    @pytest.fixture(autouse=True)
    def lines(self, tmp_path: Path) -> Iterator[None]:
        self._folder = tmp_path
        self._lines: list[DynamixelLine] = []
        yield
        for line in self._lines:
            line.close()

    @classmethod
    def initialised(cls, gripper: Mapping[str, Any], arm: Mapping[str, float]) -> RobotHW:
        """The hardware, with these parameters of the gripper and positions of the arm."""
        del arm
        root = MappingNodeHandle({"hand": gripper, "joint_limits": {JOINT: KNUCKLE}})
        robot_hw = EzGripperRobotHW()
        assert robot_hw.init(root, root.child("hand"))
        return calibrated(robot_hw)

    def make_robot_hw(self, positions: Mapping[str, float] | None = None) -> RobotHW:
        if positions is None:
            return self.robot_hw
        self._lines.append(started_line(self._folder / str(len(self._lines))))
        settings = {"port_name": str(self._lines[-1].link), "start_position": positions[JOINT], "link_timeout": 0.5}
        return self.initialised(settings, {name: value for name, value in positions.items() if name != JOINT})

    def limits(self) -> Mapping[str, JointLimits]:
        return {JOINT: JointLimits(0.0, 1.94, 2.0)}


class TestCombination(TestEzGripper):
    """An arm and a gripper of two kinds as one robot: the one fake, the other with its emulated servo."""

    @classmethod
    def initialised(cls, gripper: Mapping[str, Any], arm: Mapping[str, float]) -> RobotHW:
        positions = dict(arm or {"shoulder": 0.5})
        root = MappingNodeHandle(
            {
                "robot_hardware": ["arm", "hand"],
                "arm": {"type": "lab/Mock", "joints": ["shoulder", "elbow"], "initial_positions": positions},
                "hand": {"type": "lab/Hand", **gripper},
                "joint_limits": {**dict.fromkeys(("shoulder", "elbow"), SHOULDER), JOINT: KNUCKLE},
            }
        )
        kinds: dict[str, type[RobotHW]] = {"lab/Mock": MockRobotHW, "lab/Hand": EzGripperRobotHW}
        robot_hw = CombinedRobotHW(lambda name: kinds[name]())
        assert robot_hw.init(root, root)
        return calibrated(robot_hw)

    def limits(self) -> Mapping[str, JointLimits]:
        return {**super().limits(), **dict.fromkeys(("shoulder", "elbow"), JointLimits(-1.0, 1.0, 2.0))}
