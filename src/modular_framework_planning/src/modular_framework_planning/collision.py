# SPDX-License-Identifier: BSD-3-Clause
"""Answers "does this state or this motion collide?" on exact geometry, through Pinocchio's broad phase and Coal."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from modular_framework_planning.planning_scene import PlanningScene
from modular_framework_planning.robot_model import RobotModel
from modular_framework_planning.spatial import Array, Transform

DEPTH_SLACK = 2.0e-4  # [m]; how much deeper a tolerated contact may look through numerical noise
LINK, ATTACHED, WORLD = "robot_link", "robot_attached", "world_object"


@dataclass(frozen=True, slots=True)
class Body:
    """What one collision geometry belongs to."""

    name: str
    kind: str
    link: str = ""
    touch_links: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Contact:
    """Two bodies that touch; position [m] and normal (from first to second) in the planning frame, depth [m]."""

    first: Body
    second: Body
    depth: float
    position: Array
    normal: Array

    def describe(self) -> str:
        """Says which body touches which and how deep."""
        return f"{_label(self.first)} touches {_label(self.second)}, {self.depth * 1000.0:.1f} mm deep"


def _label(body: Body) -> str:
    if body.kind == LINK:
        return f"link '{body.name}'"
    return f"object '{body.name}'" + (f" held by '{body.link}'" if body.kind == ATTACHED else "")


@dataclass(frozen=True, slots=True)
class ToleratedContact:
    """A contact of a held body that exists at the start and may not get deeper."""

    pair: int
    depth: float


class CollisionChecker:
    """Checks states of the robot in one snapshot of the scene.

    Not for use from two threads at a time: it holds the working memory of the check. Pairs whose relative pose the
    given joints cannot change are looked at once, in `fixed_contacts`.
    """

    def __init__(self, scene: PlanningScene, moving: Sequence[int] | NDArray[np.int64] | None = None,
                 tolerated: Sequence[Contact] = ()) -> None:
        """Builds the checker.

        Args:
            scene: the snapshot to check in.
            moving: joints that will move, as places in a position vector; all by default.
            tolerated: contacts of held bodies that may stay but not deepen.
        """
        self.scene = scene
        self.model: RobotModel = scene.model
        self._geometry = pin.GeometryModel()
        self.bodies: list[Body] = []
        self._joint_of: list[int] = []
        self._add_bodies()
        names = {frozenset((item.first.name, item.second.name)): item.depth for item in tolerated}
        self._fixed_pairs: list[int] = []
        self._tolerated: list[ToleratedContact] = []
        self._add_pairs(moving, names)
        self._data = self.model.pin_model.createData()
        self._checks = self._geometry.createData()
        self._reports = self._geometry.createData()
        for number in range(len(self._geometry.collisionPairs)):
            self._reports.collisionRequests[number].enable_contact = True
            self._reports.collisionRequests[number].num_max_contacts = 20
        for number in [*self._fixed_pairs, *(item.pair for item in self._tolerated)]:
            self._checks.deactivateCollisionPair(number)
        self._broad_phase = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(
            self.model.pin_model, self._geometry, self._checks)
        self.states_checked = 0

    def _add(self, body: Body, joint_id: int, placement: Transform, geometry: Any) -> None:
        self._geometry.addGeometryObject(
            pin.GeometryObject(f"{len(self.bodies)}:{body.name}", joint_id, placement, geometry))
        self.bodies.append(body)
        self._joint_of.append(joint_id)

    def _add_bodies(self) -> None:
        for item in self.model.link_geometries:
            self._add(Body(item.link, LINK, item.link), item.joint_id, item.placement, item.geometry)
        for held in self.scene.attached.values():
            frame = self.model.pin_model.frames[self.model.frame_ids[held.link]]
            body = Body(held.name, ATTACHED, held.link, held.touch_links)
            for shape, pose in held.body.shapes:
                self._add(body, frame.parentJoint, frame.placement * held.body.pose * pose, shape.geometry)
        for thing in self.scene.objects.values():
            for shape, pose in thing.shapes:
                self._add(Body(thing.name, WORLD), 0, thing.pose * pose, shape.geometry)

    def _may_touch(self, first: Body, second: Body) -> bool:
        if first.name == second.name and first.kind == second.kind:
            return True
        for held, other in ((first, second), (second, first)):
            if held.kind == ATTACHED and other.kind == LINK and (
                    other.name == held.link or other.name in held.touch_links):
                return True
        return self.scene.acm.allows(first.name, second.name)

    def _is_watched(self, first: int, second: int) -> bool:
        one, other = self.bodies[first], self.bodies[second]
        if self._joint_of[first] == self._joint_of[second] and ATTACHED not in (one.kind, other.kind):
            return False  # rigid to each other (or both in the world): touching says nothing about a motion
        return not self._may_touch(one, other)

    def _supports(self, moving: Sequence[int] | NDArray[np.int64] | None) -> list[frozenset[int]]:
        """Returns, for each joint of the tree, which of the moving joints it depends on (mimics included)."""
        chosen = set(range(len(self.model.joint_names))) if moving is None else {int(number) for number in moving}
        chosen |= {follower for follower, leader, _, _ in self.model.mimics if leader in chosen}
        supports = [frozenset(int(j) - 1 for j in chain if j > 0) & chosen for chain in self.model.pin_model.supports]
        return [frozenset(item) for item in supports]

    def _add_pairs(self, moving: Sequence[int] | NDArray[np.int64] | None, names: dict[frozenset[str], float]) -> None:
        supports = self._supports(moving)
        for first in range(len(self.bodies)):
            for second in range(first + 1, len(self.bodies)):
                if not self._is_watched(first, second):
                    continue
                number = len(self._geometry.collisionPairs)
                self._geometry.addCollisionPair(pin.CollisionPair(first, second))
                depth = names.get(frozenset((self.bodies[first].name, self.bodies[second].name)))
                if supports[self._joint_of[first]] == supports[self._joint_of[second]]:
                    self._fixed_pairs.append(number)
                elif depth is not None:
                    self._tolerated.append(ToleratedContact(number, depth))

    def is_free(self, positions: Array) -> bool:
        """Whether no pair that can move touches at these positions (of the whole robot)."""
        self.states_checked += 1
        if pin.computeCollisions(self.model.pin_model, self._data, self._broad_phase, positions, True):
            return False
        return not self._tolerated or self._tolerated_stay_shallow(positions)

    def _tolerated_stay_shallow(self, positions: Array) -> bool:
        pin.updateGeometryPlacements(self.model.pin_model, self._data, self._geometry, self._reports, positions)
        for item in self._tolerated:
            if self._touches(item.pair) and self._depth(item.pair) > item.depth + DEPTH_SLACK:
                return False
        return True

    def _touches(self, pair: int) -> bool:
        return bool(pin.computeCollision(self._geometry, self._reports, pair))

    def _depth(self, pair: int) -> float:
        result = self._reports.collisionResults[pair]
        return max((abs(float(result.getContact(i).penetration_depth)) for i in range(result.numContacts())),
                   default=0.0)

    def contacts(self, positions: Array, include_fixed: bool = True) -> list[Contact]:
        """Returns every pair that touches, the deepest contact of each, deepest pair first."""
        pin.updateGeometryPlacements(self.model.pin_model, self._data, self._geometry, self._reports, positions)
        skipped = set() if include_fixed else set(self._fixed_pairs)
        allowed = {item.pair: item.depth for item in self._tolerated}
        found = []
        for number in range(len(self._geometry.collisionPairs)):
            if number in skipped or not self._touches(number):
                continue
            contact = self._contact(number)
            if number not in allowed or contact.depth > allowed[number] + DEPTH_SLACK:
                found.append(contact)
        return sorted(found, key=lambda item: -item.depth)

    def _contact(self, number: int) -> Contact:
        pair = self._geometry.collisionPairs[number]
        result = self._reports.collisionResults[number]
        best = max((result.getContact(i) for i in range(result.numContacts())),
                   key=lambda item: abs(float(item.penetration_depth)))
        return Contact(self.bodies[pair.first], self.bodies[pair.second], abs(float(best.penetration_depth)),
                       np.array(best.pos), np.array(best.normal))

    def fixed_contacts(self, positions: Array) -> list[Contact]:
        """Returns contacts of watched pairs the moving joints cannot change."""
        watched = set(self._fixed_pairs)
        pin.updateGeometryPlacements(self.model.pin_model, self._data, self._geometry, self._reports, positions)
        return [self._contact(number) for number in sorted(watched) if self._touches(number)]

    def distance(self, positions: Array) -> float:
        """Returns the smallest distance [m] between bodies that may not touch; 0 or less when they do."""
        pin.updateGeometryPlacements(self.model.pin_model, self._data, self._geometry, self._checks, positions)
        best = np.inf
        for number in range(len(self._geometry.collisionPairs)):
            pair = self._geometry.collisionPairs[number]
            result = coal.DistanceResult()
            first, second = self._geometry.geometryObjects[pair.first], self._geometry.geometryObjects[pair.second]
            best = min(best, coal.distance(
                first.geometry, _coal_transform(self._checks.oMg[pair.first]),
                second.geometry, _coal_transform(self._checks.oMg[pair.second]), coal.DistanceRequest(), result))
        return float(best)


def _coal_transform(transform: Transform) -> Any:
    return coal.Transform3s(transform.rotation, transform.translation)
