# SPDX-License-Identifier: BSD-3-Clause
"""The bodies of a scene that can collide, and the pairs of bodies to check."""

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
PAIR_CACHE_SIZE = 16  # number of cached robots and scenes
UNNAMED = Body("", WORLD)  # stands for all world bodies without an entry in the allowed collision matrix


@dataclass(frozen=True, slots=True, eq=False)
class PlacedGeometry:
    """A collision geometry of a body.

    Attributes:
        body: Body that owns the geometry.
        joint_id: Pinocchio id of the joint that moves the geometry, 0 for the world.
        placement: Pose in the joint's frame.
        source: Immutable shape.
        margin: Minimum distance from bodies of the world [m].
    """

    body: Body
    joint_id: int
    placement: Transform
    source: Shape
    margin: float


@dataclass(frozen=True, slots=True)
class WatchedPair:
    """Indices of two geometries that must keep `margin` [m]."""

    first: int
    second: int
    margin: float


@dataclass(frozen=True, eq=False)
class WatchedPairs:
    """Pairs of geometries that must keep a margin.

    Attributes:
        parts: Indices of the two geometries, shape (n, 2).
        margins: Minimum distances, shape (n,) [m].
        fixed: Whether no joint changes the relative pose, shape (n,).
    """

    parts: NDArray[np.int64]
    margins: NDArray[np.float64]
    fixed: NDArray[np.bool_]

    @cached_property
    def moving_indices(self) -> NDArray[np.int64]:
        """Indices of the pairs whose relative pose joints can change."""
        return np.flatnonzero(~self.fixed)

    @cached_property
    def moving(self) -> WatchedPairs:
        """Pairs whose relative pose joints can change."""
        return self.subset(self.moving_indices)

    def __len__(self) -> int:
        return len(self.parts)

    def __getitem__(self, index: int) -> WatchedPair:
        first, second = self.parts[index].tolist()
        return WatchedPair(first, second, float(self.margins[index]))

    def subset(self, indices: NDArray[np.int64]) -> WatchedPairs:
        """Returns the pairs with these indices, cached per index array."""
        return _subset(self, indices.tobytes())


@lru_cache(maxsize=PAIR_CACHE_SIZE)
def _subset(pairs: WatchedPairs, index_bytes: bytes) -> WatchedPairs:
    indices = np.frombuffer(index_bytes, dtype=np.int64)
    return WatchedPairs(pairs.parts[indices], pairs.margins[indices], pairs.fixed[indices])


def placed_geometries(scene: PlanningScene) -> list[PlacedGeometry]:
    """Returns the collision geometries of links, then of held objects, then of the world."""
    model = scene.model
    result = list(_placed_links(model, tuple(scene.link_margins().tolist())))
    for held in scene.attached.values():
        frame = model.pin_model.frames[model.frame_ids[held.link]]
        body = Body(held.name, ATTACHED, held.link, held.touch_links)
        for shape, pose in held.body.shapes:
            placement = frame.placement * held.body.pose * pose
            result.append(PlacedGeometry(body, frame.parentJoint, placement, shape, scene.attached_padding()))
    for obstacle in scene.obstacles():
        for shape, pose in obstacle.shapes:
            result.append(PlacedGeometry(Body(obstacle.name, WORLD), 0, obstacle.pose * pose, shape, 0.0))
    return result


@lru_cache(maxsize=PAIR_CACHE_SIZE)
def _placed_links(model: RobotModel, margins: tuple[float, ...]) -> tuple[PlacedGeometry, ...]:
    return tuple(
        PlacedGeometry(Body(item.link, LINK, item.link), item.joint_id, item.placement, item.shape, margin)
        for item, margin in zip(model.link_geometries, margins, strict=True)
    )


def watched_pairs(scene: PlanningScene, parts: Sequence[PlacedGeometry], moving: Joints) -> WatchedPairs:
    """Returns the pairs that may not touch, cached across scenes that differ only in poses and shapes.

    Args:
        scene: Scene with the allowed collisions.
        parts: Geometries of the scene.
        moving: Indices of the joints that will move; None for all joints.
    """
    moving_joints = None if moving is None else tuple(int(joint) for joint in moving)
    named, links = scene.acm.entry_names, len(scene.model.link_geometries)
    others = tuple(
        part.body if part.body.kind != WORLD or part.body.name in named else UNNAMED for part in parts[links:]
    )
    joint_ids, margins = tuple([part.joint_id for part in parts]), tuple([part.margin for part in parts])
    verdicts = scene.acm.verdicts
    return _watched_pairs(scene.model, moving_joints, verdicts, others, joint_ids=joint_ids, margins=margins)


