# SPDX-License-Identifier: BSD-3-Clause
"""Checks single pairs of bodies with Coal, on their exact geometry: whether they touch, and how deep."""

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
MAX_CONTACTS = 20  # of a pair, of which the deepest is reported


class ExactCollision:
    """Coal's results for the watched pairs; not thread-safe, because it holds the poses of one state."""

    def __init__(self, model: RobotModel, parts: Sequence[PlacedGeometry], pairs: WatchedPairs) -> None:
        """Stores what to check.

        Args:
            model: the robot.
            parts: geometries of a scene.
            pairs: of those geometries; the methods below take their indices.
        """
        self._model, self._parts, self._pairs = model, parts, pairs
        self._data = model.pin_model.createData()
        self._poses: dict[int, Any] = {}
        self._balls: dict[int, tuple[Array, float]] = {}
        self._at: Array | None = None

    def _update_poses(self, positions: Array) -> None:
        if self._at is None or not np.array_equal(positions, self._at):
            pin.forwardKinematics(self._model.pin_model, self._data, positions)
            self._poses.clear()
            self._balls.clear()
            self._at = np.array(positions)

    def _pose(self, number: int) -> Any:
        if number not in self._poses:
            part = self._parts[number]
            self._poses[number] = _coal_transform(self._data.oMi[part.joint_id] * part.placement)
        return self._poses[number]

    def _placed(self, number: int) -> tuple[Any, Any]:
        """Returns a part's Coal geometry, built when it is first used, and its pose."""
        return self._parts[number].source.geometry, self._pose(number)

    def _is_far(self, number: int) -> bool:
        """Whether the bounding spheres are apart: then Coal need not build its tree of a mesh."""
        pair = self._pairs[number]
        (one, radius), (other, reach) = (self._ball(which) for which in (pair.first, pair.second))
        return float(np.linalg.norm(one - other)) > radius + reach + pair.margin + ROUNDING

    def _ball(self, which: int) -> tuple[Array, float]:
        if which not in self._balls:
            part = self._parts[which]
            centre, radius = part.source.bounding_sphere
            self._balls[which] = (self._data.oMi[part.joint_id] * part.placement).act(centre), radius
        return self._balls[which]

    def _collide(self, number: int, request: Any) -> Any:
        pair = self._pairs[number]
        request.security_margin = pair.margin
        result = coal.CollisionResult()
        coal.collide(*self._placed(pair.first), *self._placed(pair.second), request, result)
        return result

    def touching_pair(self, positions: Array, numbers: Iterable[int]) -> int:
        """Returns the first of the pairs that touches at these positions (of the whole robot), or -1."""
        self._update_poses(positions)
        return next((number for number in numbers if self._touches(number)), -1)

    def _touches(self, number: int) -> bool:
        return not self._is_far(number) and self._collide(number, coal.CollisionRequest()).isCollision()

    def contacts(self, positions: Array, numbers: Iterable[int]) -> list[tuple[int, Contact]]:
        """Returns those of the pairs that touch, each with its deepest contact."""
        self._update_poses(positions)
        found = []
        for number in numbers:
            if self._is_far(number):
                continue
            if self._collide(number, coal.CollisionRequest()).isCollision():  # without contacts: much faster
                result = self._collide(number, coal.CollisionRequest(coal.CONTACT, MAX_CONTACTS))
                found.append((number, self._contact(number, result)))
        return found

    def _contact(self, number: int, result: Any) -> Contact:
        pair = self._pairs[number]
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
        distance = float(contact.penetration_depth)  # below 0 where the bodies overlap
        return pair.margin - distance if pair.margin > 0.0 else abs(distance)

    def position(self, positions: Array, number: int) -> Array:
        """Returns where a geometry's own frame has its origin in the planning frame [m]."""
        self._update_poses(positions)
        return np.array(self._pose(number).getTranslation())

    def distance(self, positions: Array, numbers: Iterable[int]) -> float:
        """Returns the smallest distance [m] of the pairs, 0 or less where they touch."""
        self._update_poses(positions)
        return min(
            (
                coal.distance(
                    *self._placed(pair.first),
                    *self._placed(pair.second),
                    coal.DistanceRequest(),
                    coal.DistanceResult(),
                )
                for pair in (self._pairs[number] for number in numbers)
            ),
            default=np.inf,
        )


def _coal_transform(transform: Transform) -> Any:
    return coal.Transform3s(transform.rotation, transform.translation)
