# SPDX-License-Identifier: BSD-3-Clause
"""Converts pickup and place goals to manoeuvres; errors name the message field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError, UnknownNameError
from modular_framework_planning.geometry.spatial import Transform
from modular_framework_planning.messages.poses import stamped_in_scene
from modular_framework_planning.pick_place.manipulation import Manoeuvre, Translation, allow_contacts
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
        link: Parent link of the end effector; grasp poses are poses of this link.
        links: Links of the end effector.
        joints: Joints of the end effector.
        mimics: Mimic joints whose leaders are in `joints`.
    """

    link: str
    links: tuple[str, ...]
    joints: frozenset[str]
    mimics: Mapping[str, Mimic]


def translation(scene: PlanningScene, message: Any, link: str, field_name: str) -> Translation:
    """Reads a GripperTranslation; a direction in a frame fixed to the link rotates with the link.

    Args:
        scene: Scene with the poses of frames.
        message: moveit_msgs/GripperTranslation.
        link: Link that the translation moves.
        field_name: Name of the message field, for error messages.

    Raises:
        PlanningError: The frame is unknown, the direction is zero, or a distance is invalid.
    """
    vector = message.direction.vector
    direction = np.array([vector.x, vector.y, vector.z], dtype=float)
    desired, minimum = float(message.desired_distance), float(message.min_distance)
    distances = np.array([desired, minimum])
    if not (np.isfinite(direction).all() and np.isfinite(distances).all() and (distances >= 0.0).all()):
        raise PlanningError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS,
            f"{field_name}: direction {direction.tolist()}, "
            f"desired_distance {desired}, min_distance {minimum}; give finite numbers, and distances "
            "of at least 0",
        )
    desired = max(desired, minimum)
    length = float(np.linalg.norm(direction))
    if length < 1e-9:
        if desired > 0.0:
            raise PlanningError(
                ErrorCode.INVALID_GOAL_CONSTRAINTS,
                f"{field_name}: the direction is zero, but the desired distance is {desired} m; give a direction",
            )
        return Translation(np.array([0.0, 0.0, 1.0]), False, 0.0, 0.0)
    frame = message.direction.header.frame_id.removeprefix("/")
    rotation = scene.frame_transform(frame).rotation
    in_link = scene.model.has_link(frame) and _is_rigid(scene, frame, link)
    if in_link:
        rotation = scene.frame_transform(link).rotation.T @ rotation
    return Translation(rotation @ direction / length, in_link, desired, minimum)


def _is_rigid(scene: PlanningScene, first: str, second: str) -> bool:
    frames, ids = scene.model.pin_model.frames, scene.model.frame_ids
    joint = frames[ids[first]].parentJoint
    return joint == frames[ids[second]].parentJoint and joint != 0


def posture(message: Any, hand: Hand, field_name: str) -> dict[str, float]:
    """Reads a posture of the fingers from the last point of a trajectory; empty if no joint is named.

    As in MoveIt, a mimic joint only counts if its leader is not named.

    Args:
        message: trajectory_msgs/JointTrajectory.
        hand: End effector.
        field_name: Name of the message field, for error messages.

    Raises:
        PlanningError: A joint does not belong to the end effector, or a position is missing or not finite.
    """
    if not message.joint_names:
        return {}
    known = hand.joints | hand.mimics.keys()
    unknown = [name for name in message.joint_names if name not in known]
    if unknown:
        raise UnknownNameError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS, f"{field_name}: joint of the end effector", unknown[0], known
        )
    points = message.points
    values = list(points[-1].positions) if points else []
    if len(values) != len(message.joint_names) or not np.isfinite(values).all():
        raise PlanningError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS,
            f"{field_name}: {len(points)} points, the last with "
            f"{len(values)} positions for {len(message.joint_names)} joints; give one finite position "
            "per joint",
        )
    return with_leaders(dict(zip(message.joint_names, map(float, values), strict=True)), hand.mimics)


def _allowance(hand: Hand, target: str, goal: Any, touched: Sequence[str]) -> SceneChange:
    """Returns the scene change that allows the hand to touch given bodies, and the object to touch its support."""
    surface, others = goal.support_surface_name, [target, *goal.allowed_touch_objects, *touched]
    if surface and goal.allow_gripper_support_collision:
        others.append(surface)

    def allow(scene: PlanningScene) -> PlanningScene:
        scene = allow_contacts(scene, hand.links, others)
        return allow_contacts(scene, [target], [surface]) if surface else scene

    return allow


def _require_quality(value: float, field_name: str) -> None:
    if not np.isfinite(value):
        raise PlanningError(ErrorCode.INVALID_GOAL_CONSTRAINTS, f"{field_name} is {value}; give a finite number")


