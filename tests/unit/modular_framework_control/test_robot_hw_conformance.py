# SPDX-License-Identifier: BSD-3-Clause
"""One suite over every hardware: fake, simulated, a UR arm and an EZGripper against their emulators, and two as one."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import pytest

from modular_framework_control.hardware_interface.combined_robot_hw import CombinedRobotHW
from modular_framework_control.hardware_interface.interfaces import PositionJointInterface
from modular_framework_control.hardware_interface.joint_limits import JointLimits
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.hardware_interface.robot_hw_conformance import RobotHWConformance
from modular_framework_drivers.emulators.dynamixel_finger import Finger, FingerModel
from modular_framework_drivers.emulators.dynamixel_line import DynamixelLine
from modular_framework_drivers.emulators.dynamixel_servo import DynamixelServo
from modular_framework_drivers.emulators.ur_emulator_process import EmulatedArm
from modular_framework_drivers.ezgripper.ezgripper_robot_hw import JOINT, EzGripperRobotHW
from modular_framework_drivers.ur.ur_arm_robot_hw import JOINT_NAMES, UrArmHardware
from modular_framework_ros.node_handle import MappingNodeHandle
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.robot_description import read_robot
from modular_framework_simulation.models.sdf_resources import no_packages
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.pybullet_robot_hw import PyBulletRobotHW
from modular_framework_simulation.physics.robot_body import RobotBody

URDF = """<robot name="r">
<joint name="shoulder" type="revolute"><limit lower="-1" upper="1" velocity="2" effort="10"/></joint>
<joint name="elbow" type="continuous"><limit velocity="3" effort="10"/></joint></robot>"""
SLIDE = """<robot name="r">
<joint name="finger" type="prismatic"><limit lower="0" upper="0.04" velocity="0.2" effort="10"/></joint></robot>"""
LIMITED = {
    "has_position_limits": True,
    "min_position": -1.0,
    "max_position": 1.0,
    "has_velocity_limits": True,
    "max_velocity": 2.0,
}
KNUCKLE = {"has_velocity_limits": True, "max_velocity": 2.0}
ROBOT = """<robot name="lab"><link name="base"/>
{links}
</robot>"""
LINK = """
<link name="{name}_link"><inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
</inertial></link>
<joint name="{name}" type="{kind}"><parent link="base"/><child link="{name}_link"/><axis xyz="0 0 1"/>
  <limit lower="-0.5" upper="0.5" velocity="2" effort="100"/></joint>
