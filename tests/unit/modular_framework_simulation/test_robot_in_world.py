# SPDX-License-Identifier: BSD-3-Clause
"""A robot in the world follows commands through its hardware interfaces, and holds things by friction alone."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from modular_framework_control.hardware_interface.interfaces import (
    ControllerInfo,
    EffortJointInterface,
    HardwareInterfaceError,
    InterfaceResources,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from modular_framework_ros.node_handle import MappingNodeHandle
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.loop.pacing import Pacer
from modular_framework_simulation.loop.request_queue import RequestQueue
from modular_framework_simulation.loop.simulation_loop import Actors, SimulationLoop
from modular_framework_simulation.loop.snapshots import take_snapshot
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_resources import no_packages
from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody, Role
from modular_framework_simulation.physics.simulated_robot_hw import SimulatedRobotHW
from modular_framework_simulation.robots.end_effector_joints import end_effector_joints
from modular_framework_simulation.robots.robot_description import read_robot
from modular_framework_testing.simulation.simulated_samples import exact_state, lift_robot_urdf, solid

Script = Callable[[float], None]
EVERY_ENGINE = pytest.mark.parametrize("engine", ENGINES)


def with_ros2_control(joints: str, plugin: str = "gz_ros2_control/GazeboSimSystem") -> str:
    """The two-finger robot with the tag that ROS 2's descriptions have for their controllers."""
    hardware = f"<hardware><plugin>{plugin}</plugin></hardware>"
    tag = f"<ros2_control name='r' type='system'>{hardware}{joints}</ros2_control>"
    return lift_robot_urdf().replace("</robot>", f"{tag}</robot>")


class Commander:
    """Stands where the controller manager does: calls a script with the time of each cycle."""

    def __init__(self) -> None:
        self.script: Script = lambda time_s: None
        self.resets = 0
        self.reasons: list[str] = []

    def update(self, time_s: float, period_s: float, reset_controllers: bool = False, reset_reason: str = "") -> None:
        self.resets += reset_controllers
        self.reasons += [reset_reason] if reset_controllers else []
        if period_s > 0:
            self.script(time_s)


class Lifter:
    """The two-finger robot of the samples with everything around it."""

    def __init__(self, world: PhysicsWorld, parts: ConvexParts, interface: str = "PositionJointInterface") -> None:
        self.world = world
        urdf = lift_robot_urdf(f"hardware_interface/{interface}")
        description = read_robot(urdf, no_packages, parts, False)
        self.robot = RobotBody(world, description, "lifter", Pose(), {"lift": 0.1})
        self.hardware = SimulatedRobotHW(self.robot)
        assert self.hardware.init(MappingNodeHandle(), MappingNodeHandle())
        self.commander = Commander()
        self.loop = SimulationLoop(world, Pacer(0.0), RequestQueue(), Actors(self.robot, self.hardware, self.commander))
        self.states = {each.name: each for each in self.hardware.get(JointStateInterface).handles}
        self.commands = {each.name: each for each in self.hardware.get(PositionJointInterface).handles}

    def run(self, seconds: float, script: Script = lambda time_s: None) -> None:
        self.commander.script = script
        for number in range(round(seconds / self.world.settings.time_step_s)):
            self.loop.step()
            if number % 10 == 0:
                self.loop.watch_grasps()

    def move_lift(self, target: float, seconds: float) -> None:
        start, begin = self.commands["lift"].command, self.world.time_ns * 1e-9

        def script(time_s: float) -> None:
            share = min(1.0, (time_s - begin) / seconds)
            self.commands["lift"].command = start + share**2 * (3 - 2 * share) * (target - start)

        self.run(seconds, script)


@pytest.fixture
def lifter(world: PhysicsWorld, convex_parts: ConvexParts) -> Lifter:
    return Lifter(world, convex_parts)


def test_every_movable_joint_has_a_state_and_starts_at_the_given_position(lifter: Lifter) -> None:
    assert {name: state.position for name, state in lifter.states.items()} == pytest.approx(
        {"lift": 0.1, "slide_1": 0.0, "slide_2": 0.0}
    )


