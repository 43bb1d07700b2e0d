# SPDX-License-Identifier: BSD-3-Clause
"""Lists the bodies of a scene that can collide, and the pairs of them that are checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.contacts import ATTACHED, LINK, WORLD, Body
from modular_framework_planning.geometry.shapes import Shape
from modular_framework_planning.geometry.spatial import Transform
from modular_framework_planning.planning_scene.allowed_collisions import AllowedCollisionMatrix
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import RobotModel

Joints = Sequence[int] | NDArray[np.int64] | None
KEPT_LINK_PAIRS = 16


@dataclass(frozen=True, slots=True, eq=False)
class PlacedGeometry:
    """A collision geometry of a body.

    Attributes:
        joint_id: Pinocchio's number of the joint that moves it, 0 for the world.
        placement: pose in that joint's frame.
        source: the shape, which never changes.
        margin: distance it keeps from bodies of the world [m].
    """

    body: Body
    joint_id: int
    placement: Transform
    source: Shape
    margin: float


@dataclass(frozen=True, slots=True)
class WatchedPair:
    """Two geometries, by index, that may not come closer than `margin` [m]; `is_fixed` where no joint moves them."""

    first: int
    second: int
    margin: float
    is_fixed: bool


@dataclass(frozen=True, slots=True, eq=False)
class WatchedPairs:
    """Pairs of geometries that may not come closer than a margin.

    Attributes:
        parts: the two geometries of each by index, shape (n, 2).
        margins: distance they must keep [m], shape (n,).
        fixed: whether no joint moves them against each other, shape (n,).
    """

    parts: NDArray[np.int64]
    margins: NDArray[np.float64]
    fixed: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.parts)

    def __getitem__(self, number: int) -> WatchedPair:
        first, second = self.parts[number].tolist()
        return WatchedPair(first, second, float(self.margins[number]), bool(self.fixed[number]))

    def chosen(self, numbers: NDArray[np.int64]) -> WatchedPairs:
        """Returns some of the pairs, by their numbers."""
        return WatchedPairs(self.parts[numbers], self.margins[numbers], self.fixed[numbers])


def placed_geometries(scene: PlanningScene) -> list[PlacedGeometry]:
    """Returns every collision geometry of a scene: links, held objects, then the world."""
    model = scene.model
    result = [
        PlacedGeometry(Body(item.link, LINK, item.link), item.joint_id, item.placement, item.shape, float(margin))
        for item, margin in zip(model.link_geometries, scene.link_margins(), strict=True)
    ]
    for held in scene.attached.values():
        frame = model.pin_model.frames[model.frame_ids[held.link]]
        body = Body(held.name, ATTACHED, held.link, held.touch_links)
        for shape, pose in held.body.shapes:
            placement = frame.placement * held.body.pose * pose
            result.append(PlacedGeometry(body, frame.parentJoint, placement, shape, scene.attached_padding()))
    for thing in scene.obstacles():
        for shape, pose in thing.shapes:
            result.append(PlacedGeometry(Body(thing.name, WORLD), 0, thing.pose * pose, shape, 0.0))
    return result


def watched_pairs(scene: PlanningScene, parts: Sequence[PlacedGeometry], moving: Joints) -> WatchedPairs:
    """Returns the pairs that may not touch.

    Args:
        scene: whose allowed collisions count.
        parts: geometries of the scene.
        moving: joints that will move, as indices in a position vector; all by default.
    """
    chosen = None if moving is None else tuple(int(number) for number in moving)
    acm, links = scene.acm, len(scene.model.link_geometries)
    own = _link_pairs(scene.model, chosen, frozenset(acm.entries.items()), frozenset(acm.defaults.items()))
    rows = next((number for number, part in enumerate(parts) if part.body.kind == WORLD), len(parts))
    if len(parts) == links:
        return own
    support, standing = _rigid_joints(scene.model, chosen)
    joint_ids = np.array([part.joint_id for part in parts])
    held = np.array([part.body.kind == ATTACHED for part in parts])
    numbers = np.arange(len(parts))
    first, second = numbers[:rows, None], numbers[None, links:]  # bodies of the world do not move against each other
    is_rigid = (standing[joint_ids[first]] == standing[joint_ids[second]]) & ~held[first] & ~held[second]
    checked = np.nonzero((second > first) & ~is_rigid & ~_allowed(scene, parts, rows, links))
    first, second = checked[0], checked[1] + links
    margins = np.array([part.margin for part in parts[:rows]])[first]
    return WatchedPairs(
        np.concatenate([own.parts, np.column_stack([first, second])]),
        np.concatenate([own.margins, np.where(second >= rows, margins, 0.0)]),
        np.concatenate([own.fixed, support[joint_ids[first]] == support[joint_ids[second]]]),
    )


def _allowed(scene: PlanningScene, parts: Sequence[PlacedGeometry], rows: int, links: int) -> NDArray[np.bool_]:
    """Returns whether each of the first `rows` geometries may touch each of those behind the links, as a matrix.

    Most objects of the world are not in the allowed collision matrix: what holds for one of them holds for all.
    """
    acm = scene.acm
    named = {*chain.from_iterable(acm.entries), *acm.defaults}
    bodies = list({(part.body.kind, part.body.name): part.body for part in parts[:rows]}.values())
    row_of = {(body.kind, body.name): number for number, body in enumerate(bodies)}
    columns: list[list[bool]] = []
    column_of: dict[tuple[str, str], int] = {}
    others: list[int] = []
    for part in parts[links:]:
        body = part.body
        key = (body.kind, body.name if body.kind != WORLD or body.name in named else "")  # no body has an empty name
        if key not in column_of:
            column_of[key] = len(columns)
            columns.append([_may_touch(scene, one, body) for one in bodies])
        others.append(column_of[key])
    by_body = np.array(columns, dtype=bool).T
    return by_body[np.ix_([row_of[part.body.kind, part.body.name] for part in parts[:rows]], others)]


@lru_cache(maxsize=KEPT_LINK_PAIRS)
def _rigid_joints(model: RobotModel, moving: tuple[int, ...] | None) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns, for each of Pinocchio's joints, a number of the moving joints it depends on, and of what it is rigid to.

    Two joints have the same number where these are the same.
    """
    supports, standing = _supports(model, moving), _standing(model, moving)
    numbers: dict[frozenset[int], int] = {}
    support = [numbers.setdefault(item, len(numbers)) for item in supports]
    return np.array(support), np.array([standing.get(joint, joint) for joint in range(len(supports))])


