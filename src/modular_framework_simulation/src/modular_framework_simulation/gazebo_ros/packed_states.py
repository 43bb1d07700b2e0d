# SPDX-License-Identifier: BSD-3-Clause
"""Messages with the states of all models or links, of which only the entries that moved are serialized again.

The messages of a world of 3,000 objects at rest would otherwise take longer than the physics.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from io import BytesIO

import numpy as np
from gazebo_msgs.msg import LinkStates, ModelStates

from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState

Entries = Callable[[str], Sequence[tuple[str, BodyState]]]
"""Function that returns the names and states of the entries of a model."""


class PackedStates:
    """Names, poses and twists of entries as arrays of numbers.

    Args:
        world: The world.
        entries: Function that returns the entries of a model.
    """

    def __init__(self, world: PhysicsWorld, entries: Entries) -> None:
        self._world, self._entries = world, entries
        self._time_ns = self._revision = -1
        self._names = b""
        self._rows: dict[str, int] = {}  # first row of each model
        self._poses, self._twists = np.zeros((0, 7), "<f8"), np.zeros((0, 6), "<f8")

    def update(self) -> None:
        """Reads the states of the models that may have moved since the last call."""
        world = self._world
        moved = world.moved_since(self._time_ns, self._revision, woken=True)
        if self._revision != world.revision:
            found = {name: self._entries(name) for name in world.names()}
            names = [name.encode() for entries in found.values() for name, _ in entries]
            self._names = b"".join(struct.pack("<I", len(name)) + name for name in names)
            ends = np.cumsum([len(entries) for entries in found.values()], dtype=int).tolist()
            self._rows = dict(zip(found, [0, *ends[:-1]], strict=True)) if found else {}
            self._poses, self._twists = np.zeros((len(names), 7), "<f8"), np.zeros((len(names), 6), "<f8")
        else:
            found = {name: self._entries(name) for name in moved}
        for model, entries in found.items():
            for row, (_, state) in enumerate(entries, self._rows[model]):
                self._poses[row] = (*state.pose.position, *state.pose.quaternion)
                self._twists[row] = (*state.twist.linear, *state.twist.angular)
        self._time_ns, self._revision = world.time_ns, world.revision

    def write(self, buffer: BytesIO) -> None:
        """Writes the fields name, pose and twist in the format of ROS 1."""
        count = struct.pack("<I", len(self._poses))
        buffer.write(b"".join((count, self._names, count, self._poses.tobytes(), count, self._twists.tobytes())))


class PackedModelStates(ModelStates):
    """gazebo_msgs/ModelStates with packed states."""

    packed: PackedStates

    def serialize(self, buff: BytesIO) -> None:
        """Writes the message."""
        self.packed.write(buff)


class PackedLinkStates(LinkStates):
    """gazebo_msgs/LinkStates with packed states."""

    packed: PackedStates

    def serialize(self, buff: BytesIO) -> None:
        """Writes the message."""
        self.packed.write(buff)