<transmission name="{name}_drive"><type>transmission_interface/SimpleTransmission</type><joint name="{name}">
  <hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface></joint></transmission>"""


class TestMock(RobotHWConformance):
    """The fake hardware, with limits of the description and of parameters."""

    settle_s = 0.2

    def make_robot_hw(self) -> MockRobotHW:
        robot_hw = MockRobotHW()
        root = MappingNodeHandle(
            {
                "robot_description": URDF,
                "joint_limits": {"elbow": {**LIMITED, "max_velocity": 3.0}},
                "hw": {"joints": ["shoulder", "elbow"], "initial_positions": {"shoulder": 0.5}},
            }
        )
        assert robot_hw.init(root, root.child("hw"))
        return robot_hw

    def limits(self) -> Mapping[str, JointLimits]:
        return {"shoulder": JointLimits(-1.0, 1.0, 2.0), "elbow": JointLimits(-1.0, 1.0, 3.0)}


class TestPyBullet(RobotHWConformance):
    """A lift and a turntable in the simulated world."""

    settle_s = 0.6
    test_the_constructor_needs_no_arguments = None  # type: ignore[assignment]  # the simulation makes it, not a `type`

    @pytest.fixture(autouse=True)
    def world_of_it(self, tmp_path: Path) -> Iterator[None]:
        self._parts = ConvexParts(tmp_path)
        self._world = PhysicsWorld(PhysicsSettings(), self._parts, (0.0, 0.0, -9.81))
        yield
        self._world.close()

    def make_robot_hw(self) -> PyBulletRobotHW:
        joints = (("lift", "prismatic"), ("turn", "revolute"))
        links = "".join(LINK.format(name=name, kind=kind) for name, kind in joints)
        body = RobotBody(
            self._world, read_robot(ROBOT.format(links=links), no_packages, self._parts, False), "lab", Pose(), {}
        )
        robot_hw = PyBulletRobotHW(body)
        assert robot_hw.init(MappingNodeHandle(), MappingNodeHandle())
        return robot_hw

    def limits(self) -> Mapping[str, JointLimits]:
        return {name: JointLimits(-0.5, 0.5, 2.0) for name in ("lift", "turn")}

    def advance(self, period_s: float) -> None:
        for _ in range(round(period_s / self._world.settings.time_step_s)):
            self._world.step()


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
        settings = {"robot_ip_address": emulator.address, "link_timeout": 0.5}
        assert robot_hw.init(MappingNodeHandle({}), MappingNodeHandle(settings, "/arm_hw"))
        yield
        robot_hw.close()
        robot_hw.close()
        emulator.close()

    def make_robot_hw(self) -> RobotHW:
        return self.arm

    def limits(self) -> Mapping[str, JointLimits]:
        return dict.fromkeys(JOINT_NAMES, JointLimits(-6.4, 6.4, 3.2))


class TestEzGripper(RobotHWConformance):
    """A gripper whose servo is emulated on a pseudo-terminal."""

    period_s = 0.008
    settle_s = 0.6
    real_time = True
    close_after_test = False
    robot_hw: ClassVar[RobotHW]

    @pytest.fixture(autouse=True, scope="class")
    @classmethod
    def robot_hw_of_all(cls, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
        finger = Finger(DynamixelServo(), FingerModel(top_speed=12000.0, time_constant_s=0.015), opening=200.0)
        line = DynamixelLine([finger], tmp_path_factory.mktemp("line") / "gripper")
        line.connect()
        cls.robot_hw = cls.initialised({"port_name": str(line.link), "start_position": 1.7})
        yield
        cls.robot_hw.close()
        cls.robot_hw.close()
        line.close()

    @classmethod
    def initialised(cls, gripper: Mapping[str, Any]) -> RobotHW:
        """The hardware, with these parameters of the gripper."""
        root = MappingNodeHandle({"hand": gripper, "joint_limits": {JOINT: KNUCKLE}})
        robot_hw = EzGripperRobotHW()
        assert robot_hw.init(root, root.child("hand"))
        return robot_hw

    def make_robot_hw(self) -> RobotHW:
        return self.robot_hw

    def limits(self) -> Mapping[str, JointLimits]:
        return {JOINT: JointLimits(0.0, 1.94, 2.0)}


class TestCombination(TestEzGripper):
    """An arm and a gripper of two kinds as one robot: the one fake, the other with its emulated servo."""

    @classmethod
    def initialised(cls, gripper: Mapping[str, Any]) -> RobotHW:
        root = MappingNodeHandle(
            {
                "robot_hardware": ["arm", "hand"],
                "arm": {"type": "lab/Mock", "joints": ["shoulder", "elbow"], "initial_positions": {"shoulder": 0.5}},
                "hand": {"type": "lab/Hand", **gripper},
                "joint_limits": {**dict.fromkeys(("shoulder", "elbow"), LIMITED), JOINT: KNUCKLE},
            }
        )
        kinds: dict[str, type[RobotHW]] = {"lab/Mock": MockRobotHW, "lab/Hand": EzGripperRobotHW}
        robot_hw = CombinedRobotHW(lambda name: kinds[name]())
        assert robot_hw.init(root, root)
        return robot_hw

    def limits(self) -> Mapping[str, JointLimits]:
        return {**super().limits(), **dict.fromkeys(("shoulder", "elbow"), JointLimits(-1.0, 1.0, 2.0))}


class TestSlidingGripper(TestMock):
    """Fingers that slide: their whole range is shorter than the jump and the step."""

    initial_position = 0.0
    tolerance = 0.001

    def make_robot_hw(self) -> MockRobotHW:
        self.made = MockRobotHW()
        part = {"joints": ["finger"], "initial_positions": {"finger": self.initial_position}}
        root = MappingNodeHandle({"robot_description": SLIDE, "hw": part})
        assert self.made.init(root, root.child("hw"))
        return self.made

    def limits(self) -> Mapping[str, JointLimits]:
        return {"finger": JointLimits(0.0, 0.04, 0.2)}


class SuiteThatStalls(TestMock):
    """The machine does nothing for a while after the last cycle that sees the joint in its place."""

    __test__ = False
    period_s = 0.01
    real_time = True
    stall_s = 0.0

    def limits(self) -> Mapping[str, JointLimits]:
        return {
            name: replace(limit, max_velocity=2.0 if name == "shoulder" else math.inf)
            for name, limit in super().limits().items()
        }

    def advance(self, period_s: float) -> None:
        time.sleep(self.stall_s)
        self.stall_s = 0.0


class LimitlessMock(TestMock):
    """Hardware that does not know its limits."""

    __test__ = False

    def make_robot_hw(self) -> MockRobotHW:
        robot_hw, root = MockRobotHW(), MappingNodeHandle({"hw": {"joints": ["shoulder", "elbow"]}})
        assert robot_hw.init(root, root.child("hw"))
        return robot_hw


class MockOfOneThread(MockRobotHW):
    """Has a connection that only the thread may use that used it first, as some libraries have."""

    _owner: int | None = None

    def write(self, time_s: float, period_s: float) -> None:
        self._owner = self._owner or threading.get_ident()
        if self._owner != threading.get_ident():
            raise RuntimeError("a connection of another thread")
        super().write(time_s, period_s)


class SuiteOfOneThread(TestMock):
    """Hardware whose connection belongs to the thread of the control loop."""

    __test__ = False

    def make_robot_hw(self) -> MockRobotHW:
        robot_hw = MockOfOneThread()
        root = MappingNodeHandle({"robot_description": URDF, "hw": {"joints": ["shoulder", "elbow"]}})
        assert robot_hw.init(root, root.child("hw"))
        return robot_hw


def failures(suite: RobotHWConformance) -> set[str]:
    """Names of the tests of a suite that its hardware fails."""
    failed = set()
    for name in [name for name in dir(suite) if name.startswith("test_")]:
        suite.setup_method()
        try:
            getattr(suite, name)()
        except (AssertionError, RuntimeError):
            failed.add(name)
        finally:
            suite.teardown_method()
    return failed


def test_hardware_without_limits_fails() -> None:
    assert failures(LimitlessMock()) == {
        "test_a_jump_of_the_command_is_followed_no_faster_than_the_limit_allows",
        "test_commands_beyond_the_limits_or_no_numbers_keep_it_within_them",
    }


def test_hardware_whose_connection_belongs_to_one_thread_passes() -> None:
    assert not failures(SuiteOfOneThread())


def test_a_stall_of_the_machine_does_not_make_a_joint_seem_faster() -> None:
    suite = SuiteThatStalls()
    suite.setup_method()
    suite.stall_s = 0.2
    suite.test_a_jump_of_the_command_is_followed_no_faster_than_the_limit_allows()
    assert suite.stall_s == 0.0
    suite.teardown_method()


def test_targets_stay_within_a_range_that_is_shorter_than_the_jump() -> None:
    for position, target in ((0.0, 0.04), (0.01, 0.04), (0.03, 0.0), (0.04, 0.0)):
        suite = TestSlidingGripper()
        suite.initial_position = position
        suite.setup_method()
        suite.test_a_jump_of_the_command_is_followed_no_faster_than_the_limit_allows()
        (finger,) = suite.made.get(PositionJointInterface).handles
        assert finger.command == pytest.approx(target, abs=1e-9)
        suite.teardown_method()