@lru_cache(maxsize=KEPT_LINK_PAIRS)
def _link_pairs(
    model: RobotModel,
    moving: tuple[int, ...] | None,
    entries: frozenset[tuple[frozenset[str], bool]],
    defaults: frozenset[tuple[str, bool]],
) -> WatchedPairs:
    """Returns the pairs of the robot's own links that may not touch; they are the same in most scenes.

    Args:
        model: the robot.
        moving: as for watched_pairs.
        entries: of the allowed collision matrix.
        defaults: of the same.
    """
    acm = AllowedCollisionMatrix(dict(entries), dict(defaults))
    support, standing = _rigid_joints(model, moving)
    pairs = [
        (first, second)
        for first, one in enumerate(model.link_geometries)
        for second, other in enumerate(model.link_geometries[first + 1 :], first + 1)
        if standing[one.joint_id] != standing[other.joint_id]
        and one.link != other.link
        and not acm.allows(one.link, other.link)
    ]
    parts = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    joints = np.array([item.joint_id for item in model.link_geometries], dtype=np.int64)[parts]
    return WatchedPairs(parts, np.zeros(len(parts)), support[joints[:, 0]] == support[joints[:, 1]])


def _standing(model: RobotModel, moving: Joints) -> dict[int, int]:
    """Returns {joint of the base: 0, the world's} where a planar or floating base stands still, else nothing.

    What only the base moves is then as rigid to the world as the foot of a robot that is screwed to it.
    """
    if moving is None or not len(model.base_indices) or set(model.base_indices.tolist()) & set(moving):
        return {}
    return {int(model.base_indices[-1]) + 1: 0}


def _may_touch(scene: PlanningScene, first: Body, second: Body) -> bool:
    if first.name == second.name and first.kind == second.kind:
        return True
    for held, other in ((first, second), (second, first)) if ATTACHED in (first.kind, second.kind) else ():
        if held.kind == ATTACHED and other.kind == LINK and (other.name == held.link or other.name in held.touch_links):
            return True
    return scene.acm.allows(first.name, second.name)


def _supports(model: RobotModel, moving: Joints) -> list[frozenset[int]]:
    """Returns, for each joint of the tree, which of the moving joints it depends on (mimics included)."""
    chosen = set(range(len(model.joint_names))) if moving is None else {int(number) for number in moving}
    chosen |= {follower for follower, leader, _, _ in model.mimics if leader in chosen}
    return [frozenset(int(joint) - 1 for joint in joints if joint > 0) & chosen for joints in model.pin_model.supports]
