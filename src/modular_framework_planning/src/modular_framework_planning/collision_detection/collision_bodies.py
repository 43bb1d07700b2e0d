# SPDX-License-Identifier: BSD-3-Clause
"""Lists the bodies of a scene that can collide, and the pairs of them that are checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.contacts import ATTACHED, LINK, WORLD, Body
from modular_framework_planning.geometry.shapes import Shape
from modular_framework_planning.geometry.spatial import Transform
from modular_framework_planning.planning_scene.allowed_collisions import AllowedCollisionMatrix
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import RobotModel

Joints = Sequence[int] | NDArray[np.int64] | None
KEPT_PAIRS = 16  # for how many robots or scenes what depends on pairs of bodies is kept
UNNAMED = Body("", WORLD)  # stands for all bodies of the world that the allowed collision matrix does not name


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


@dataclass(frozen=True, eq=False)
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

    @cached_property
    def moving_numbers(self) -> NDArray[np.int64]:
        """Numbers of the pairs that joints move against each other."""
        return np.flatnonzero(~self.fixed)

    @cached_property
    def moving(self) -> WatchedPairs:
        """Pairs that joints move against each other."""
        return self.chosen(self.moving_numbers)

    def __len__(self) -> int:
        return len(self.parts)

    def __getitem__(self, number: int) -> WatchedPair:
        first, second = self.parts[number].tolist()
        return WatchedPair(first, second, float(self.margins[number]), bool(self.fixed[number]))

    def chosen(self, numbers: NDArray[np.int64]) -> WatchedPairs:
        """Returns some of the pairs, by their numbers; the same ones again for the same numbers."""
        return _chosen(self, numbers.tobytes())


@lru_cache(maxsize=KEPT_PAIRS)
def _chosen(pairs: WatchedPairs, numbers: bytes) -> WatchedPairs:
    chosen = np.frombuffer(numbers, dtype=np.int64)
    return WatchedPairs(pairs.parts[chosen], pairs.margins[chosen], pairs.fixed[chosen])


def placed_geometries(scene: PlanningScene) -> list[PlacedGeometry]:
    """Returns every collision geometry of a scene: links, held objects, then the world."""
    model = scene.model
    result = list(_placed_links(model, tuple(scene.link_margins().tolist())))
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


@lru_cache(maxsize=KEPT_PAIRS)
def _placed_links(model: RobotModel, margins: tuple[float, ...]) -> tuple[PlacedGeometry, ...]:
    return tuple(
        PlacedGeometry(Body(item.link, LINK, item.link), item.joint_id, item.placement, item.shape, margin)
        for item, margin in zip(model.link_geometries, margins, strict=True)
    )


def watched_pairs(scene: PlanningScene, parts: Sequence[PlacedGeometry], moving: Joints) -> WatchedPairs:
    """Returns the pairs that may not touch, the same ones again for scenes that differ only in poses and shapes.

    Args:
        scene: whose allowed collisions count.
        parts: geometries of the scene.
        moving: joints that will move, as indices in a position vector; all by default.
    """
    chosen = None if moving is None else tuple(int(number) for number in moving)
    named, links = scene.acm.named, len(scene.model.link_geometries)
    others = tuple(
        part.body if part.body.kind != WORLD or part.body.name in named else UNNAMED for part in parts[links:]
    )
    joint_ids, margins = tuple([part.joint_id for part in parts]), tuple([part.margin for part in parts])
    return _watched_pairs(scene.model, chosen, *scene.acm.verdicts, others, joint_ids, margins)


@lru_cache(maxsize=KEPT_PAIRS)
def _watched_pairs(
    model: RobotModel,
    moving: tuple[int, ...] | None,
    entries: frozenset[tuple[frozenset[str], bool]],
    defaults: frozenset[tuple[str, bool]],
    others: tuple[Body, ...],
    joint_ids: tuple[int, ...],
    margins: tuple[float, ...],
) -> WatchedPairs:
    """Returns the pairs that may not touch.

    Args:
        model: the robot.
        moving: as for watched_pairs.
        entries: of the allowed collision matrix.
        defaults: of the same.
        others: bodies of the geometries that are not links, those of the world last.
        joint_ids: of all geometries, see PlacedGeometry.
        margins: of all geometries, see PlacedGeometry.
    """
    own = _link_pairs(model, moving, entries, defaults)
    if not others:
        return own
    bodies = [*(part.body for part in _placed_links(model, margins[: len(model.link_geometries)])), *others]
    kinds, links, joints = np.array([body.kind for body in bodies]), len(model.link_geometries), np.array(joint_ids)
    rows = int(np.count_nonzero(kinds != WORLD))
    support, standing = _rigid_joints(model, moving)
    acm = AllowedCollisionMatrix(dict(entries), dict(defaults))
    allowed = _allowed(acm, bodies[:rows], others)
    numbers, held = np.arange(len(bodies)), kinds == ATTACHED
    first, second = numbers[:rows, None], numbers[None, links:]  # bodies of the world do not move against each other
    is_rigid = (standing[joints[first]] == standing[joints[second]]) & ~held[first] & ~held[second]
    checked = np.nonzero((second > first) & ~is_rigid & ~allowed)
    first, second = checked[0], checked[1] + links
    return WatchedPairs(
        np.concatenate([own.parts, np.column_stack([first, second])]),
        np.concatenate([own.margins, np.where(second >= rows, np.array(margins)[first], 0.0)]),
        np.concatenate([own.fixed, support[joints[first]] == support[joints[second]]]),
    )


def _allowed(acm: AllowedCollisionMatrix, ones: Sequence[Body], others: Sequence[Body]) -> NDArray[np.bool_]:
    """Returns whether each of some bodies may touch each of others, as a matrix."""
    rows, columns = ({body: number for number, body in enumerate(dict.fromkeys(items))} for items in (ones, others))
    verdicts = np.array([[_may_touch(acm, one, other) for other in columns] for one in rows], dtype=bool)
    verdicts = verdicts.reshape(len(rows), len(columns))
    return verdicts[np.ix_([rows[one] for one in ones], [columns[other] for other in others])]


@lru_cache(maxsize=KEPT_PAIRS)
def _rigid_joints(model: RobotModel, moving: tuple[int, ...] | None) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns, for each of Pinocchio's joints, a number of the moving joints it depends on, and of what it is rigid to.

    Two joints have the same number where these are the same.
    """
    supports, standing = _supports(model, moving), _standing(model, moving)
    numbers: dict[frozenset[int], int] = {}
    support = [numbers.setdefault(item, len(numbers)) for item in supports]
    return np.array(support), np.array([standing.get(joint, joint) for joint in range(len(supports))])


@lru_cache(maxsize=KEPT_PAIRS)
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


def _may_touch(acm: AllowedCollisionMatrix, first: Body, second: Body) -> bool:
    if second is UNNAMED:
        return acm.allows_others(first.name)
    if first.name == second.name and first.kind == second.kind:
        return True
    for held, other in ((first, second), (second, first)) if ATTACHED in (first.kind, second.kind) else ():
        if held.kind == ATTACHED and other.kind == LINK and (other.name == held.link or other.name in held.touch_links):
            return True
    return acm.allows(first.name, second.name)


def _supports(model: RobotModel, moving: Joints) -> list[frozenset[int]]:
    """Returns, for each joint of the tree, which of the moving joints it depends on (mimics included)."""
    chosen = set(range(len(model.joint_names))) if moving is None else {int(number) for number in moving}
    chosen |= {follower for follower, leader, _, _ in model.mimics if leader in chosen}
    return [frozenset(int(joint) - 1 for joint in joints if joint > 0) & chosen for joints in model.pin_model.supports]
