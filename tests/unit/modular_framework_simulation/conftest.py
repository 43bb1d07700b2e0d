# SPDX-License-Identifier: BSD-3-Clause
"""Worlds for tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.engine_choice import PYBULLET
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_testing.simulation.simulated_samples import solid
from modular_framework_urdf.rotations import Vector3


@pytest.fixture(scope="session")
def convex_parts(tmp_path_factory: pytest.TempPathFactory) -> ConvexParts:
    """A mesh cache that lives as long as the tests."""
    return ConvexParts(tmp_path_factory.mktemp("convex_parts"))


@pytest.fixture
def engine() -> str:
    """The physics engine of the worlds; modules that test several have a fixture of their own."""
    return PYBULLET


@pytest.fixture
def make_world(convex_parts: ConvexParts, engine: str) -> Iterator[Callable[..., PhysicsWorld]]:
    """Makes worlds with a floor at z = 0 and takes them down at the end."""
    worlds: list[PhysicsWorld] = []

    def make(
        time_step_ns: int = 2_000_000, gravity: Vector3 = (0.0, 0.0, -9.81), rest_speed: float = 0.003
    ) -> PhysicsWorld:
        settings = PhysicsSettings(time_step_ns, rest_speed=rest_speed)
        world = PhysicsWorld(settings, convex_parts, gravity, engine=engine)
        world.spawn(solid("floor", specs.Plane((0, 0, 1), (10, 10)), Pose(), static=True))
        worlds.append(world)
        return world

    yield make
    for world in worlds:
        world.close()


@pytest.fixture
def world(make_world: Callable[..., PhysicsWorld]) -> PhysicsWorld:
    """A world with a floor at z = 0."""
    return make_world()
