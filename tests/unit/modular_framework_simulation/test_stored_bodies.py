# SPDX-License-Identifier: BSD-3-Clause
"""Bodies at rest that PyBullet does not contain while nothing is near them move as if they were always there."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from modular_framework_simulation.loop.world_record import WorldRecord
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.physics import pybullet_rest
from modular_framework_simulation.physics.applied_forces import Interval, LinkWrench
from modular_framework_simulation.physics.model_changes import JointChange, set_joint
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
    assert bodies_in_engine(world) == 3  # floor, table and wheel
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
    assert bodies_in_engine(world) == 3
    samples = record.stop()["samples"]
    contacts = [sample[2] for sample in samples if sample[2] is not None][-1]
    assert {("cube", "table"), ("cube", "upper")} <= set(contacts)
    assert bodies_in_engine(world) == 3
