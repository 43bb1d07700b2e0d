# SPDX-License-Identifier: BSD-3-Clause
"""The conformance suite over fake and simulated hardware, and what the suite itself promises."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from modular_framework_control.hardware_interface.interfaces import PositionJointInterface
from modular_framework_control.hardware_interface.joint_limits import JointLimits
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw_conformance import RobotHWConformance
from modular_framework_ros.node_handle import MappingNodeHandle, NodeHandle
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_resources import no_packages
from modular_framework_simulation.physics.engine_choice import MUJOCO, PYBULLET
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.physics.simulated_robot_hw import SimulatedRobotHW
from modular_framework_simulation.robots.robot_description import read_robot

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
<link name="{name}_link"><inertial><mass value="1"/><inertia ixx="2" ixy="0" ixz="0" iyy="2" iyz="0" izz="2"/>
</inertial></link>
<joint name="{name}" type="{kind}"><parent link="base"/><child link="{name}_link"/><axis xyz="0 0 1"/>
  <limit lower="-0.5" upper="0.5" velocity="2" effort="100"/></joint>
<transmission name="{name}_drive"><type>transmission_interface/SimpleTransmission</type><joint name="{name}">
  <hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface>
  <hardwareInterface>hardware_interface/VelocityJointInterface</hardwareInterface>
  <hardwareInterface>hardware_interface/EffortJointInterface</hardwareInterface></joint></transmission>"""


class TestMock(RobotHWConformance):
    """The fake hardware, with limits of the description and of parameters."""

    settle_s = 0.2
    interface = "PositionJointInterface"
    kind: type[MockRobotHW] = MockRobotHW

    def make_robot_hw(self, positions: Mapping[str, float] | None = None) -> MockRobotHW:
        robot_hw = self.kind()
        hardware = {
            "joints": ["shoulder", "elbow"],
            "initial_positions": dict(positions or {"shoulder": 0.5}),
            "command_interface": self.interface,
        }
        limits = {"elbow": {**LIMITED, "max_velocity": 3.0}}
        root = MappingNodeHandle({"robot_description": URDF, "joint_limits": limits, "hw": hardware})
        assert robot_hw.init(root, root.child("hw"))
        return robot_hw

    def limits(self) -> Mapping[str, JointLimits]:
        return {"shoulder": JointLimits(-1.0, 1.0, 2.0, 10.0), "elbow": JointLimits(-1.0, 1.0, 3.0, 10.0)}


class TestMockByVelocity(TestMock):
    """Joints that take velocities."""

    interface = "VelocityJointInterface"


class TestMockByEffort(TestMock):
    """Joints that take efforts."""

    interface = "EffortJointInterface"


class TestMockByPositionAndVelocity(TestMock):
    """Joints that take velocities with their positions."""

    interface = "PosVelJointInterface"


class TestMockByPositionVelocityAndAcceleration(TestMock):
    """Joints that take velocities and accelerations with their positions."""

    interface = "PosVelAccJointInterface"


class SimulatedSuite(RobotHWConformance):
    """A lift and a turntable in the simulated world, which take positions, velocities and efforts."""

    engine: str
    settle_s = 0.6
    test_the_constructor_needs_no_arguments = None  # type: ignore[assignment]  # the simulation makes it, not a `type`

    _robots = 0

    @pytest.fixture(autouse=True)
    def world_of_it(self, tmp_path: Path) -> Iterator[None]:
        self._parts = ConvexParts(tmp_path)
        self._world = PhysicsWorld(PhysicsSettings(), self._parts, (0.0, 0.0, -9.81), engine=self.engine)
        yield
        self._world.close()

    def make_robot_hw(self, positions: Mapping[str, float] | None = None) -> SimulatedRobotHW:
        joints = (("lift", "prismatic"), ("turn", "revolute"))
        links = "".join(LINK.format(name=name, kind=kind) for name, kind in joints)
        description = read_robot(ROBOT.format(links=links), no_packages, self._parts, False)
        self._robots += 1
        body = RobotBody(self._world, description, f"lab{self._robots}", Pose(), positions or {})
        robot_hw = SimulatedRobotHW(body)
        assert robot_hw.init(MappingNodeHandle(), MappingNodeHandle())
        return robot_hw

    def limits(self) -> Mapping[str, JointLimits]:
        return {name: JointLimits(-0.5, 0.5, 2.0, 100.0) for name in ("lift", "turn")}

    def advance(self, period_s: float) -> None:
        for _ in range(round(period_s / self._world.settings.time_step_s)):
            self._world.step()


