# SPDX-License-Identifier: BSD-3-Clause
"""Collision checks and contacts of single pairs of bodies on exact geometry, by Coal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from modular_framework_planning.collision_detection.collision_bodies import PlacedGeometry, WatchedPair, WatchedPairs
from modular_framework_planning.contacts import Contact
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.robot_model.robot_model import RobotModel

ROUNDING = 1.0e-9  # [m]
MAX_CONTACTS = 20  # contacts computed per pair; the deepest contact is reported


class ExactCollision:
    """Checks watched pairs with Coal; not thread-safe, because the poses of the last state are cached."""

    def __init__(self, model: RobotModel, parts: Sequence[PlacedGeometry], pairs: WatchedPairs) -> None:
        """Stores robot, geometries and pairs.

        Args:
            model: Robot model.
            parts: Geometries of a scene.
            pairs: Watched pairs of these geometries; the methods take indices of pairs.
        """
        self._model, self._parts, self._pairs = model, parts, pairs
        self._data = model.pin_model.createData()
        self._poses: dict[int, Any] = {}
        self._bounding_spheres: dict[int, tuple[Array, float]] = {}
        self._last_positions: Array | None = None

    def _update_poses(self, positions: Array) -> None:
        if self._last_positions is None or not np.array_equal(positions, self._last_positions):
            pin.forwardKinematics(self._model.pin_model, self._data, positions)
            self._poses.clear()
            self._bounding_spheres.clear()
            self._last_positions = np.array(positions)

    def _pose(self, part_index: int) -> Any:
        if part_index not in self._poses:
            part = self._parts[part_index]
            self._poses[part_index] = _coal_transform(self._data.oMi[part.joint_id] * part.placement)
        return self._poses[part_index]

    def _placed_geometry(self, part_index: int) -> tuple[Any, Any]:
        """Returns a part's Coal geometry, built on first use, and its pose."""
        return self._parts[part_index].source.geometry, self._pose(part_index)

    def _is_far(self, pair_index: int) -> bool:
        """Returns whether the bounding spheres are disjoint; Coal then builds no tree over a mesh."""
        return self._sphere_distance(pair_index) > self._pairs[pair_index].margin + ROUNDING

    def _sphere_distance(self, pair_index: int) -> float:
        """Returns the signed distance of a pair's bounding spheres [m], a lower bound of the pair's distance.

        For a plane, which has no bounding sphere, the result is the distance between the plane and the other part's
        sphere.
        """
        pair = self._pairs[pair_index]
        (centre, radius), (other_centre, other_radius) = (
            self._bounding_sphere(part_index) for part_index in (pair.first, pair.second)
        )
        if np.isinf(other_radius):
            return self._distance_to_sphere(pair.second, centre, radius)
        if np.isinf(radius):
            return self._distance_to_sphere(pair.first, other_centre, other_radius)
        return float(np.linalg.norm(centre - other_centre)) - radius - other_radius

    def _distance_to_sphere(self, part_index: int, centre: Array, radius: float) -> float:
        sphere = coal.Sphere(radius), coal.Transform3s(np.eye(3), centre)
        return float(
            coal.distance(*self._placed_geometry(part_index), *sphere, coal.DistanceRequest(), coal.DistanceResult())
        )

    def _bounding_sphere(self, part_index: int) -> tuple[Array, float]:
        if part_index not in self._bounding_spheres:
            part = self._parts[part_index]
            centre, radius = part.source.bounding_sphere
            self._bounding_spheres[part_index] = (self._data.oMi[part.joint_id] * part.placement).act(centre), radius
        return self._bounding_spheres[part_index]

    def _collide(self, pair_index: int, request: Any) -> Any:
        pair = self._pairs[pair_index]
        request.security_margin = pair.margin
        result = coal.CollisionResult()
        coal.collide(*self._placed_geometry(pair.first), *self._placed_geometry(pair.second), request, result)
        return result

    def touching_pair(self, positions: Array, pair_indices: Iterable[int]) -> int:
        """Returns the index of the first touching pair, or -1.

        Args:
            positions: Joint positions of the whole robot [rad or m].
            pair_indices: Pairs to check.
        """
        self._update_poses(positions)
        return next((pair_index for pair_index in pair_indices if self._is_touching(pair_index)), -1)

    def _is_touching(self, pair_index: int) -> bool:
        return not self._is_far(pair_index) and self._collide(pair_index, coal.CollisionRequest()).isCollision()

    def contacts(self, positions: Array, pair_indices: Iterable[int]) -> list[tuple[int, Contact]]:
        """Returns the touching pairs among the given pairs, each with its deepest contact."""
        self._update_poses(positions)
        found = []
        for pair_index in pair_indices:
            if self._is_far(pair_index):
                continue
            if self._collide(pair_index, coal.CollisionRequest()).isCollision():  # much faster without contacts
                result = self._collide(pair_index, coal.CollisionRequest(coal.CONTACT, MAX_CONTACTS))
                found.append((pair_index, self._contact(pair_index, result)))
        return found

    def _contact(self, pair_index: int, result: Any) -> Contact:
        pair = self._pairs[pair_index]
        deepest = max(
            (result.getContact(i) for i in range(result.numContacts())), key=lambda item: self._depth(pair, item)
        )
        return Contact(
            self._parts[pair.first].body,
            self._parts[pair.second].body,
            self._depth(pair, deepest),
            np.array(deepest.pos),
            np.array(deepest.normal),
        )

    @staticmethod
    def _depth(pair: WatchedPair, contact: Any) -> float:
        distance = float(contact.penetration_depth)  # negative if the bodies overlap
        return pair.margin - distance if pair.margin > 0.0 else abs(distance)

    def position(self, positions: Array, part_index: int) -> Array:
        """Returns the origin of a part's frame in the planning frame [m]."""
        self._update_poses(positions)
        return np.array(self._pose(part_index).getTranslation())

    def distance(self, positions: Array, pair_indices: Iterable[int]) -> float:
        """Returns the minimum distance over the pairs [m], at most 0 if a pair touches.

        Pairs are visited in order of their sphere distances, and the search ends when this distance exceeds the
        minimum so far. One distance between detailed meshes takes milliseconds.
        """
        self._update_poses(positions)
        min_distance = float(np.inf)
        for lower_bound, pair_index in sorted((self._sphere_distance(index), index) for index in pair_indices):
            if lower_bound > min_distance + ROUNDING:
                break
            min_distance = min(min_distance, self._distance(pair_index))
        return min_distance

    def _distance(self, pair_index: int) -> float:
        pair = self._pairs[pair_index]
        placed = *self._placed_geometry(pair.first), *self._placed_geometry(pair.second)
        return float(coal.distance(*placed, coal.DistanceRequest(), coal.DistanceResult()))


def _coal_transform(transform: Transform) -> Any:
    return coal.Transform3s(transform.rotation, transform.translation)