def attaching(target: str, link: str, touch_links: Sequence[str]) -> SceneChange:
    """Returns the change that attaches a world object to a link at the current relative pose.

    Args:
        target: Name of the object.
        link: Name of the link.
        touch_links: Links that the object may touch.
    """

    def change(scene: PlanningScene) -> PlanningScene:
        body = scene.find_object(target)
        in_link = scene.model.link_transforms(scene.positions)[link].actInv(body.pose)
        return scene.with_attached(
            AttachedObject(
                CollisionObject(body.name, in_link, body.shapes, body.subframes), link, frozenset(touch_links)
            )
        )

    return change


def grasp_manoeuvre(scene: PlanningScene, goal: Any, grasp: Any, hand: Hand, field_name: str) -> Manoeuvre:
    """Reads one Grasp of a PickupGoal.

    Args:
        scene: Scene with the poses of frames.
        goal: moveit_msgs/PickupGoal.
        grasp: moveit_msgs/Grasp.
        hand: End effector.
        field_name: Name of the message field, for error messages.

    Raises:
        PlanningError: The grasp is invalid.
    """
    _require_quality(grasp.grasp_quality, f"{field_name}.grasp_quality")
    touch = list(goal.attached_object_touch_links) or [*hand.links, hand.link]
    return Manoeuvre(
        name=grasp.id or field_name,
        tip_pose=stamped_in_scene(scene, grasp.grasp_pose, f"{field_name}.grasp_pose"),
        approach=translation(scene, grasp.pre_grasp_approach, hand.link, f"{field_name}.pre_grasp_approach"),
        retreat=translation(scene, grasp.post_grasp_retreat, hand.link, f"{field_name}.post_grasp_retreat"),
        allow=_allowance(hand, goal.target_name, goal, grasp.allowed_touch_objects),
        effect=attaching(goal.target_name, hand.link, touch),
        fingers_before=posture(grasp.pre_grasp_posture, hand, f"{field_name}.pre_grasp_posture"),
        fingers_after=posture(grasp.grasp_posture, hand, f"{field_name}.grasp_posture"),
        closing_in=goal.minimize_object_distance,
    )


def place_manoeuvre(
    scene: PlanningScene, goal: Any, location: Any, *, hand: Hand, held: AttachedObject, field_name: str
) -> Manoeuvre:
    """Reads one PlaceLocation of a PlaceGoal.

    Args:
        scene: Scene with the poses of frames.
        goal: moveit_msgs/PlaceGoal.
        location: moveit_msgs/PlaceLocation.
        hand: End effector.
        held: Object to place.
        field_name: Name of the message field, for error messages.

    Raises:
        PlanningError: The location is invalid.
    """
    _require_quality(location.quality, f"{field_name}.quality")
    pose = stamped_in_scene(scene, location.place_pose, f"{field_name}.place_pose")
    return Manoeuvre(
        name=location.id or field_name,
        tip_pose=pose if goal.place_eef else _link_pose(scene, pose, held, hand.link),
        approach=translation(scene, location.pre_place_approach, hand.link, f"{field_name}.pre_place_approach"),
        retreat=translation(scene, location.post_place_retreat, hand.link, f"{field_name}.post_place_retreat"),
        allow=_allowance(hand, held.name, goal, location.allowed_touch_objects),
        effect=lambda current: current.with_detached(held.name),
        fingers_before={},
        fingers_after=posture(location.post_place_posture, hand, f"{field_name}.post_place_posture"),
        middle="release",
    )


def _link_pose(scene: PlanningScene, object_pose: Transform, held: AttachedObject, link: str) -> Transform:
    """Returns the pose of the link that puts the held object at the given pose."""
    links = scene.model.link_transforms(scene.positions)
    object_in_link = links[link].inverse() * links[held.link] * held.body.pose
    return object_pose * object_in_link.inverse()


def held_object(scene: PlanningScene, name: str, hand: Hand) -> AttachedObject:
    """Returns the named object held by the hand; for an empty name, the only object that the hand holds.

    Args:
        scene: Scene.
        name: Name of the object; may be empty.
        hand: End effector.

    Raises:
        PlanningError: The hand does not hold the object, or holds no or several objects and the name is empty.
    """
    hand_links = {hand.link, *hand.links}
    held: Mapping[str, AttachedObject] = {key: item for key, item in scene.attached.items() if item.link in hand_links}
    if name:
        if name not in held:
            raise UnknownNameError(ErrorCode.INVALID_OBJECT_NAME, f"object attached to {hand.link}:", name, held)
        return held[name]
    if len(held) != 1:
        raise PlanningError(
            ErrorCode.INVALID_OBJECT_NAME,
            f"attached_object_name is empty and the end effector at "
            f"'{hand.link}' holds {len(held)} objects ({', '.join(held) or 'none'}); name one object",
        )
    return next(iter(held.values()))
