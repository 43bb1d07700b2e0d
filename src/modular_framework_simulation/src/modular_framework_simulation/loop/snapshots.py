# SPDX-License-Identifier: BSD-3-Clause
"""Copies of the world's state for other threads of the process."""

from __future__ import annotations

from dataclasses import dataclass

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_world import PhysicsWorld


@dataclass(frozen=True, slots=True)
class LinkSnapshot:
    """A link with collision shapes, and its pose."""

    spec: specs.Link
    pose_in_world: Pose


@dataclass(frozen=True, slots=True)
class ModelSnapshot:
    """State of a model that is not a robot.

    Attributes:
        name: Name of the model in the world.
        instance: Number that is unique in this run; a model that is deleted and spawned again gets a new number.
        static: Whether the model never moves.
        links: Links with collision shapes.
    """

    name: str
    instance: int
    static: bool
    links: tuple[LinkSnapshot, ...]


@dataclass(frozen=True, slots=True)
class HeldObject:
    """An object held by a gripper.

    Attributes:
        model: Name of the object's model.
        carrier_link: Robot link that carries the object.
        carrier_in_world: Pose of the carrier link in the world frame.
        touch_links: Links of the gripper that may touch the object.
    """

    model: str
    carrier_link: str
    carrier_in_world: Pose
    touch_links: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class WorldSnapshot:
    """State of the models and grasps at one instant.

    Attributes:
        time_s: Simulated time [s].
        models: All models except robots.
        held: Objects held by the grippers.
        time_ns: Simulated time [ns].
        revision: Revision of the world, which changes when a request spawns, deletes or moves a model.
    """

    time_s: float
    models: tuple[ModelSnapshot, ...]
    held: tuple[HeldObject, ...]
    time_ns: int = 0
    revision: int = 0


def take_snapshot(
    world: PhysicsWorld, held: tuple[HeldObject, ...], previous: WorldSnapshot | None = None
) -> WorldSnapshot:
    """Copies the state of the world; must be called from the loop's thread.

    Args:
        world: World of the models.
        held: Objects held by the grippers.
        previous: Last snapshot; if recent, the states of sleeping models are copied from this snapshot. None copies the
            current state of every model.
    """
    if previous is not None and previous.revision == world.revision:
        moved = world.moved_since(previous.time_ns, previous.revision)
        models = tuple(_copy(world, model.name) if model.name in moved else model for model in previous.models)
    else:
        models = tuple(_copy(world, name) for name, body in world.bodies.items() if body.spec is not None)
    return WorldSnapshot(world.time_ns * 1e-9, models, held, world.time_ns, world.revision)


def _copy(world: PhysicsWorld, name: str) -> ModelSnapshot:
    body = world.body(name)
    assert body.spec is not None
    links = tuple(LinkSnapshot(link, body.link_state(link.name).pose) for link in body.spec.links if link.collisions)
    return ModelSnapshot(name, world.instance(name), body.static, links)