def test_interfaces_come_from_the_transmissions(world: PhysicsWorld, convex_parts: ConvexParts) -> None:
    lifter = Lifter(world, convex_parts, "VelocityJointInterface")
    assert lifter.hardware.get(VelocityJointInterface).names == ["lift"]
    assert lifter.hardware.get(PositionJointInterface).names == ["slide_1"]


def test_an_unknown_interface_in_a_transmission_is_refused(world: PhysicsWorld, convex_parts: ConvexParts) -> None:
    with pytest.raises(HardwareInterfaceError, match="unknown hardware interface"):
        Lifter(world, convex_parts, "WishInterface")


@EVERY_ENGINE
def test_a_joint_tracks_a_moving_command_within_a_millimetre(lifter: Lifter) -> None:
    worst = 0.0

    def sine(time_s: float) -> None:
        nonlocal worst
        worst = max(worst, abs(lifter.states["lift"].position - lifter.commands["lift"].command))
        lifter.commands["lift"].command = 0.1 + 0.1 * (1 - math.cos(3 * time_s))

    lifter.run(2.0, sine)
    assert worst < 0.001


@EVERY_ENGINE
def test_a_robot_that_moves_when_the_end_is_asked_for_is_held_until_it_stands(lifter: Lifter) -> None:
    def rise(time_s: float) -> None:
        if not lifter.commander.resets:
            lifter.commands["lift"].command += 0.2 * lifter.world.settings.time_step_s

    lifter.run(0.5, rise)
    assert lifter.states["lift"].velocity > 0.1
    before = lifter.states["lift"].position
    lifter.loop.stop()
    lifter.loop.run()
    assert lifter.commander.resets == 1
    assert lifter.states["lift"].velocity == pytest.approx(0.0, abs=0.01)
    assert lifter.states["lift"].position == pytest.approx(before, abs=0.01)


@EVERY_ENGINE
def test_a_joint_holds_against_gravity(lifter: Lifter) -> None:
    lifter.run(2.0)
    assert lifter.states["lift"].position == pytest.approx(0.1, abs=1e-4)
    assert lifter.states["lift"].effort == pytest.approx(2.2 * 9.81, rel=0.02)


@EVERY_ENGINE
def test_a_command_beyond_the_limits_is_cut_and_the_velocity_limit_kept(lifter: Lifter) -> None:
    too_early = []

    def jump(time_s: float) -> None:
        too_early.append(lifter.states["lift"].position > 0.1 + 1.0 * time_s + 0.003)
        lifter.commands["lift"].command = 5.0

    lifter.run(1.0, jump)
    assert lifter.states["lift"].position == pytest.approx(0.5, abs=1e-3)
    assert not any(too_early)


@EVERY_ENGINE
def test_the_second_finger_does_what_the_first_does(lifter: Lifter) -> None:
    lifter.run(0.3, lambda _time_s: setattr(lifter.commands["slide_1"], "command", 0.03))
    assert lifter.robot.roles["slide_2"] is Role.COUPLED
    assert lifter.states["slide_2"].position == pytest.approx(0.03, abs=1e-3)


@EVERY_ENGINE
def test_a_velocity_joint_runs_at_the_commanded_velocity(world: PhysicsWorld, convex_parts: ConvexParts) -> None:
    lifter = Lifter(world, convex_parts, "VelocityJointInterface")
    lifter.hardware.get(VelocityJointInterface).handles[0].command = 0.2
    lifter.run(1.0)
    assert lifter.states["lift"].position == pytest.approx(0.3, abs=0.003)


@EVERY_ENGINE
def test_an_effort_joint_accelerates_as_newton_says(world: PhysicsWorld, convex_parts: ConvexParts) -> None:
    lifter = Lifter(world, convex_parts, "EffortJointInterface")
    mass = 2.2
    lifter.hardware.get(EffortJointInterface).handles[0].command = mass * (9.81 + 1.0)
    lifter.run(0.5)
    assert lifter.states["lift"].velocity == pytest.approx(0.5, rel=0.05)