class TestPyBullet(SimulatedSuite):
    """The simulated robot in the default engine."""

    engine = PYBULLET


class TestMujoco(SimulatedSuite):
    """The simulated robot in the other engine."""

    engine = MUJOCO


class TestSlidingGripper(TestMock):
    """Fingers that slide: their whole range is shorter than the jump and the step."""

    initial_position = 0.0
    tolerance = 0.001

    def make_robot_hw(self, positions: Mapping[str, float] | None = None) -> MockRobotHW:
        self.made = MockRobotHW()
        part = {"joints": ["finger"], "initial_positions": dict(positions or {"finger": self.initial_position})}
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

    def make_robot_hw(self, positions: Mapping[str, float] | None = None) -> MockRobotHW:
        hardware = {
            "joints": ["shoulder", "elbow"],
            "initial_positions": dict(positions or {}),
            "command_interface": self.interface,
        }
        robot_hw, root = MockRobotHW(), MappingNodeHandle({"hw": hardware})
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
    kind = MockOfOneThread


class MockThatWaits(MockRobotHW):
    """Waits for its device in every other cycle."""

    _cycles = 0

    def read(self, time_s: float, period_s: float) -> None:
        self._cycles += 1
        time.sleep(0.05 * (self._cycles % 2))
        super().read(time_s, period_s)


class SuiteThatWaits(TestMock):
    """Hardware that holds the control loop up."""

    __test__ = False
    kind = MockThatWaits


class MockThatGoesTo0(MockRobotHW):
    """Has commands of its own making, as hardware had whose handles began at 0."""

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        made = super().init(root_nh, robot_hw_nh)
        for interface in self.interfaces:
            for handle in interface.handles if interface.claims_resources else ():
                handle.command = 0.0
        return made


class SuiteThatGoesTo0(TestMock):
    """Hardware whose joints move before they are commanded."""

    __test__ = False
    kind = MockThatGoesTo0


def failures(suite: RobotHWConformance, tests: Sequence[str] = ()) -> set[str]:
    """Names of the tests of a suite, of all or of these, that its hardware fails."""
    failed = set()
    for name in tests or [name for name in dir(suite) if name.startswith("test_")]:
        suite.setup_method()
        try:
            getattr(suite, name)()
        except (AssertionError, RuntimeError):
            failed.add(name)
        finally:
            suite.teardown_method()
    return failed


BEYOND_LIMITS = "test_commands_beyond_the_limits_or_no_numbers_keep_it_within_them"
JUMP = "test_a_jump_of_the_command_is_followed_no_faster_than_the_limit_allows"


@pytest.mark.parametrize(
    ("interface", "failed"),
    [
        ("PositionJointInterface", {JUMP, BEYOND_LIMITS}),
        ("PosVelJointInterface", {JUMP, BEYOND_LIMITS}),
        ("VelocityJointInterface", {BEYOND_LIMITS}),
        ("EffortJointInterface", {"test_no_effort_exceeds_the_limits_or_makes_a_joint_faster_than_its_velocity_limit"}),
    ],
)
def test_hardware_without_limits_fails(interface: str, failed: set[str]) -> None:
    suite = LimitlessMock()
    suite.interface = interface
    assert failures(suite) == failed


def test_hardware_that_waits_for_its_device_fails() -> None:
    assert failures(SuiteThatWaits(), ("test_read_and_write_do_not_wait",))


def test_hardware_whose_joints_move_before_they_are_commanded_fails() -> None:
    assert "test_wherever_it_stands_at_the_start_it_stays_until_it_is_commanded" in failures(SuiteThatGoesTo0())


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
