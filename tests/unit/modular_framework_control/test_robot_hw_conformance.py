# SPDX-License-Identifier: BSD-3-Clause
"""The conformance suite over fake and simulated hardware, and what the suite itself promises."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from modular_framework_control.hardware_interface.interfaces import PositionJointInterface
from modular_framework_control.hardware_interface.joint_limits import JointLimits
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw_conformance import RobotHWConformance
from modular_framework_ros.node_handle import MappingNodeHandle
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.robot_description import read_robot
from modular_framework_simulation.models.sdf_resources import no_packages
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.physics.simulated_robot_hw import SimulatedRobotHW

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

    def make_robot_hw(self) -> SimulatedRobotHW:
        joints = (("lift", "prismatic"), ("turn", "revolute"))
        links = "".join(LINK.format(name=name, kind=kind) for name, kind in joints)
        body = RobotBody(
            self._world, read_robot(ROBOT.format(links=links), no_packages, self._parts, False), "lab", Pose(), {}
        )
        robot_hw = SimulatedRobotHW(body)
        assert robot_hw.init(MappingNodeHandle(), MappingNodeHandle())
        return robot_hw

    def limits(self) -> Mapping[str, JointLimits]:
        return {name: JointLimits(-0.5, 0.5, 2.0) for name in ("lift", "turn")}

    def advance(self, period_s: float) -> None:
        for _ in range(round(period_s / self._world.settings.time_step_s)):
            self._world.step()


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
