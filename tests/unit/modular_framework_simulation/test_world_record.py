# SPDX-License-Identifier: BSD-3-Clause
"""The record of the world has the true states, contacts and joints, as changes since the sample before."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from modular_framework_simulation.loop.world_record import WorldRecord
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.model_extents import bounding_box
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, Twist
from modular_framework_testing.simulation.simulated_samples import solid

CUBE = specs.Box((0.05, 0.05, 0.05))


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Iterator[str]:
    """Each physics engine."""
    yield request.param


def passed(world: PhysicsWorld, record: WorldRecord, samples: int) -> None:
    for _ in range(samples):
        for _ in range(10):
            world.step()
        record.sample()


def test_a_fall_is_recorded_with_its_velocity_and_its_contact(world: PhysicsWorld) -> None:
    world.spawn(solid("cube", CUBE, Pose((0, 0, 0.225))))
    record = WorldRecord(world, lambda: ())
    record.start()
    passed(world, record, 30)
    content = record.stop()
    samples, floor = content["samples"], world.names()[0]
    assert [sample[0] for sample in samples[:31]] == pytest.approx([0.02 * n for n in range(31)])
    assert samples[0][1]["cube"][:3] == pytest.approx([0, 0, 0.225]) and floor in samples[0][1]
    fallen = samples[5][1]["cube"]
    assert fallen[9] == pytest.approx(-9.81 * 0.1, rel=0.03) and floor not in samples[5][1]
    contacts = [sample[2] for sample in samples if sample[2] is not None]
    assert contacts[0] == [] and contacts[-1] == [tuple(sorted(("cube", floor)))]
    assert content["boxes"]["cube"] == ((-0.025,) * 3, (0.025,) * 3) and content["robots"] == []


def test_nothing_is_recorded_before_the_start_and_a_new_record_forgets_the_old_one(world: PhysicsWorld) -> None:
    world.spawn(solid("cube", CUBE, Pose((0, 0, 0.025))))
    held = {"cube"}
    record = WorldRecord(world, lambda: held)
    record.sample()
    assert len(record.stop()["samples"]) == 0
    record.start()
    passed(world, record, 3)
    record.start()
    passed(world, record, 1)
    held.clear()
    samples = record.stop()["samples"]
    assert len(samples) == 3 and [sample[3] for sample in samples] == [["cube"], None, []]


def test_models_that_appear_move_by_request_and_vanish_are_in_the_record(world: PhysicsWorld) -> None:
    record = WorldRecord(world, lambda: ())
    record.start()
    world.spawn(solid("cube", CUBE, Pose((0, 0, 0.025))))
    passed(world, record, 1)
    world.set_state("cube", BodyState(Pose((1.0, 0, 0.025)), Twist()))
    passed(world, record, 1)
    world.delete("cube")
    passed(world, record, 1)
    samples = record.stop()["samples"]
    assert "cube" not in samples[0][1] and samples[1][1]["cube"][0] == pytest.approx(0.0, abs=1e-3)
    assert samples[2][1]["cube"][0] == pytest.approx(1.0, abs=1e-3) and samples[3][1]["cube"] is None


def test_a_resting_stack_keeps_its_contacts_and_loses_those_of_what_is_taken_away(world: PhysicsWorld) -> None:
    for number in range(3):
        world.spawn(solid(f"cube_{number}", CUBE, Pose((0, 0, 0.025 + 0.05 * number))))
    record = WorldRecord(world, lambda: ())
    record.start()
    passed(world, record, 200)
    world.set_state("cube_2", BodyState(Pose((1.0, 0, 0.5)), Twist()))
    passed(world, record, 2)
    contacts: list[tuple[str, str]] = []
    for sample in record.stop()["samples"]:
        contacts = contacts if sample[2] is None else sample[2]
        if sample[0] == pytest.approx(4.0):
            assert {("cube_0", "cube_1"), ("cube_1", "cube_2")} <= set(contacts)
    assert ("cube_0", "cube_1") in contacts and not any("cube_2" in pair for pair in contacts)


def test_a_bounding_box_contains_turned_shapes_in_the_frame_of_the_model() -> None:
    turned = Pose.from_xyz_rpy((0.1, 0.0, 0.0), (0.0, 0.0, math.pi / 4))
    shape = specs.Collision("shape", turned, CUBE, specs.Friction(0.8))
    model = solid("a", specs.Box((0.2, 0.2, 0.4)), Pose((5.0, 5.0, 5.0)), surface=shape)
    low, high = bounding_box(model) or ((), ())
    assert low == pytest.approx((0.1 - 0.1 * math.sqrt(2), -0.1 * math.sqrt(2), -0.2))
    assert high == pytest.approx((0.1 + 0.1 * math.sqrt(2), 0.1 * math.sqrt(2), 0.2))
