# SPDX-License-Identifier: BSD-3-Clause
"""The conformance suite of `RobotHW` over a UR arm against its emulator."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import ClassVar

import pytest

from modular_framework_control.hardware_interface.joint_limits import JointLimits
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.hardware_interface.robot_hw_conformance import RobotHWConformance
from modular_framework_drivers.ur.ur_arm_robot_hw import JOINT_NAMES, UrArmHardware
from modular_framework_ros.node_handle import MappingNodeHandle
from modular_framework_testing.emulators.ur_emulator_process import EmulatedArm


class TestUrArm(RobotHWConformance):
    """A UR5 in software, at the end of the unmodified ur-rtde client."""

    period_s = 0.008
    settle_s = 0.4
    real_time = True
    close_after_test = False
    arm: ClassVar[UrArmHardware]

    @pytest.fixture(autouse=True, scope="class")
    @classmethod
    def arm_of_all(cls) -> Iterator[None]:
        emulator = EmulatedArm()
        robot_hw = cls.arm = UrArmHardware()
        settings = {"robot_ip_address": emulator.address, "link_timeout": 2.0}
        assert robot_hw.init(MappingNodeHandle({}), MappingNodeHandle(settings, "/arm_hw"))
        yield
        robot_hw.close()
        robot_hw.close()
        emulator.close()

    @pytest.fixture(autouse=True)
    def emulators(self) -> Iterator[None]:
        self._emulators: list[EmulatedArm] = []
        yield
        for emulator in self._emulators:
            emulator.close()

    def make_robot_hw(self, positions: Mapping[str, float] | None = None) -> RobotHW:
        if positions is None:
            return self.arm
        self._emulators.append(EmulatedArm(positions=[positions[name] for name in JOINT_NAMES]))
        robot_hw = UrArmHardware()
        settings = {"robot_ip_address": self._emulators[-1].address, "link_timeout": 2.0}
        assert robot_hw.init(MappingNodeHandle({}), MappingNodeHandle(settings, "/arm_hw"))
        return robot_hw

    def limits(self) -> Mapping[str, JointLimits]:
        return dict.fromkeys(JOINT_NAMES, JointLimits(-6.4, 6.4, 3.2))