@EVERY_ENGINE
def test_a_starting_controller_takes_a_joint_over_without_a_jump(lifter: Lifter) -> None:
    lifter.run(0.2)
    claim = InterfaceResources(PositionJointInterface.type_name, ("lift",))
    lifter.commands["lift"].command = 0.4
    lifter.hardware.do_switch([ControllerInfo("c", "t", (claim,))], [])
    assert lifter.commands["lift"].command == pytest.approx(0.1, abs=1e-3)


def grasp(lifter: Lifter, geometry: specs.Geometry, height: float) -> None:
    lifter.world.spawn(solid("thing", geometry, Pose((0, 0, height / 2))))
    lifter.move_lift(height / 2 - 0.27, 1.0)
    lifter.commands["slide_1"].command = 0.05
    lifter.run(0.8, lambda _time_s: setattr(lifter.commands["slide_1"], "command", 0.05))


@pytest.mark.parametrize(
    ("geometry", "height"),
    [(specs.Box((0.06, 0.03, 0.06)), 0.06), (specs.Cylinder(0.03, 0.08), 0.08), (specs.Sphere(0.03), 0.06)],
)
def test_an_object_is_lifted_by_friction_and_let_go_again(
    lifter: Lifter, geometry: specs.Geometry, height: float
) -> None:
    grasp(lifter, geometry, height)
    (held,) = lifter.loop.held_objects()
    assert (held.model, held.carrier_link) == ("thing", "palm")
    assert "palm" in held.touch_links
    lifter.move_lift(0.2, 1.0)
    lifter.run(2.0)
    lifted = lifter.world.entity_state("thing").pose.position[2]
    assert lifted == pytest.approx(0.2 + 0.27, abs=0.005)
    snapshot = take_snapshot(lifter.world, lifter.loop.held_objects())
    assert [held.model for held in snapshot.held] == ["thing"]
    assert {model.name for model in snapshot.models} == {"floor", "thing"}
    lifter.run(1.0, lambda _time_s: setattr(lifter.commands["slide_1"], "command", 0.0))
    assert lifter.loop.held_objects() == ()
    assert lifter.world.entity_state("thing").pose.position[2] < 0.1


def test_less_effort_grips_less(lifter: Lifter) -> None:
    forces = []
    for effort in (5.0, 10.0):
        lifter.commands["slide_1"].max_effort = effort
        if effort == 5.0:
            grasp(lifter, specs.Box((0.06, 0.03, 0.06)), 0.06)
        lifter.run(0.5)
        forces.append(sum(each.force for each in lifter.world.contacts(lifter.robot.body, lifter.robot.fingers[0][0])))
    assert forces == pytest.approx([5.0, 10.0], rel=0.1)


@EVERY_ENGINE
def test_reset_puts_the_robot_back_and_restarts_the_controllers_once(lifter: Lifter) -> None:
    lifter.move_lift(0.4, 0.8)
    lifter.loop.reset_all()
    assert lifter.world.time_ns == 0
    lifter.run(0.1)
    assert lifter.commander.resets == 1
    assert lifter.states["lift"].position == pytest.approx(0.1, abs=1e-3)


def test_the_same_commands_give_the_same_world(
    make_world: Callable[[], PhysicsWorld], convex_parts: ConvexParts
) -> None:
    prints = []
    for _ in range(2):
        lifter = Lifter(make_world(), convex_parts)
        grasp(lifter, specs.Cylinder(0.03, 0.08), 0.08)
        lifter.move_lift(0.2, 1.0)
        prints.append(exact_state(lifter.world))
    assert prints[0] == prints[1]


def test_a_robot_with_a_name_the_engine_has_no_room_for_is_refused(
    world: PhysicsWorld, convex_parts: ConvexParts
) -> None:
    urdf = lift_robot_urdf()
    for name in ("lift", "slide_1"):
        description = read_robot(
            urdf.replace(f"'{name}'", f"'{'n' * 2000}'").replace(f'"{name}"', f'"{"n" * 2000}"'),
            no_packages,
            convex_parts,
            False,
        )
        with pytest.raises(DescriptionError, match=r"model 'r': <joint name='n+\.\.\.'>: is 2,000 bytes long"):
            RobotBody(world, description, "r", Pose(), {})
    with pytest.raises(DescriptionError, match="n{2000}.*allowed: lift, slide_1, slide_2"):
        RobotBody(world, read_robot(urdf, no_packages, convex_parts, False), "r", Pose(), {"n" * 2000: 1.0})


