# SPDX-License-Identifier: BSD-3-Clause
"""Lists the bodies of a scene that can collide, and the pairs of them that are checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

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


def watched_pairs(scene: PlanningScene, parts: Sequence[PlacedGeometry], moving: Joints) -> list[WatchedPair]:
    """Returns the pairs that may not touch.

    Args:
        scene: whose allowed collisions count.
        parts: geometries of the scene.
        moving: joints that will move, as indices in a position vector; all by default.
    """
    chosen = None if moving is None else tuple(int(number) for number in moving)
    acm, links = scene.acm, len(scene.model.link_geometries)
    result = list(_link_pairs(scene.model, chosen, frozenset(acm.entries.items()), frozenset(acm.defaults.items())))
    supports = _supports(scene.model, chosen)
    standing = _standing(scene.model, chosen)
    joints = [standing.get(part.joint_id, part.joint_id) for part in parts]
    verdicts: dict[tuple[str, str, str, str], bool] = {}
    for first, one in enumerate(parts):
        if one.body.kind == WORLD:
            break  # the world comes last, and its bodies do not move relative to each other
        for second in range(max(first + 1, links), len(parts)):
            other = parts[second]
            if joints[first] == joints[second] and ATTACHED not in (one.body.kind, other.body.kind):
                continue  # rigidly connected: no motion changes whether they touch
            key = (one.body.kind, one.body.name, other.body.kind, other.body.name)
            allowed = verdicts.get(key)
            if allowed is None:
                allowed = verdicts[key] = _may_touch(scene, one.body, other.body)
            if not allowed:
                margin = one.margin if other.body.kind == WORLD else 0.0
                is_fixed = supports[one.joint_id] == supports[other.joint_id]
                result.append(WatchedPair(first, second, margin, is_fixed))
    return result


@lru_cache(maxsize=KEPT_LINK_PAIRS)
def _link_pairs(
    model: RobotModel,
    moving: tuple[int, ...] | None,
    entries: frozenset[tuple[frozenset[str], bool]],
    defaults: frozenset[tuple[str, bool]],
) -> tuple[WatchedPair, ...]:
    """Returns the pairs of the robot's own links that may not touch; they are the same in most scenes.

    Args:
        model: the robot.
        moving: as for watched_pairs.
        entries: of the allowed collision matrix.
        defaults: of the same.
    """
    acm = AllowedCollisionMatrix(dict(entries), dict(defaults))
    supports, standing = _supports(model, moving), _standing(model, moving)
    joints = [standing.get(item.joint_id, item.joint_id) for item in model.link_geometries]
    return tuple(
        WatchedPair(first, second, 0.0, supports[one.joint_id] == supports[other.joint_id])
        for first, one in enumerate(model.link_geometries)
        for second, other in enumerate(model.link_geometries[first + 1 :], first + 1)
        if joints[first] != joints[second] and one.link != other.link and not acm.allows(one.link, other.link)
    )


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
    return [frozenset(int(joint) - 1 for joint in chain if joint > 0) & chosen for chain in model.pin_model.supports]
