# SPDX-License-Identifier: BSD-3-Clause
"""The suite of all hardware, on an EZGripper with emulated servos."""
from __future__ import annotations

import time
from collections.abc import Iterator, Mapping

import pytest

from modular_framework_control.joint_limits import JointLimits
from modular_framework_control.node_handle import MappingNodeHandle
from modular_framework_control.robot_hw import RobotHW
from modular_framework_control.robot_hw_conformance import RobotHWConformance
from modular_framework_drivers.emulators.dynamixel_finger import Finger, FingerModel
from modular_framework_drivers.emulators.dynamixel_line import DynamixelLine
from modular_framework_drivers.emulators.dynamixel_servo import DynamixelServo
from modular_framework_drivers.ezgripper.ezgripper_robot_hw import JOINT, EzGripperRobotHW


class PacedEzGripper(EzGripperRobotHW):
    """The hardware in a loop that nobody else keeps to its beat."""

    def write(self, time_s: float, period_s: float) -> None:
        super().write(time_s, period_s)
        time.sleep(period_s)


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DynamixelLine]:
    finger = Finger(DynamixelServo(), FingerModel(top_speed=12000.0, time_constant_s=0.015), opening=200.0)
    made = DynamixelLine([finger], tmp_path_factory.mktemp("line") / "gripper")
    made.connect()
    yield made
    made.close()


class TestEzGripper(RobotHWConformance):
    period_s = 0.008
    settle_s = 0.6

    @pytest.fixture(autouse=True)
    def gripper(self, line: DynamixelLine) -> Iterator[None]:
        self._line, self._made = line, list[RobotHW]()
        yield
        for robot_hw in self._made:
            robot_hw.close()

    def make_robot_hw(self) -> RobotHW:
        root = MappingNodeHandle({"hand": {"port_name": str(self._line.link), "start_position": 1.7,
                                           "link_timeout": 0.4}})
        made = PacedEzGripper()
        self._made.append(made)
        assert made.init(root, root.child("hand"))
        return made

    def limits(self) -> Mapping[str, JointLimits]:
        return {JOINT: JointLimits(0.0, 1.94)}