@pytest.mark.parametrize(
    ("plugin", "interface", "position"),
    [
        ("gz_ros2_control/GazeboSimSystem", EffortJointInterface, 0.25),
        ("mock_components/GenericSystem", PositionJointInterface, 0.0),
    ],
)
def test_a_tag_of_simulated_hardware_says_how_joints_are_commanded_and_where_they_begin(
    world: PhysicsWorld, convex_parts: ConvexParts, plugin: str, interface: type, position: float
) -> None:
    state = "<state_interface name='position'><param name='initial_value'>0.25</param></state_interface>"
    urdf = with_ros2_control(f"<joint name='lift'><command_interface name='effort'/>{state}</joint>", plugin)
    description = read_robot(urdf, no_packages, convex_parts, False)
    robot = RobotBody(world, description, "r", Pose(), description.initial_positions)
    hardware = SimulatedRobotHW(robot)
    assert hardware.init(MappingNodeHandle(), MappingNodeHandle())
    commanded = {each: hardware.find(each) for each in (EffortJointInterface, PositionJointInterface)}
    found = {each for each, offered in commanded.items() if offered and "lift" in offered.names}
    assert found == {interface}
    assert "slide_1" in hardware.get(PositionJointInterface).names  # its transmission says so
    assert robot.starting_positions["lift"] == position


def test_a_starting_pose_with_an_unknown_joint_is_refused(world: PhysicsWorld, convex_parts: ConvexParts) -> None:
    description = read_robot(lift_robot_urdf(), no_packages, convex_parts, False)
    with pytest.raises(DescriptionError, match=r"\['elbow'\].*allowed: lift, slide_1, slide_2"):
        RobotBody(world, description, "r", Pose(), {"elbow": 1.0})


@pytest.mark.parametrize(
    ("urdf", "said"),
    [
        ("<robot", "well-formed"),
        ("<sdf/>", "expected a URDF"),
        (
            "<robot name='r'><link name='a'><collision><geometry><mesh filename='package://p/x.stl'/></geometry>"
            "</collision></link></robot>",
            "package 'p' is not found",
        ),
        (
            "<robot name='r'><link name='a'><collision><geometry><mesh filename='/nowhere/x.stl'/></geometry>"
            "</collision></link></robot>",
            "'/nowhere/x.stl' does not exist",
        ),
        (
            "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='revolute'><parent link='a'/>"
            "<child link='b'/><limit lower='x'/></joint></robot>",
            "joint 'j'.*got 'x'",
        ),
        (
            "<robot name='r'><link name='a'/><joint name='j' type='revolute'><parent link='a'/></joint></robot>",
            "joint 'j'.*has no <child",
        ),
        (
            lift_robot_urdf().replace('<mimic joint="slide_1"', '<mimic joint="slide_2"'),
            "'slide_2': it mimics itself through slide_2 -> slide_2; a joint may mimic one of lift, slide_1",
        ),
        (
            lift_robot_urdf().replace('<mimic joint="slide_1"', '<mimic joint="knee"'),
            "'knee', which is not a movable joint",
        ),
        (
            "<robot name='r'><link name='a'><collision><geometry><box size='1 1e30 1'/></geometry></collision></link>"
            "</robot>",
            "link 'a', <box size=...>: got '1 1e30 1'; allowed: lengths of at most 10000 m",
        ),
        (
            with_ros2_control("<joint name='elbow'/>"),
            "<ros2_control>, joint 'elbow': is not a movable joint; allowed: lift",
        ),
        (
            with_ros2_control("<joint name='lift'><command_interface name='torque'/></joint>"),
            "joint 'lift': has the command interface 'torque'; allowed in simulation: position, velocity, effort",
        ),
    ],
)
def test_a_faulty_robot_description_is_refused(urdf: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match=said):
        read_robot(urdf, no_packages, ConvexParts(tmp_path), False)


