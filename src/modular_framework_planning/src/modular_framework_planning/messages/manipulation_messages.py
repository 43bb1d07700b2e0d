# SPDX-License-Identifier: BSD-3-Clause
"""Reads the goals of pickup and place into manoeuvres; a fault in a message is an error that names the field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError, UnknownNameError
from modular_framework_planning.geometry.spatial import Transform
from modular_framework_planning.messages.poses import stamped_in_scene
from modular_framework_planning.pick_place.manipulation import Manoeuvre, Translation, allowing
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    SceneChange,
)
from modular_framework_urdf.mimics import Mimic, with_leaders


@dataclass(frozen=True, slots=True, eq=False)
class Hand:
    """The end effector.

    Attributes:
        link: what it is fixed to; poses of grasps are poses of this link.
        links: its own.
        joints: its own, which postures may name; mimics: those that follow one of them, which they may name too.
    """

    link: str
    links: tuple[str, ...]
    joints: frozenset[str]
    mimics: Mapping[str, Mimic]


def translation(scene: PlanningScene, message: Any, link: str, where: str) -> Translation:
    """Reads a GripperTranslation; a direction in a frame fixed to the link turns with it.

    Raises:
        PlanningError: an unknown frame, a direction without length, or distances that are none.
    """
    vector = message.direction.vector
    direction = np.array([vector.x, vector.y, vector.z], dtype=float)
    desired, minimum = float(message.desired_distance), float(message.min_distance)
    distances = np.array([desired, minimum])
    if not (np.isfinite(direction).all() and np.isfinite(distances).all() and (distances >= 0.0).all()):
        raise PlanningError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS,
            f"{where}: direction {direction.tolist()}, "
            f"desired_distance {desired}, min_distance {minimum}; finite numbers are needed, distances "
            "of at least 0",
        )
    desired = max(desired, minimum)
    length = float(np.linalg.norm(direction))
    if length < 1e-9:
        if desired > 0.0:
            raise PlanningError(
                ErrorCode.INVALID_GOAL_CONSTRAINTS,
                f"{where}: the direction is zero but {desired} m are asked for; give a direction",
            )
        return Translation(np.array([0.0, 0.0, 1.0]), False, 0.0, 0.0)
    frame = message.direction.header.frame_id.removeprefix("/")
    turn = scene.frame_transform(frame).rotation
    in_link = scene.model.has_link(frame) and _rigid(scene, frame, link)
    if in_link:
        turn = scene.frame_transform(link).rotation.T @ turn
    return Translation(turn @ direction / length, in_link, desired, minimum)


def _rigid(scene: PlanningScene, first: str, second: str) -> bool:
    frames, ids = scene.model.pin_model.frames, scene.model.frame_ids
    joint = frames[ids[first]].parentJoint
    return joint == frames[ids[second]].parentJoint and joint != 0


def posture(message: Any, hand: Hand, where: str) -> dict[str, float]:
    """Reads a posture of the fingers: the last point of the trajectory; none where it names no joint.

    A joint that mimics another counts only where that one is not named: the other one moves it, as in MoveIt.

    Raises:
        PlanningError: a joint is not the end effector's, or there is no finite position for each joint.
    """
    if not message.joint_names:
        return {}
    known = hand.joints | hand.mimics.keys()
    unknown = [name for name in message.joint_names if name not in known]
    if unknown:
        raise UnknownNameError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS, f"{where}: joint of the end effector", unknown[0], known
        )
    points = message.points
    values = list(points[-1].positions) if points else []
    if len(values) != len(message.joint_names) or not np.isfinite(values).all():
        raise PlanningError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS,
            f"{where}: {len(points)} points, the last with "
            f"{len(values)} positions for {len(message.joint_names)} joints; one finite position for "
            "each joint is needed",
        )
    return with_leaders(dict(zip(message.joint_names, map(float, values), strict=True)), hand.mimics)


def _allowance(hand: Hand, target: str, goal: Any, touched: Sequence[str]) -> SceneChange:
    """Allowed collisions: hand and object, hand and named links, object and support; on request hand and support."""
    surface, others = goal.support_surface_name, [target, *goal.allowed_touch_objects, *touched]
    if surface and goal.allow_gripper_support_collision:
        others.append(surface)

    def allow(scene: PlanningScene) -> PlanningScene:
        scene = allowing(scene, hand.links, others)
        return allowing(scene, [target], [surface]) if surface else scene

    return allow


def _require_quality(value: float, where: str) -> None:
    if not np.isfinite(value):
        raise PlanningError(ErrorCode.INVALID_GOAL_CONSTRAINTS, f"{where} is {value}; a finite number is needed")


def attaching(target: str, link: str, touch_links: Sequence[str]) -> SceneChange:
    """Returns the change that fixes a world object to a link, where both are now."""

    def change(scene: PlanningScene) -> PlanningScene:
        body = scene.find_object(target)
        in_link = scene.model.link_transforms(scene.positions)[link].actInv(body.pose)
        return scene.with_attached(
            AttachedObject(
                CollisionObject(body.name, in_link, body.shapes, body.subframes), link, frozenset(touch_links)
            )
        )

    return change


def grasp_manoeuvre(scene: PlanningScene, goal: Any, grasp: Any, hand: Hand, where: str) -> Manoeuvre:
    """Reads one Grasp of a PickupGoal; raises PlanningError."""
    _require_quality(grasp.grasp_quality, f"{where}.grasp_quality")
    touch = list(goal.attached_object_touch_links) or [*hand.links, hand.link]
    return Manoeuvre(
        grasp.id or where,
        stamped_in_scene(scene, grasp.grasp_pose, f"{where}.grasp_pose"),
        translation(scene, grasp.pre_grasp_approach, hand.link, f"{where}.pre_grasp_approach"),
        translation(scene, grasp.post_grasp_retreat, hand.link, f"{where}.post_grasp_retreat"),
        _allowance(hand, goal.target_name, goal, grasp.allowed_touch_objects),
        attaching(goal.target_name, hand.link, touch),
        posture(grasp.pre_grasp_posture, hand, f"{where}.pre_grasp_posture"),
        posture(grasp.grasp_posture, hand, f"{where}.grasp_posture"),
        goal.minimize_object_distance,
    )


def place_manoeuvre(
    scene: PlanningScene, goal: Any, location: Any, hand: Hand, held: AttachedObject, where: str
) -> Manoeuvre:
    """Reads one PlaceLocation of a PlaceGoal; raises PlanningError."""
    _require_quality(location.quality, f"{where}.quality")
    pose = stamped_in_scene(scene, location.place_pose, f"{where}.place_pose")
    return Manoeuvre(
        location.id or where,
        pose if goal.place_eef else _link_pose(scene, pose, held, hand.link),
        translation(scene, location.pre_place_approach, hand.link, f"{where}.pre_place_approach"),
        translation(scene, location.post_place_retreat, hand.link, f"{where}.post_place_retreat"),
        _allowance(hand, held.name, goal, location.allowed_touch_objects),
        lambda now: now.with_detached(held.name),
        {},
        posture(location.post_place_posture, hand, f"{where}.post_place_posture"),
        middle="release",
    )


def _link_pose(scene: PlanningScene, object_pose: Transform, held: AttachedObject, link: str) -> Transform:
    """Returns where the link is when the held object has this pose."""
    links = scene.model.link_transforms(scene.positions)
    object_in_link = links[link].inverse() * links[held.link] * held.body.pose
    return object_pose * object_in_link.inverse()


def held_object(scene: PlanningScene, name: str, hand: Hand) -> AttachedObject:
    """Returns the attached object of that name, or the only one the hand holds where the name is empty.

    Raises:
        PlanningError: it is not attached, not to this hand, or the hand holds none or several.
    """
    own = {hand.link, *hand.links}
    held: Mapping[str, AttachedObject] = {key: item for key, item in scene.attached.items() if item.link in own}
    if name:
        if name not in held:
            raise UnknownNameError(ErrorCode.INVALID_OBJECT_NAME, f"object attached to {hand.link}:", name, held)
        return held[name]
    if len(held) != 1:
        raise PlanningError(
            ErrorCode.INVALID_OBJECT_NAME,
            f"attached_object_name is empty and the end effector at "
            f"'{hand.link}' holds {len(held)} objects ({', '.join(held) or 'none'}); name one",
        )
    return next(iter(held.values()))
