# SPDX-License-Identifier: BSD-3-Clause
"""Hashes the motion of the world, to compare two runs bit for bit and to find their first difference."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass

from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody

CHECKPOINT_STEPS = 50


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """Hash of all physics steps up to and including `step`."""

    step: int
    digest: str


class WorldDigest:
    """Hashes the robot's joint positions and velocities and the models' poses after every physics step.

    Args:
        world: World of the models.
        robot: The robot; None for a world without a robot.
    """

    def __init__(self, world: PhysicsWorld, robot: RobotBody | None) -> None:
        self._world, self._robot = world, robot
        self._hash = hashlib.sha256()
        self._last_step = 0
        self.checkpoints: list[Checkpoint] = []

    def add(self) -> None:
        """Adds the state after a step; the first step of the world starts a new hash."""
        step = self._world.steps
        if step <= self._last_step:
            self._hash, self.checkpoints = hashlib.sha256(), []
        self._last_step = step
        values = (
            [] if self._robot is None else [x for item in self._robot.read() for x in (item.position, item.velocity)]
        )
        for name in self._world.names():
            body = self._world.body(name)
            if not body.static:
                pose = body.state().pose
                values += (*pose.position, *pose.quaternion)
        self._hash.update(struct.pack(f"<q{len(values)}d", step, *values))
        if step % CHECKPOINT_STEPS == 0:
            self.checkpoints.append(self.current_checkpoint())

    def current_checkpoint(self) -> Checkpoint:
        """Returns the hash of all steps so far."""
        return Checkpoint(self._last_step, self._hash.hexdigest())