@EVERY_ENGINE
def test_a_joint_that_fell_behind_catches_up_no_faster_than_its_limit(lifter: Lifter) -> None:
    begin, behind, fastest = lifter.world.time_ns * 1e-9, 0.0, 0.0
    lift = lifter.commands["lift"]

    def hold_up_then_let_go(time_s: float) -> None:
        nonlocal behind, fastest
        lift.max_effort = 2.2 * 9.81 if time_s - begin < 0.2 else 0.0
        behind = max(behind, lift.command - lift.position)
        fastest = max(fastest, lift.velocity)
        lift.command = 0.5

    lifter.run(1.0, hold_up_then_let_go)
    assert behind > 0.1 and lift.position == pytest.approx(0.5, abs=1e-3)
    assert 0.9 < fastest < 1.05


def two_hands_urdf() -> str:
    """The robot of the samples twice in one description, a metre apart along x: names end with _a and _b."""
    text = lift_robot_urdf()
    body = text[text.index('<link name="palm">') : text.index("</robot>")]
    copies = [
        re.sub(r"\b(palm|lift|finger_\d|slide_\d|t1|t2|a1|a2)(?=\")", rf"\1_{name}", body).replace(
            "0 0 0.3", f"{x} 0 0.3"
        )
        for name, x in (("a", 0), ("b", 1))
    ]
    return '<robot name="two"><link name="world"/>' + "".join(copies) + "</robot>"


def test_each_gripper_of_a_robot_holds_an_object_of_its_own(world: PhysicsWorld, convex_parts: ConvexParts) -> None:
    description = read_robot(two_hands_urdf(), no_packages, convex_parts, False)
    robot = RobotBody(world, description, "two", Pose(), {"lift_a": -0.235, "lift_b": -0.235})
    assert [(gripper.palm_link, len(gripper.fingers)) for gripper in robot.grippers] == [("palm_a", 2), ("palm_b", 2)]
    assert set(robot.grippers[1].links) == {"palm_b", "finger_1_b", "finger_2_b"}
    hardware = SimulatedRobotHW(robot)
    hardware.init(MappingNodeHandle(), MappingNodeHandle())
    loop = SimulationLoop(world, Pacer(0.0), RequestQueue(), Actors(robot, hardware, Commander()))
    commands = {each.name: each for each in hardware.get(PositionJointInterface).handles}
    for name, x in (("one", 0.0), ("other", 1.0)):
        world.spawn(solid(name, specs.Box((0.06, 0.03, 0.06)), Pose((x, 0, 0.03))))

    def close(*names: str) -> None:
        for number in range(400):
            for name in ("a", "b"):
                commands[f"slide_1_{name}"].command = 0.05 if name in names else 0.0
            loop.step()
            if number % 10 == 0:
                loop.watch_grasps()

    close("a", "b")
    held = {each.model: each.carrier_link for each in loop.held_objects()}
    assert held == {"one": "palm_a", "other": "palm_b"}
    close("b")
    assert {each.model: each.touch_links[0] for each in loop.held_objects()} == {"other": "palm_b"}


HAND_SRDF = """<robot name="lifter"><group name="hand">{joints}</group>
  <end_effector name="hand" group="hand" parent_link="palm"/></robot>"""
SECOND_MOTOR = """<transmission name="t3"><type>transmission_interface/SimpleTransmission</type><joint name="slide_2">
  <hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface></joint><actuator name="a3"/>
  </transmission></robot>"""


def fixed_jaw_urdf() -> str:
    """The robot of the samples with a second finger that is fixed to the palm, 3 cm from its middle."""
    text = lift_robot_urdf()
    start = text.index('<joint name="slide_2"')
    end = text.index("</joint>", start)
    fixed = '<joint name="screwed" type="fixed"><parent link="palm"/><child link="finger_2"/><origin xyz="0.035 0 0"/>'
    return text[:start] + fixed + text[end:]


