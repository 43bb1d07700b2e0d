# SPDX-License-Identifier: BSD-3-Clause
"""Copies of the state of the world for the other threads of the process."""

from __future__ import annotations

from dataclasses import dataclass

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_engine import REST_LOOK_S
from modular_framework_simulation.physics.physics_world import PhysicsWorld

_LONGEST_NS = round(REST_LOOK_S * 1e9)


@dataclass(frozen=True, slots=True)
class LinkSnapshot:
    """A link with collision shapes, and its pose."""

    spec: specs.Link
    pose_in_world: Pose


@dataclass(frozen=True, slots=True)
class ModelSnapshot:
    """A model that is not a robot.

    Attributes:
        name: Instance name.
        instance: Number that no other model of this run has: a model that was deleted and spawned again differs.
        static: Never moves.
        links: Those with collision shapes.
    """

    name: str
    instance: int
    static: bool
    links: tuple[LinkSnapshot, ...]


@dataclass(frozen=True, slots=True)
class HeldObject:
    """An object in a gripper.

    Attributes:
        model: Its instance name.
        carrier_link: Link of the robot it is carried by.
        carrier_in_world: Pose of that link.
        touch_links: Links of the gripper, which may touch it.
    """

    model: str
    carrier_link: str
    carrier_in_world: Pose
    touch_links: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class WorldSnapshot:
    """Models and grasps at one moment.

    Attributes:
        time_s: Simulated time [s].
        models: All models but robots.
        held: What the grippers hold.
        time_ns: Simulated time [ns].
        revision: Of the world: differs once something was spawned, deleted or moved by a request.
    """

    time_s: float
    models: tuple[ModelSnapshot, ...]
    held: tuple[HeldObject, ...]
    time_ns: int = 0
    revision: int = 0


def take_snapshot(
    world: PhysicsWorld, held: tuple[HeldObject, ...], before: WorldSnapshot | None = None
) -> WorldSnapshot:
    """Copies the state of the world; to be called from the loop's thread.

    Args:
        world: The models.
        held: What the grippers hold.
        before: The last snapshot, at most REST_LOOK_S ago: models at rest are taken from it, which one that was touched
            since then may not be any more. None copies the present state of every model.
    """
    if before is not None and before.revision == world.revision and 0 <= world.time_ns - before.time_ns <= _LONGEST_NS:
        moving = world.moving()
        models = tuple(_copy(world, model.name) if model.name in moving else model for model in before.models)
    else:
        models = tuple(_copy(world, name) for name, body in world.bodies.items() if body.spec is not None)
    return WorldSnapshot(world.time_ns * 1e-9, models, held, world.time_ns, world.revision)


def _copy(world: PhysicsWorld, name: str) -> ModelSnapshot:
    body = world.body(name)
    assert body.spec is not None
    links = tuple(LinkSnapshot(link, body.link_state(link.name).pose) for link in body.spec.links if link.collisions)
    return ModelSnapshot(name, world.instance(name), body.static, links)
