# SPDX-License-Identifier: BSD-3-Clause
"""Checks the self-collisions of a robot on the exact shapes used for planning."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations

import numpy as np
import pinocchio as pin
from numpy.random import Generator

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel

Pair = tuple[str, str]
"""Names of two links, in alphabetical order."""


def pair_of(first: str, second: str) -> Pair:
    """Returns the ordered pair of two links."""
    return (first, second) if first < second else (second, first)


class CollisionSampling:
    """Checks pairs of links for collisions at given robot states.

    Args:
        model: Robot model, in which meshes are surfaces.
    """

    def __init__(self, model: RobotModel) -> None:
        self.model = model
        self._geometry = pin.GeometryModel()
        for index, item in enumerate(model.link_geometries):
            shape = pin.GeometryObject(f"{index}", item.joint_id, item.frame_id, item.placement, item.geometry)
            self._geometry.addGeometryObject(shape)
        links = [item.link for item in model.link_geometries]
        self._geometry_pairs: dict[Pair, list[int]] = {}
        for first, second in combinations(range(len(links)), 2):
            if links[first] != links[second]:
                self._geometry_pairs.setdefault(pair_of(links[first], links[second]), []).append(
                    len(self._geometry.collisionPairs)
                )
                self._geometry.addCollisionPair(pin.CollisionPair(first, second))
        self._data, self._geometry_data = model.pin_model.createData(), pin.GeometryData(self._geometry)
        self._active = list(self._geometry_pairs)

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """All pairs of links with shapes."""
        return tuple(self._geometry_pairs)

    def watch(self, pairs: Iterable[Pair]) -> None:
        """Limits `colliding` to the given pairs."""
        self._active = list(pairs)
        watched = {index for pair in self._active for index in self._geometry_pairs[pair]}
        for index in range(len(self._geometry.collisionPairs)):
            if index in watched:
                self._geometry_data.activateCollisionPair(index)
            else:
                self._geometry_data.deactivateCollisionPair(index)

    def colliding(self, positions: Array) -> list[Pair]:
        """Returns the watched pairs in collision at joint positions, shape (joints,) [rad or m]."""
        pin.computeCollisions(self.model.pin_model, self._data, self._geometry, self._geometry_data, positions, False)
        results = self._geometry_data.collisionResults
        return [pair for pair in self._active if any(results[n].isCollision() for n in self._geometry_pairs[pair])]

    def distance(self, pair: Pair, positions: Array) -> float:
        """Returns the distance of two links at joint positions [m], 0 or less in collision.

        Args:
            pair: Names of the links.
            positions: Joint positions, shape (joints,) [rad or m].
        """
        return self.min_distance((pair,), positions)

    def min_distance(self, pairs: Sequence[Pair], positions: Array) -> float:
        """Returns the minimum distance over pairs of links at joint positions [m], 0 or less in collision.

        Args:
            pairs: Pairs of links.
            positions: Joint positions, shape (joints,) [rad or m].
        """
        pin.updateGeometryPlacements(self.model.pin_model, self._data, self._geometry, self._geometry_data, positions)
        return min(
            float(pin.computeDistance(self._geometry, self._geometry_data, index).min_distance)
            for pair in pairs
            for index in self._geometry_pairs[pair]
        )

    def random_states(self, random: Generator, count: int) -> Array:
        """Returns uniformly random joint positions within the limits, shape (count, joints) [rad or m]."""
        lower, upper = self.bounds()
        states = random.uniform(lower, upper, size=(count, len(lower)))
        return np.array([self.model.with_mimics(state) for state in states])

    def bounds(self) -> tuple[Array, Array]:
        """Returns the joint limits, clipped to [-pi, pi] [rad or m]."""
        return np.clip(self.model.lower, -np.pi, None), np.clip(self.model.upper, None, np.pi)
