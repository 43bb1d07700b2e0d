# SPDX-License-Identifier: BSD-3-Clause
"""Records the true state of the world over time: poses, velocities, joints, contacts, and what the grippers hold.

The record is written in the simulation's process, so no other node can change its samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from modular_framework_simulation.models.model_extents import bounding_box
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import SimulatedBody


class WorldRecord:
    """Samples of the world between `start` and `stop`, as differences to the previous sample.

    All methods are called by the loop's thread.

    Args:
        world: World of the models.
        held: Function that returns the names of the objects that the grippers hold.
    """

    def __init__(self, world: PhysicsWorld, held: Callable[[], Iterable[str]]) -> None:
        self._world, self._held_now = world, held
        self._running = False
        self._forget()

    def _forget(self) -> None:
        self._samples: list[list[Any]] = []
        self._known: set[str] = set()
        self._revision = -1
        self._touched: dict[str, set[str]] = {}
        self._contacts: list[tuple[str, ...]] | None = None
        self._held: list[str] | None = None

    def start(self) -> None:
        """Begins a new record with a sample of the present state."""
        self._forget()
        self._running = True
        self.sample()

    def stop(self) -> dict[str, Any]:
        """Ends the record with a sample of the present state.

        Returns:
            `samples`: time [s], then the changes since the previous sample: state of each model (position [m],
            quaternion xyzw, linear velocity [m/s], angular velocity [rad/s], positions of its joints [rad or m]; null
            for a deleted model), pairs of touching models, and held objects, each null if unchanged;
            `boxes`: bounding box of each model in its own frame [m]; `robots`: names of the robots.
        """
        self.sample()
        self._running = False
        bodies = self._world.bodies
        boxes = {name: bounding_box(body.spec) for name, body in bodies.items() if body.spec is not None}
        content = {
            "samples": self._samples,
            "boxes": {name: box for name, box in boxes.items() if box is not None},
            "robots": [name for name, body in bodies.items() if body.spec is None],
        }
        self._forget()
        return content

    def sample(self) -> None:
        """Adds a sample, unless no record is running; used as a hook."""
        if not self._running:
            return
        world = self._world
        states: dict[str, Any] = {}
        requested = world.revision != self._revision  # a request may also move a static model
        self._revision = world.revision
        moving, present = world.moving(), set(world.bodies)
        states |= {name: None for name in self._known - present}
        for name in present if requested else moving:
            body = world.bodies[name]
            if requested or not body.static:
                states[name] = self._state(body)
        self._update_contacts(moving | present - self._known, self._known - present)
        pairs = {tuple(sorted((name, other))) for name, others in self._touched.items() for other in others}
        contacts, held = sorted(pairs), sorted(self._held_now())
        self._known = present
        self._samples.append(
            [
                world.time_ns * 1e-9,
                states,
                None if contacts == self._contacts else contacts,
                None if held == self._held else held,
            ]
        )
        self._contacts, self._held = contacts, held

    def _state(self, body: SimulatedBody) -> list[Any]:
        """Returns pose, twist and joints of a model; the joints of a robot are on its own topic."""
        state = body.state()
        values = (*state.pose.position, *state.pose.quaternion, *state.twist.linear, *state.twist.angular)
        return [*values, dict(self._joints(body)) if body.spec is not None else {}]

    def _joints(self, body: SimulatedBody) -> Iterator[tuple[str, float]]:
        for part in body.parts:
            if part.joint_indices:
                states = self._world.engine.joint_states(part.number, list(part.joint_indices.values()))
                yield from zip(part.joint_indices, (state.position for state in states), strict=True)

    def _update_contacts(self, moving: Iterable[str], gone: Iterable[str]) -> None:
        """Updates the models that each model presses on; resting models keep their contacts."""
        for name in (*moving, *gone):
            self._touched.pop(name, None)
            for others in self._touched.values():
                others.discard(name)
        for name in moving:
            body = self._world.bodies[name]
            if not body.static or body.spec is None:
                self._touched[name] = self._world.touched_models(body)