@lru_cache(maxsize=PAIR_CACHE_SIZE)
def _watched_pairs(
    model: RobotModel,
    moving: tuple[int, ...] | None,
    verdicts: tuple[frozenset[tuple[frozenset[str], bool]], frozenset[tuple[str, bool]]],
    others: tuple[Body, ...],
    *,
    joint_ids: tuple[int, ...],
    margins: tuple[float, ...],
) -> WatchedPairs:
    """Returns the pairs that may not touch.

    Args:
        model: Robot model.
        moving: Indices of the joints that will move; None for all joints.
        verdicts: Entries and defaults of the allowed collision matrix.
        others: Bodies of the geometries that are not links, bodies of the world last.
        joint_ids: PlacedGeometry.joint_id of all geometries.
        margins: PlacedGeometry.margin of all geometries.
    """
    entries, defaults = verdicts
    self_pairs = _link_pairs(model, moving, entries, defaults)
    if not others:
        return self_pairs
    bodies = [*(part.body for part in _placed_links(model, margins[: len(model.link_geometries)])), *others]
    kinds, links, joints = np.array([body.kind for body in bodies]), len(model.link_geometries), np.array(joint_ids)
    robot_count = int(np.count_nonzero(kinds != WORLD))
    support_ids, rigid_ids = _rigid_joints(model, moving)
    acm = AllowedCollisionMatrix(dict(entries), dict(defaults))
    allowed = _allowed_pairs(acm, bodies[:robot_count], others)
    indices, held = np.arange(len(bodies)), kinds == ATTACHED
    first, second = indices[:robot_count, None], indices[None, links:]  # world bodies do not move mutually
    is_rigid = (rigid_ids[joints[first]] == rigid_ids[joints[second]]) & ~held[first] & ~held[second]
    checked = np.nonzero((second > first) & ~is_rigid & ~allowed)
    first, second = checked[0], checked[1] + links
    return WatchedPairs(
        np.concatenate([self_pairs.parts, np.column_stack([first, second])]),
        np.concatenate([self_pairs.margins, np.where(second >= robot_count, np.array(margins)[first], 0.0)]),
        np.concatenate([self_pairs.fixed, support_ids[joints[first]] == support_ids[joints[second]]]),
    )


def _allowed_pairs(acm: AllowedCollisionMatrix, bodies: Sequence[Body], others: Sequence[Body]) -> NDArray[np.bool_]:
    """Returns whether each body (rows) may touch each of the others (columns)."""
    rows, columns = ({body: index for index, body in enumerate(dict.fromkeys(items))} for items in (bodies, others))
    verdicts = np.array([[_may_touch(acm, body, other) for other in columns] for body in rows], dtype=bool)
    verdicts = verdicts.reshape(len(rows), len(columns))
    return verdicts[np.ix_([rows[body] for body in bodies], [columns[other] for other in others])]


@lru_cache(maxsize=PAIR_CACHE_SIZE)
def _rigid_joints(model: RobotModel, moving: tuple[int, ...] | None) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns two ids per Pinocchio joint, for the set of moving joints it depends on and for its rigid part.

    Joints that depend on the same moving joints share the first id; joints rigidly connected share the second.
    """
    supports, grounded = _supports(model, moving), _grounded_base(model, moving)
    ids: dict[frozenset[int], int] = {}
    support_ids = [ids.setdefault(item, len(ids)) for item in supports]
    return np.array(support_ids), np.array([grounded.get(joint, joint) for joint in range(len(supports))])


@lru_cache(maxsize=PAIR_CACHE_SIZE)
def _link_pairs(
    model: RobotModel,
    moving: tuple[int, ...] | None,
    entries: frozenset[tuple[frozenset[str], bool]],
    defaults: frozenset[tuple[str, bool]],
) -> WatchedPairs:
    """Returns the pairs of the robot's links that may not touch; most scenes share them.

    Args:
        model: Robot model.
        moving: Indices of the joints that will move; None for all joints.
        entries: Entries of the allowed collision matrix.
        defaults: Default entries of the matrix.
    """
    acm = AllowedCollisionMatrix(dict(entries), dict(defaults))
    support_ids, rigid_ids = _rigid_joints(model, moving)
    pairs = [
        (first, second)
        for first, geometry in enumerate(model.link_geometries)
        for second, other in enumerate(model.link_geometries[first + 1 :], first + 1)
        if rigid_ids[geometry.joint_id] != rigid_ids[other.joint_id]
        and geometry.link != other.link
        and not acm.allows(geometry.link, other.link)
    ]
    parts = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    joints = np.array([item.joint_id for item in model.link_geometries], dtype=np.int64)[parts]
    return WatchedPairs(parts, np.zeros(len(parts)), support_ids[joints[:, 0]] == support_ids[joints[:, 1]])


def _grounded_base(model: RobotModel, moving: Joints) -> dict[int, int]:
    """Maps the joint of a planar or floating base that does not move to joint 0, the world; else empty.

    Links that only the base moves are then rigidly connected to the world, as on a fixed-base robot.
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
    """Returns the moving joints, mimic joints included, that each joint of the tree depends on."""
    movable = set(range(len(model.joint_names))) if moving is None else {int(joint) for joint in moving}
    movable |= {follower for follower, leader, _, _ in model.mimics if leader in movable}
    return [frozenset(int(joint) - 1 for joint in joints if joint > 0) & movable for joints in model.pin_model.supports]
