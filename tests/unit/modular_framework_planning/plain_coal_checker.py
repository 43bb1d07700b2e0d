# SPDX-License-Identifier: BSD-3-Clause
"""A complete collision checker that is as simple as one can be: Coal on the raw shapes, pair by pair, state by state.

It judges the others in test_collision_checkers, and is a checker to begin one's own with. It gives the same answers as
the one that ships, some hundred times slower, so that nobody would choose it to plan with: it ships with the tests.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from modular_framework_planning.contacts import ATTACHED, LINK, WORLD, Body, Contact
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

SLACK = 2.0e-4  # [m]; how much deeper a tolerated contact may seem
MOST_CONTACTS = 1000


@dataclass(frozen=True, eq=False)
class Part:
    """A shape of a body: the joint it hangs on (0: the world), its pose there, its distance from the world [m]."""

    body: Body
    joint: int
    pose: pin.SE3
    geometry: Any
    margin: float


@dataclass(frozen=True, eq=False)
class Pair:
    """Two shapes that must keep a distance [m]; a contact of `tolerated` depth [m] may stay (below 0: none)."""

    first: Part
    second: Part
    margin: float
    is_fixed: bool
    tolerated: float


class PlainCoalChecker:
    """See CollisionChecker."""

    def __init__(
        self, scene: PlanningScene, moving: Sequence[int] | None = None, tolerated: Sequence[Contact] = ()
    ) -> None:
        self.model = scene.model
        self._data = self.model.pin_model.createData()
        self._poses: dict[Part, Any] = {}
        depths = {frozenset((item.first.name, item.second.name)): item.depth for item in tolerated}
        parts = list(parts_of(scene))
        self._pairs = [
            Pair(
                one,
                other,
                one.margin if other.body.kind == WORLD else 0.0,
                self._moved_by(one, moving) == self._moved_by(other, moving),
                depths.get(frozenset((one.body.name, other.body.name)), -1.0),
            )
            for number, one in enumerate(parts)
            for other in parts[number + 1 :]
            if is_checked(scene, one, other)
        ]

    def _moved_by(self, part: Part, moving: Sequence[int] | None) -> set[int]:
        """The moving joints between a part and the world."""
        chosen = set(range(len(self.model.joint_names)) if moving is None else map(int, moving))
        chosen |= {follower for follower, leader, _, _ in self.model.mimics if leader in chosen}
        return {joint - 1 for joint in self.model.pin_model.supports[part.joint] if joint - 1 in chosen}

    def build(self, _check_interrupt: Callable[[], None]) -> None:
        """Has nothing to build."""

    def is_free(self, positions: np.ndarray) -> bool:
        self._place(positions)
        return not any(self._touches(pair) for pair in self._pairs if not pair.is_fixed)

    def path_is_free(self, vertices: np.ndarray, step: float, first: int = 0) -> bool:
        return all(self.is_free(sample) for sample in samples_of(vertices, step)[first:])

    def colliding_state(self, vertices: np.ndarray, step: float) -> np.ndarray | None:
        return next((sample for sample in samples_of(vertices, step) if not self.is_free(sample)), None)

    def contacts(self, positions: np.ndarray, include_fixed: bool = True) -> list[Contact]:
        self._place(positions)
        found = [
            self._contact(pair) for pair in self._pairs if (include_fixed or not pair.is_fixed) and self._touches(pair)
        ]
        return sorted(found, key=lambda item: -item.depth)

    def fixed_contacts(self, positions: np.ndarray) -> list[Contact]:
        self._place(positions)
        return [self._contact(pair) for pair in self._pairs if pair.is_fixed and self._touches(pair)]

    def distance(self, positions: np.ndarray) -> float:
        self._place(positions)
        return min((self._distance(pair) for pair in self._pairs), default=np.inf)

    def _place(self, positions: np.ndarray) -> None:
        pin.forwardKinematics(self.model.pin_model, self._data, np.asarray(positions, dtype=float))
        for part in {part for pair in self._pairs for part in (pair.first, pair.second)}:
            pose = self._data.oMi[part.joint] * part.pose
            self._poses[part] = coal.Transform3s(pose.rotation, pose.translation)

    def _placed(self, pair: Pair) -> tuple[Any, ...]:
        return (pair.first.geometry, self._poses[pair.first], pair.second.geometry, self._poses[pair.second])

    def _distance(self, pair: Pair) -> float:
        return coal.distance(*self._placed(pair), coal.DistanceRequest(), coal.DistanceResult())

    def _touches(self, pair: Pair) -> bool:
        result = coal.CollisionResult()
        touches = coal.collide(*self._placed(pair), coal.CollisionRequest(), result) > 0
        if not touches and pair.margin > 0.0:
            touches = self._distance(pair) <= pair.margin
        return touches and (pair.tolerated < 0.0 or self._contact(pair).depth > pair.tolerated + SLACK)

    def _contact(self, pair: Pair) -> Contact:
        result = coal.CollisionResult()
        coal.collide(*self._placed(pair), coal.CollisionRequest(coal.CONTACT, MOST_CONTACTS), result)
        bodies = pair.first.body, pair.second.body
        if not result.numContacts():  # nearer than the distance they have to keep
            return Contact(*bodies, pair.margin - self._distance(pair), np.zeros(3), np.zeros(3))
        deepest = max(
            (result.getContact(number) for number in range(result.numContacts())),
            key=lambda item: abs(item.penetration_depth),
        )
        return Contact(
            *bodies, pair.margin + abs(deepest.penetration_depth), np.array(deepest.pos), np.array(deepest.normal)
        )


def parts_of(scene: PlanningScene) -> Iterator[Part]:
    """The shapes of a scene: links, held objects, the world."""
    model = scene.model
    for item, margin in zip(model.link_geometries, scene.link_margins(), strict=True):
        yield Part(Body(item.link, LINK, item.link), item.joint_id, item.placement, item.shape.geometry, margin)
    for held in scene.attached.values():
        frame = model.pin_model.frames[model.frame_ids[held.link]]
        for shape, pose in held.body.shapes:
            yield Part(
                Body(held.name, ATTACHED, held.link, held.touch_links),
                frame.parentJoint,
                frame.placement * held.body.pose * pose,
                shape.geometry,
                scene.attached_padding(),
            )
    for thing in scene.obstacles():
        for shape, pose in thing.shapes:
            yield Part(Body(thing.name, WORLD), 0, thing.pose * pose, shape.geometry, 0.0)


def is_checked(scene: PlanningScene, one: Part, other: Part) -> bool:
    """Whether two shapes may not touch."""
    first, second = one.body, other.body
    if (first.kind, first.name) == (second.kind, second.name) or first.kind == second.kind == WORLD:
        return False
    if ATTACHED not in (first.kind, second.kind) and one.joint == other.joint:
        return False
    for held, link in ((first, second), (second, first)):
        if held.kind == ATTACHED and link.kind == LINK and link.name in {held.link, *held.touch_links}:
            return False
    return not scene.acm.allows(first.name, second.name)


def samples_of(vertices: np.ndarray, step: float) -> np.ndarray:
    """Samples at most `step` apart on the straight pieces, shape (n, joints)."""
    rows = [vertices[:1]]
    for start, end in zip(vertices[:-1], vertices[1:], strict=True):
        count = max(1, int(np.ceil(np.abs(end - start).max() / step)))
        rows.append(start + np.arange(1, count + 1)[:, None] / count * (end - start))
    return np.vstack(rows)
