# SPDX-License-Identifier: BSD-3-Clause
"""What every physics engine does alike: contacts, models that come and go, saved states, a robot, repetition."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from modular_framework_simulation.errors import DescriptionError, SimulationError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.body_joints import measured_joint
from modular_framework_simulation.physics.engine_choice import ENGINES, MUJOCO
from modular_framework_simulation.physics.physics_engine import BASE_INDEX
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import Drive, Mode, RobotBody
from modular_framework_simulation.physics.simulated_body import BodyState, SimulatedBody, Twist
from modular_framework_simulation.robots.robot_description import read_robot
from modular_framework_testing.simulation.simulated_samples import (
    exact_state,
    hinged_model,
    lift_robot_urdf,
    run,
    solid,
)

GRAVITY = 9.81
CUBE = specs.Box((0.05, 0.05, 0.05))
SHAPES: tuple[tuple[specs.Geometry, float], ...] = (
    (CUBE, 0.025),
    (specs.Cylinder(0.03, 0.1), 0.05),
    (specs.Sphere(0.03), 0.03),
)

MakeWorld = Callable[..., PhysicsWorld]


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    """Every engine."""
    name: str = request.param
    return name


def press(world: PhysicsWorld, body: SimulatedBody) -> float:
    """Returns the sum of the normal forces on the root link."""
    return sum(contact.force for contact in world.contacts(body, BASE_INDEX))


def test_an_unknown_engine_is_refused_with_those_there_are(convex_parts: ConvexParts) -> None:
    with pytest.raises(SimulationError, match="physics engine 'ode' is unknown; allowed: pybullet, muj"):
        PhysicsWorld(PhysicsSettings(), convex_parts, engine="ode")


@pytest.mark.parametrize(("geometry", "height"), SHAPES)
def test_the_contact_forces_of_a_body_at_rest_are_its_weight(
    world: PhysicsWorld, geometry: specs.Geometry, height: float
) -> None:
    world.spawn(solid("table", specs.Box((1, 1, 0.1)), Pose((0, 0, 0.5)), static=True))
    body = world.spawn(solid("body", geometry, Pose((0, 0, 0.55 + height)), mass=0.3))
    run(world, 1.0)
    contacts = world.contacts(body, BASE_INDEX)
    assert {contact.model for contact in contacts if contact.force > 0.0} == {"table"}
    assert press(world, body) == pytest.approx(0.3 * GRAVITY, rel=0.01)
    assert body.state().pose.position == pytest.approx((0, 0, 0.55 + height), abs=5e-4)


def test_a_stack_of_five_stays_at_rest(world: PhysicsWorld) -> None:
    bodies = [world.spawn(solid(f"cube_{n}", CUBE, Pose((0, 0, 0.025 + 0.05 * n)))) for n in range(5)]
    run(world, 1.0)
    settled = [body.state().pose for body in bodies]
    run(world, 5.0)
    for number, (body, before) in enumerate(zip(bodies, settled, strict=True)):
        moved_m, turned_rad = before.distance_to(body.state().pose)
        assert moved_m < 5e-4
        assert turned_rad < math.radians(0.5)
        assert body.state().pose.position[2] == pytest.approx(0.025 + 0.05 * number, abs=1e-3)
    assert press(world, bodies[0]) == pytest.approx((0.2 * 5 + 0.2 * 4) * GRAVITY, rel=0.02)


def test_a_cylinder_rolls_without_slipping(world: PhysicsWorld) -> None:
    lying = Pose.from_xyz_rpy((0, 0, 0.03), (math.pi / 2, 0, 0))
    world.spawn(solid("roller", specs.Cylinder(0.03, 0.1), lying))
    world.set_state("roller", BodyState(lying, Twist((0.3, 0, 0), (0, 10.0, 0))))
    run(world, 0.5)
    twist = world.entity_state("roller").twist
    assert twist.linear[0] == pytest.approx(0.03 * twist.angular[1], rel=0.02)
    assert twist.linear[0] == pytest.approx(0.3, rel=0.01)


def test_models_that_come_and_go_leave_the_motion_of_others_alone(make_world: MakeWorld) -> None:
    ends = []
    for busy in (False, True):
        world = make_world()
        world.spawn(solid("stone", CUBE, Pose((0, 0, 3))))
        world.set_state("stone", BodyState(Pose((0, 0, 3)), Twist((0.5, 0.2, 1.0), (1.0, 2.0, 3.0))))
        pendulum = world.spawn(hinged_model("pendulum", 0.4, pose=Pose((2, 0, 2))))
        pendulum.set_joints({"hinge": 0.3})
        for number in range(10):
            if busy:
                world.spawn(solid(f"guest_{number}", CUBE, Pose((-2, number, 0.1))))
            run(world, 0.02)
            if busy and number % 2:
                world.delete(f"guest_{number - 1}")
        ends.append([world.entity_state("stone"), world.entity_state("pendulum::bob")])
        ends[-1].append(measured_joint(world.engine, world.body("pendulum"), "hinge").velocity)
    for quiet, busy_end in zip(*ends, strict=True):
        if isinstance(quiet, float):
            assert busy_end == pytest.approx(quiet, abs=1e-9)
        else:
            assert busy_end.pose.position == pytest.approx(quiet.pose.position, abs=1e-9)
            assert busy_end.twist.angular == pytest.approx(quiet.twist.angular, abs=1e-9)


def busy_world(make_world: MakeWorld) -> PhysicsWorld:
    """Boxes that fall on each other, and a pendulum."""
    world = make_world(rest_speed=0.0)
    for number in range(4):
        world.spawn(
            solid(f"box_{number}", CUBE, Pose.from_xyz_rpy((0.01 * number, 0, 0.1 + 0.07 * number), (0.3, 0.2, 0)))
        )
    world.spawn(hinged_model("pendulum", 0.4, specs.JointDynamics(0.01, 0.002, 0.1, 0.2), Pose((1, 0, 2))))
    return world


def test_a_run_that_is_repeated_is_equal_bit_for_bit(make_world: MakeWorld) -> None:
    ends = []
    for _ in range(2):
        world = busy_world(make_world)
        run(world, 1.0)
        ends.append(exact_state(world))
    assert ends[0] == ends[1]


def test_a_saved_state_continues_bit_for_bit(make_world: MakeWorld) -> None:
    world = busy_world(make_world)
    run(world, 0.2)
    saved = world.save_state()
    begin = exact_state(world)
    run(world, 0.5)
    first = exact_state(world)
    world.restore_state(saved)
    assert exact_state(world) == begin
    run(world, 0.5)
    assert exact_state(world) == first


def test_a_state_saved_before_a_model_came_is_refused(make_world: MakeWorld) -> None:
    world = busy_world(make_world)
    saved = world.save_state()
    world.spawn(solid("guest", CUBE, Pose((3, 0, 1))))
    with pytest.raises(SimulationError, match="models have changed since the state was saved"):
        world.restore_state(saved)


def test_a_force_gives_its_momentum(make_world: MakeWorld) -> None:
    world = make_world(gravity=(0.0, 0.0, 0.0))
    body = world.spawn(solid("cube", CUBE, Pose((0, 0, 2))))
    for _ in range(100):
        world.engine.apply_force(body.number, BASE_INDEX, (1.0, 0.0, 0.0), body.state().pose.position)
        world.step()
    run(world, 0.1)
    assert body.state().twist.linear == pytest.approx((0.2 / 0.2, 0, 0), abs=1e-6)


def test_inertia_and_masses_are_those_of_the_description(world: PhysicsWorld) -> None:
    inertial = specs.Inertial(Pose((0.01, 0.02, 0.03)), 0.7, (0.003, 0.0004, 0.0002, 0.004, 0.0001, 0.005))
    link = specs.Link("link", Pose(), inertial, (), ())
    body = world.spawn(specs.Model("odd", Pose((0, 0, 2)), False, (link,), (), "test"))
    mass, moments, centre = world.engine.mass_properties(body.number, BASE_INDEX)
    tensor = np.array([[0.003, 0.0004, 0.0002], [0.0004, 0.004, 0.0001], [0.0002, 0.0001, 0.005]])
    assert mass == pytest.approx(0.7)
    assert centre.position == pytest.approx((0.01, 0.02, 0.03))
    assert sorted(moments) == pytest.approx(np.linalg.eigvalsh(tensor), rel=1e-6)


def test_a_robot_follows_its_commands_and_its_motors_are_no_stronger_than_they_say(
    make_world: MakeWorld, convex_parts: ConvexParts
) -> None:
    world = make_world()
    robot = RobotBody(world, read_robot(lift_robot_urdf(), str, convex_parts, False), "robot", Pose(), {})

    def drive(effort: float) -> dict[str, float]:
        for _ in range(250):
            robot.read()
            robot.drive({"lift": Drive(Mode.POSITION, 0.2, 0.0, effort), "slide_1": Drive(Mode.POSITION, 0, 0, 20.0)})
            world.step()
        return {name: each.position for name, each in zip(robot.joint_names, robot.read(), strict=True)}

    weight = 2.2 * GRAVITY
    assert drive(100.0)["lift"] == pytest.approx(0.2, abs=1e-4)
    assert robot.readings[robot.joint_names.index("lift")].effort == pytest.approx(weight, rel=0.01)
    assert drive(1.01 * weight)["lift"] == pytest.approx(0.2, abs=1e-4)
    assert drive(0.99 * weight)["lift"] < 0.2 - 0.5 * 0.009 * GRAVITY * 0.5**2


def test_mujoco_refuses_a_planar_joint_by_name(convex_parts: ConvexParts) -> None:
    world = PhysicsWorld(PhysicsSettings(), convex_parts, engine=MUJOCO)
    text = '<robot name="bad"><link name="a"/><link name="b"/><joint name="j" type="planar"><parent link="a"/>'
    with pytest.raises(DescriptionError, match=r"model 'bad', joint 'j': is of type 'planar'; allowed .* fixed, revol"):
        world.engine.load_urdf(text + '<child link="b"/></joint></robot>', "bad", True)


def test_what_mujoco_refuses_changes_nothing(convex_parts: ConvexParts) -> None:
    world = PhysicsWorld(PhysicsSettings(), convex_parts, engine=MUJOCO)
    body = world.spawn(solid("stone", CUBE, Pose((0, 0, 3))))
    run(world, 0.1)
    before = exact_state(world)
    flat = solid("flat", specs.Box((0.1, 0.1, 0.0)), Pose((1, 0, 1)))
    with pytest.raises(DescriptionError, match="model 'flat': is rejected by the physics engine mujoco .*size"):
        world.spawn(flat)
    assert exact_state(world) == before
    run(world, 0.1)
    assert body.state().twist.linear[2] == pytest.approx(-0.2 * 9.8, rel=1e-6)


def test_mujoco_names_the_link_whose_inertia_no_body_has(convex_parts: ConvexParts) -> None:
    lines: list[str] = []
    world = PhysicsWorld(PhysicsSettings(), convex_parts, log=lines.append, engine=MUJOCO, gui=True)
    inertial = specs.Inertial(Pose(), 1.0, (0.001, 0, 0, 0.001, 0, 0.004))
    link = specs.Link("link", Pose(), inertial, (), ())
    world.spawn(specs.Model("odd", Pose((0, 0, 2)), False, (link,), (), "test"))
    assert "window" in lines[0]
    assert "model 'odd', link 'link': no rigid body has the moments of inertia [0.001, 0.001, 0.004]" in lines[1]
    assert world.engine.mass_properties(world.body("odd").number, BASE_INDEX).moments == pytest.approx((0.002,) * 3)
