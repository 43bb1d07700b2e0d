# SPDX-License-Identifier: BSD-3-Clause
"""Collisions of the links of a robot with each other, on the exact shapes that planning checks."""

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


def pair_of(one: str, other: str) -> Pair:
    """Returns the pair of two links."""
    return (one, other) if one < other else (other, one)


class CollisionSampling:
    """Checks pairs of links at states of the robot.

    Args:
        model: of the robot; meshes count as surfaces.
    """

    def __init__(self, model: RobotModel) -> None:
        self.model = model
        self._geometry = pin.GeometryModel()
        for number, item in enumerate(model.link_geometries):
            shape = pin.GeometryObject(f"{number}", item.joint_id, item.frame_id, item.placement, item.geometry)
            self._geometry.addGeometryObject(shape)
        links = [item.link for item in model.link_geometries]
        self._members: dict[Pair, list[int]] = {}
        for first, second in combinations(range(len(links)), 2):
            if links[first] != links[second]:
                self._members.setdefault(pair_of(links[first], links[second]), []).append(
                    len(self._geometry.collisionPairs)
                )
                self._geometry.addCollisionPair(pin.CollisionPair(first, second))
        self._data, self._geometry_data = model.pin_model.createData(), pin.GeometryData(self._geometry)
        self._active = list(self._members)

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """All pairs of links that have shapes."""
        return tuple(self._members)

    def watch(self, pairs: Iterable[Pair]) -> None:
        """Limits `colliding` to some pairs."""
        self._active = list(pairs)
        wanted = {number for pair in self._active for number in self._members[pair]}
        for number in range(len(self._geometry.collisionPairs)):
            if number in wanted:
                self._geometry_data.activateCollisionPair(number)
            else:
                self._geometry_data.deactivateCollisionPair(number)

    def colliding(self, positions: Array) -> list[Pair]:
        """Returns the watched pairs in collision at a state, shape (joints,) [rad or m]."""
        pin.computeCollisions(self.model.pin_model, self._data, self._geometry, self._geometry_data, positions, False)
        results = self._geometry_data.collisionResults
        return [pair for pair in self._active if any(results[n].isCollision() for n in self._members[pair])]

    def distance(self, pair: Pair, positions: Array) -> float:
        """Returns the distance of two links at a state [m]; 0 or less when they touch."""
        return self.least_distance((pair,), positions)

    def least_distance(self, pairs: Sequence[Pair], positions: Array) -> float:
        """Returns the distance of the closest of some pairs at a state [m]; 0 or less when one touches."""
        pin.updateGeometryPlacements(self.model.pin_model, self._data, self._geometry, self._geometry_data, positions)
        return min(
            float(pin.computeDistance(self._geometry, self._geometry_data, number).min_distance)
            for pair in pairs
            for number in self._members[pair]
        )

    def random_states(self, random: Generator, count: int) -> Array:
        """Returns states with all joints anywhere in their limits, shape (count, joints) [rad or m]."""
        lower, upper = self.bounds()
        states = random.uniform(lower, upper, size=(count, len(lower)))
        return np.array([self.model.with_mimics(state) for state in states])

    def bounds(self) -> tuple[Array, Array]:
        """Returns the limits of all joints; a joint without an end, or with more than a turn, takes one turn."""
        return np.clip(self.model.lower, -np.pi, None), np.clip(self.model.upper, None, np.pi)
