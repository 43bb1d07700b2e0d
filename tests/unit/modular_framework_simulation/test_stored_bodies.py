# SPDX-License-Identifier: BSD-3-Clause
"""Bodies at rest that PyBullet does not contain while nothing is near them move as if they were always there."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from modular_framework_simulation.loop.world_record import WorldRecord
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.physics import pybullet_rest
from modular_framework_simulation.physics.applied_forces import Interval, JointEffort, LinkWrench
from modular_framework_simulation.physics.body_joints import measured_joint
from modular_framework_simulation.physics.model_changes import JointChange, set_joint, set_joint_positions
from modular_framework_simulation.physics.part_names import PartName
from modular_framework_simulation.physics.physics_engine import BASE_INDEX
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, JointSettings, Twist
from modular_framework_testing.simulation.simulated_samples import exact_state, run, solid

GRAVITY = 9.81
CUBE = specs.Box((0.05, 0.05, 0.05))
MASS_KG = 0.2
LONG_S = 4.5
TOP_M = 0.575
WHEEL = """<sdf version='1.6'><model name='wheel'><pose>5 0 1 0 0 0</pose><link name='disc'>
  <inertial><mass>1</mass><inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz></inertia></inertial></link>
  <joint name='axle' type='revolute'><parent>world</parent><child>disc</child><axis><xyz>0 0 1</xyz></axis></joint>
  </model></sdf>"""

CHEST = """<sdf version='1.6'><model name='chest'><pose>0 2 0.05 0 0 0</pose>
  <link name='box'><inertial><mass>1</mass><inertia><ixx>.002</ixx><iyy>.002</iyy><izz>.002</izz></inertia></inertial>
    <collision name='c'><geometry><box><size>.2 .2 .1</size></box></geometry></collision></link>
  <link name='lid'><pose>0 0 0.056 0 0 0</pose>
    <inertial><mass>.1</mass><inertia><ixx>3e-4</ixx><iyy>3e-4</iyy><izz>6e-4</izz></inertia></inertial>
    <collision name='c'><geometry><box><size>.2 .2 .01</size></box></geometry></collision></link>
  <link name='lock'><pose>0.11 0 0 0 0 0</pose>
    <inertial><mass>.1</mass><inertia><ixx>1e-4</ixx><iyy>1e-4</iyy><izz>1e-4</izz></inertia></inertial>
    <collision name='c'><geometry><box><size>.02 .02 .02</size></box></geometry></collision></link>
  <joint name='bolt' type='fixed'><parent>box</parent><child>lock</child></joint>
  <joint name='hinge' type='revolute'><pose>-.1 0 0 0 0 0</pose><parent>box</parent><child>lid</child>
    <axis><xyz>0 -1 0</xyz><limit><lower>0</lower><upper>2</upper></limit><dynamics><friction>.3</friction></dynamics>
    </axis></joint></model></sdf>"""
HINGE = PartName("chest", "hinge")

MakeWorld = Callable[..., PhysicsWorld]


def bodies_in_engine(world: PhysicsWorld) -> int:
    return int(world.engine.api.getNumBodies(physicsClientId=world.engine.client))


def height(world: PhysicsWorld, name: str) -> float:
    return world.entity_state(name).pose.position[2]


def furnish(world: PhysicsWorld) -> None:
    """Adds a table with a stack of two cubes, a cube on the floor, and a wheel that turns far from them."""
    place(world)
    run(world, LONG_S)


def place(world: PhysicsWorld) -> None:
    world.spawn(solid("table", specs.Box((1, 1, 0.1)), Pose((0, 0, 0.5)), static=True))
    world.spawn(solid("cube", CUBE, Pose((0, 0, TOP_M)), mass=MASS_KG))
    world.spawn(solid("upper", CUBE, Pose((0, 0, TOP_M + 0.05)), mass=MASS_KG))
    world.spawn(solid("lone", CUBE, Pose((0, 2, 0.025)), mass=MASS_KG))
    world.spawn(read_model_text(WHEEL, "text", Resources()))
    set_joint(world, PartName("wheel", "axle"), JointChange(None, None, JointSettings(None, 1.0, 5.0)))


@pytest.fixture(autouse=True)
def _store_every_body(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pybullet_rest, "MAX_ASLEEP", 0)


@pytest.fixture
def stored(make_world: MakeWorld) -> PhysicsWorld:
    """A furnished world whose cubes are not in the engine."""
    world = make_world()
    furnish(world)
    assert bodies_in_engine(world) == 2  # floor and wheel
    return world


def test_few_bodies_at_rest_stay_in_the_engine(make_world: MakeWorld, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    world = make_world()
    furnish(world)
    assert bodies_in_engine(world) == 6


def test_states_of_stored_bodies_are_those_at_rest(stored: PhysicsWorld) -> None:
    assert stored.moving() == {"wheel"}
    assert stored.entity_state("upper").twist == Twist()
    assert height(stored, "cube") == pytest.approx(TOP_M, abs=1e-3)
    assert height(stored, "upper") == pytest.approx(TOP_M + 0.05, abs=1e-3)


def test_a_stored_body_that_is_hit_takes_up_the_momentum(stored: PhysicsWorld) -> None:
    stored.spawn(solid("ball", specs.Sphere(0.05), Pose((-0.8, 2, 0.05)), mass=2.0))
    stored.set_state("ball", BodyState(Pose((-0.8, 2, 0.05)), Twist((5.0, 0, 0))))
    run(stored, 0.2)
    ball, lone = (stored.entity_state(name) for name in ("ball", "lone"))
    assert lone.pose.position[0] > ball.pose.position[0]
    assert lone.twist.linear[0] > 1.0
    assert ball.twist.linear[0] < 4.95


@pytest.mark.parametrize("deleted", [True, False])
def test_a_stored_stack_falls_when_its_support_is_gone(stored: PhysicsWorld, deleted: bool) -> None:
    if deleted:
        stored.delete("table")
    else:
        stored.set_state("table", BodyState(Pose((3, 0, 0.5)), Twist()))
    run(stored, 0.2)
    fall_m = 0.5 * GRAVITY * 0.2**2
    assert height(stored, "cube") == pytest.approx(TOP_M - fall_m, abs=0.01)
    assert height(stored, "upper") == pytest.approx(TOP_M + 0.05 - fall_m, abs=0.01)


def test_what_lay_on_a_stored_body_falls_when_that_is_moved(stored: PhysicsWorld) -> None:
    stored.set_state("cube", BodyState(Pose((0, 3, 0.025)), Twist()))
    run(stored, 0.5)
    assert height(stored, "upper") == pytest.approx(TOP_M, abs=2e-3)


def test_a_force_on_a_stored_body_accelerates_it_like_one_in_the_engine(stored: PhysicsWorld) -> None:
    begin = stored.time_ns
    wrench = LinkWrench(PartName("lone", "link"), (0, 0, 4.0), (0, 0, 0), Interval(begin, begin + 100_000_000))
    before = height(stored, "lone")
    stored.forces.add_wrench(wrench)
    run(stored, 0.1)
    rise_m = 0.5 * (4.0 / MASS_KG - GRAVITY) * 0.1**2
    assert height(stored, "lone") - before == pytest.approx(rise_m, rel=0.05)


def test_a_stored_body_feels_another_gravity(stored: PhysicsWorld) -> None:
    stored.set_physics(stored.settings, (0.0, 0.0, 2.0))
    run(stored, 0.5)
    assert height(stored, "lone") == pytest.approx(0.025 + 0.5 * 2.0 * 0.5**2, abs=0.01)


def test_a_static_model_that_is_put_into_a_stored_body_pushes_it_out(stored: PhysicsWorld) -> None:
    stored.spawn(solid("shelf", specs.Box((0.4, 0.4, 0.05)), Pose((0, 2, 0.0)), static=True))
    run(stored, 2.0)
    assert height(stored, "lone") == pytest.approx(0.05, abs=2e-3)


@pytest.mark.parametrize("name", ["lone", "table"])
def test_contacts_of_stored_bodies_are_read_after_the_next_step(stored: PhysicsWorld, name: str) -> None:
    weight = GRAVITY * MASS_KG * (1 if name == "lone" else 2)
    body = stored.body(name)
    stored.contacts(body, BASE_INDEX)
    run(stored, 2.6)
    assert sum(each.force for each in stored.contacts(body, BASE_INDEX)) == pytest.approx(weight, rel=0.02)


def test_friction_of_a_stored_body_remains(make_world: MakeWorld) -> None:
    slides = []
    for maximum in (0, 100):
        pybullet_rest.MAX_ASLEEP = maximum
        world = make_world()
        furnish(world)
        world.set_state("lone", BodyState(world.entity_state("lone").pose, Twist((1.0, 0, 0))))
        run(world, 1.0)
        slides.append(world.entity_state("lone").pose.position[0])
    assert slides[0] == pytest.approx(slides[1], rel=0.03)


def test_names_belong_to_the_same_bodies_after_bodies_came_and_went(stored: PhysicsWorld) -> None:
    stored.spawn(solid("new", CUBE, Pose((0, -2, 0.025))))
    stored.delete("lone")
    stored.set_state("cube", BodyState(Pose((0, 3, 0.025)), Twist()))
    stored.spawn(solid("late", CUBE, Pose((0, -3, 0.025))))
    run(stored, LONG_S)
    places = {name: stored.entity_state(name).pose.position[1] for name in ("cube", "upper", "new", "late")}
    assert places == pytest.approx({"cube": 3.0, "upper": 0.0, "new": -2.0, "late": -3.0}, abs=2e-3)


def test_runs_with_stored_bodies_are_equal_bit_for_bit(make_world: MakeWorld) -> None:
    ends = []
    for _ in range(2):
        world = make_world()
        furnish(world)
        world.delete("table")
        run(world, 1.0)
        ends.append(exact_state(world))
    assert ends[0] == ends[1]


def test_the_record_of_the_world_keeps_the_contacts_of_stored_bodies_and_leaves_them_stored(
    make_world: MakeWorld,
) -> None:
    world = make_world()
    record = WorldRecord(world, lambda: ())
    place(world)
    record.start()
    for _ in range(round(LONG_S / 0.02)):
        run(world, 0.02)
        record.sample()
    assert bodies_in_engine(world) == 2
    samples = record.stop()["samples"]
    contacts = [sample[2] for sample in samples if sample[2] is not None][-1]
    assert {("cube", "table"), ("cube", "upper")} <= set(contacts)
    assert bodies_in_engine(world) == 2


@pytest.fixture
def chest(make_world: MakeWorld) -> PhysicsWorld:
    """A world with a stored chest, whose lid is held open by the friction of its hinge, and a wheel that turns."""
    world = make_world()
    world.spawn(read_model_text(CHEST, "text", Resources()))
    world.spawn(read_model_text(WHEEL, "text", Resources()))
    set_joint(world, PartName("wheel", "axle"), JointChange(None, None, JointSettings(None, 1.0, 5.0)))
    set_joint_positions(world, "chest", {"hinge": 1.0})
    run(world, LONG_S)
    assert bodies_in_engine(world) == 2  # floor and wheel
    return world


def lid(world: PhysicsWorld) -> float:
    return measured_joint(world.engine, world.body("chest"), "hinge").position


def test_links_and_joints_of_a_stored_model_are_read_without_loading_the_model(chest: PhysicsWorld) -> None:
    body = chest.body("chest")
    index = body.joint_indices["hinge"]
    assert chest.engine.joint_states(body.number, [index])[0].position == pytest.approx(1.0, abs=0.01)
    in_chest = chest.state_relative_to("chest::lid", "chest").pose.position
    across, up = 0.1 * math.cos(1.0) - 0.1, 0.056 + 0.1 * math.sin(1.0)
    assert in_chest == pytest.approx((across, 0.0, up), abs=2e-3)
    assert chest.entity_state("chest::lock").twist == Twist()
    assert chest.moving() == {"wheel"}
    assert bodies_in_engine(chest) == 2


def test_a_stored_model_that_is_hit_keeps_its_joints_and_their_friction(chest: PhysicsWorld) -> None:
    chest.spawn(solid("ball", specs.Sphere(0.04), Pose((-0.8, 2, 0.05)), mass=1.0))
    chest.set_state("ball", BodyState(Pose((-0.8, 2, 0.05)), Twist((3.0, 0, 0))))
    run(chest, 0.3)
    assert chest.entity_state("chest").twist.linear[0] > 0.3 or chest.entity_state("chest").pose.position[0] > 0.02
    run(chest, 2.0)
    assert lid(chest) == pytest.approx(1.0, abs=0.3)
    assert chest.entity_state("chest").pose.position[2] == pytest.approx(0.05, abs=2e-3)


def test_an_effort_moves_the_joint_of_a_stored_model(chest: PhysicsWorld) -> None:
    begin = chest.time_ns
    chest.forces.add_effort(JointEffort(HINGE, 0.6, Interval(begin, begin + 200_000_000)))
    run(chest, 0.2)
    assert lid(chest) > 1.3


def test_a_joint_of_a_stored_model_that_is_set_stays_there(chest: PhysicsWorld) -> None:
    set_joint_positions(chest, "chest", {"hinge": 0.4})
    run(chest, 0.5)
    assert lid(chest) == pytest.approx(0.4, abs=0.01)


def test_a_model_with_joints_sleeps_beside_moving_bodies(
    make_world: MakeWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()
    world = make_world()
    world.spawn(read_model_text(CHEST, "text", Resources()))
    world.spawn(solid("cube", CUBE, Pose((0, 2, 0.1361)), mass=MASS_KG))  # on the lid
    world.spawn(read_model_text(WHEEL, "text", Resources()))
    set_joint(world, PartName("wheel", "axle"), JointChange(None, None, JointSettings(None, 1.0, 5.0)))
    run(world, LONG_S + 1.0)
    assert world.moving() == {"wheel"}
    assert world.entity_state("cube").pose.position[2] == pytest.approx(0.136, abs=2e-3)


def test_a_stored_static_model_stops_a_body_that_falls_on_it(stored: PhysicsWorld) -> None:
    stored.spawn(solid("ball", specs.Sphere(0.05), Pose((0.3, 0, 2.0)), mass=2.0))
    run(stored, 2.0)
    assert stored.entity_state("ball").pose.position[2] == pytest.approx(0.6, abs=5e-3)


def test_stored_static_models_of_a_world_without_other_models_are_deleted_and_moved(make_world: MakeWorld) -> None:
    world = make_world()
    for name, y in (("table", 0.0), ("shelf", 3.0)):
        world.spawn(solid(name, CUBE, Pose((0, y, 0.5)), static=True))
    run(world, 0.3)
    assert bodies_in_engine(world) == 0
    world.delete("table")
    world.set_state("shelf", BodyState(Pose((0, 0, 1.0)), Twist()))
    run(world, 0.3)
    assert world.names() == ["floor", "shelf"]
    world.spawn(solid("cube", CUBE, Pose((0, 0, 1.1))))
    run(world, 1.0)
    assert height(world, "cube") == pytest.approx(1.05, abs=2e-3)
