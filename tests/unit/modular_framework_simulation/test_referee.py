# SPDX-License-Identifier: BSD-3-Clause
"""The referee notes what moves beside the physics, and nothing of what falls, collides or is carried."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from modular_framework_simulation.loop.referee import MAX_INTERVENTIONS, Referee
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, Twist
from modular_framework_testing.simulation.simulated_samples import solid

CUBE = specs.Box((0.05, 0.05, 0.05))
LOOK_STEPS = 10


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Iterator[str]:
    """Each physics engine."""
    yield request.param


def watched(world: PhysicsWorld, referee: Referee, duration_s: float) -> None:
    """Lets time pass; the referee looks every 20 ms, as in the loop."""
    for _ in range(round(duration_s / (LOOK_STEPS * world.settings.time_step_s))):
        for _ in range(LOOK_STEPS):
            world.step()
        referee.look_for_jumps()


def test_what_falls_bounces_and_is_hit_is_no_intervention(world: PhysicsWorld) -> None:
    referee = Referee(world)
    world.spawn(solid("ball", specs.Sphere(0.03), Pose((0, 0, 1.5))))
    world.spawn(solid("struck", CUBE, Pose((1.0, 0, 0.025))))
    world.spawn(solid("striker", CUBE, Pose((0.93, 0, 0.05)), mass=2.0))
    world.set_state("striker", BodyState(Pose((0.93, 0, 0.05)), Twist((6.0, 0, 0), (0, 3.0, 0))))
    watched(world, referee, 1.5)
    assert world.body("struck").state().pose.position[0] > 1.1
    assert referee.interventions == ()


def test_a_jump_that_no_velocity_explains_is_noted_with_its_length(world: PhysicsWorld) -> None:
    referee, cube = Referee(world), world.spawn(solid("cube", CUBE, Pose((0, 0, 0.025))))
    watched(world, referee, 0.2)
    world.engine.set_base_centre(cube.number, Pose((0, 0, 0.525)))
    watched(world, referee, 0.1)
    (noted,) = referee.interventions
    assert noted.what.startswith("a jump of 'cube' by 0.49") and noted.caller == ""  # less what it fell


def test_a_request_that_moves_a_model_is_noted_by_its_service_only(world: PhysicsWorld) -> None:
    referee = Referee(world)
    world.spawn(solid("cube", CUBE, Pose((0, 0, 0.025))))
    watched(world, referee, 0.1)
    world.set_state("cube", BodyState(Pose((0, 0, 1.0)), Twist()))
    referee.note("/gazebo/set_model_state", "/somebody")
    watched(world, referee, 0.3)
    assert [(each.what, each.caller) for each in referee.interventions] == [("/gazebo/set_model_state", "/somebody")]


def test_interventions_keep_their_numbers_however_many_there_are(world: PhysicsWorld) -> None:
    referee = Referee(world)
    for _ in range(2 * MAX_INTERVENTIONS):
        referee.note("/gazebo/set_model_state", "/somebody")
    numbers = [each.number for each in referee.interventions]
    assert numbers == list(range(MAX_INTERVENTIONS + 1, 2 * MAX_INTERVENTIONS + 1))