def two_motors_urdf() -> str:
    """The robot of the samples with a motor for each finger, and fingers whose joints have parallel axes."""
    text = re.sub("<mimic [^>]*>", "", lift_robot_urdf()).replace("</robot>", SECOND_MOTOR)
    start = text.index('<joint name="slide_2"')
    turned = (
        text[start:].replace('xyz="-1 0 0"', 'xyz="1 0 0"').replace('lower="0" upper="0.05"', 'lower="-0.05" upper="0"')
    )
    return text[:start] + turned


@EVERY_ENGINE
@pytest.mark.parametrize(
    ("urdf", "joints"),
    [(fixed_jaw_urdf(), {"slide_1": 0.05}), (two_motors_urdf(), {"slide_1": 0.05, "slide_2": -0.05})],
)
def test_a_hand_without_mimic_joints_that_the_srdf_names_holds_an_object(
    urdf: str, joints: dict[str, float], world: PhysicsWorld, convex_parts: ConvexParts
) -> None:
    srdf = HAND_SRDF.format(joints="".join(f'<joint name="{name}"/>' for name in joints))
    description = read_robot(urdf, no_packages, convex_parts, False, end_effector_joints(srdf, urdf))
    robot = RobotBody(world, description, "lifter", Pose(), {"lift": -0.235})
    hardware = SimulatedRobotHW(robot)
    hardware.init(MappingNodeHandle(), MappingNodeHandle())
    loop = SimulationLoop(world, Pacer(0.0), RequestQueue(), Actors(robot, hardware, Commander()))
    commands = {each.name: each for each in hardware.get(PositionJointInterface).handles}
    world.spawn(solid("thing", specs.Box((0.06, 0.03, 0.06)), Pose((0, 0, 0.03))))

    def close(share: float) -> None:
        for number in range(400):
            for name, closed in joints.items():
                commands[name].command = share * closed
            loop.step()
            if number % 10 == 0:
                loop.watch_grasps()

    close(1.0)
    assert [(held.model, held.carrier_link) for held in loop.held_objects()] == [("thing", "palm")]
    close(0.0)
    assert loop.held_objects() == ()


def test_an_srdf_that_does_not_fit_the_urdf_is_refused_with_the_name() -> None:
    with pytest.raises(DescriptionError, match="group 'hand' names the joint 'slide_9', not in the URDF"):
        end_effector_joints(HAND_SRDF.format(joints='<joint name="slide_9"/>'), lift_robot_urdf())


FIXED_PLATE = """<robot name="stand"><link name="world"/>
  <link name="plate"><inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial><collision><geometry><box size="0.4 0.4 0.02"/></geometry></collision></link>
  <joint name="screwed" type="fixed"><parent link="world"/><child link="plate"/><origin xyz="0 0 0.5"/></joint>
</robot>"""
ONE_LINK = """<robot name="stand"><link name="plate"><collision><origin xyz="0 0 0.5"/>
  <geometry><box size="0.4 0.4 0.02"/></geometry></collision></link></robot>"""


@pytest.mark.parametrize("urdf", [FIXED_PLATE, ONE_LINK])
def test_a_robot_without_movable_joints_stands_in_the_world_and_carries_things(
    world: PhysicsWorld, convex_parts: ConvexParts, urdf: str
) -> None:
    robot = RobotBody(world, read_robot(urdf, no_packages, convex_parts, False), "stand", Pose(), {})
    hardware = SimulatedRobotHW(robot)
    assert hardware.init(MappingNodeHandle({"robot_description": urdf}), MappingNodeHandle())
    loop = SimulationLoop(world, Pacer(0.0), RequestQueue(), Actors(robot, hardware, Commander()))
    world.spawn(solid("cube", specs.Box((0.05, 0.05, 0.05)), Pose((0, 0, 0.6))))
    for _ in range(500):
        loop.step()
        loop.watch_grasps()
    assert world.entity_state("cube").pose.position[2] == pytest.approx(0.535, abs=1e-3)
    assert robot.read() == [] and hardware.get(JointStateInterface).names == []
    loop.reset_all()
    loop.restart()
    loop.step()
    assert world.names() == ["stand"]
