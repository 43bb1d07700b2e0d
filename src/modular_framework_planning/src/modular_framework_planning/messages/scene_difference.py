# SPDX-License-Identifier: BSD-3-Clause
"""Diff messages between scene snapshots."""

from __future__ import annotations

import numpy as np
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject
from moveit_msgs.msg import PlanningScene as SceneMessage

from modular_framework_planning.messages.conversions import state_message
from modular_framework_planning.messages.octomap_conversions import octomap_message
from modular_framework_planning.messages.poses import pose_message
from modular_framework_planning.messages.scene_conversions import (
    attached_to_message,
    colors_to_message,
    frames_to_message,
    object_to_message,
    write_matrix,
)
from modular_framework_planning.messages.scene_messages import scene_message, write_padding
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

MIN_JOINT_CHANGE = 1.0e-4  # [rad or m]; smaller changes are not published


def joints_moved(before: PlanningScene, after: PlanningScene) -> bool:
    """Returns whether a joint moved by more than MIN_JOINT_CHANGE."""
    return bool(np.abs(after.positions - before.positions).max(initial=0.0) > MIN_JOINT_CHANGE)


def difference_message(before: PlanningScene, after: PlanningScene) -> SceneMessage | None:
    """Returns the diff that turns one scene into the other, or None for equal scenes.

    A diff cannot remove fixed frames or the colours of remaining objects. If a fixed frame or such a colour disappears,
    the result is the whole scene.
    """
    remaining = after.objects.keys() | after.attached.keys()
    removed = (before.objects.keys() | before.attached.keys()) - remaining  # with their colours
    if before.colors.keys() - after.colors.keys() - removed or before.fixed_frames.keys() - after.fixed_frames.keys():
        return scene_message(after, 0)
    message = SceneMessage(is_diff=True, name=after.name, robot_model_name=after.model.name)
    empty = SceneMessage(is_diff=True, name=before.name, robot_model_name=after.model.name)
    message.robot_state.is_diff = empty.robot_state.is_diff = True
    if joints_moved(before, after):
        state = state_message(after, with_attached=False)
        message.robot_state.joint_state = state.joint_state
        message.robot_state.multi_dof_joint_state = state.multi_dof_joint_state
    if any(before.fixed_frames.get(name) is not transform for name, transform in after.fixed_frames.items()):
        message.fixed_frame_transforms = frames_to_message(after)
    if before.acm is not after.acm:
        write_matrix(after.acm, message.allowed_collision_matrix)
    if before.padding is not after.padding:
        write_padding(after, message)
    if before.colors is not after.colors:
        message.object_colors = colors_to_message(after)
    if before.octomap is not after.octomap:
        message.world.octomap = octomap_message(after)
    message.robot_state.attached_collision_objects = _attached_changes(before, after)
    message.world.collision_objects = _world_changes(before, after)
    return None if message == empty else message


def _attached_changes(before: PlanningScene, after: PlanningScene) -> list[AttachedCollisionObject]:
    changes = []
    for name in before.attached.keys() - after.attached.keys():
        release = AttachedCollisionObject()
        release.object.id, release.object.operation = name, CollisionObject.REMOVE
        changes.append(release)
    return changes + [
        attached_to_message(after, item)
        for name, item in after.attached.items()
        if before.attached.get(name) is not item
    ]


def _world_changes(before: PlanningScene, after: PlanningScene) -> list[CollisionObject]:
    """Returns changes of world objects to apply after changes of attached objects, which also affect the world."""
    frame = after.model.planning_frame
    released = before.attached.keys() - after.attached.keys()
    removed = (before.objects.keys() - after.attached.keys() | released) - after.objects.keys()
    changes = [CollisionObject(id=name, operation=CollisionObject.REMOVE) for name in sorted(removed)]
    for name, body in after.objects.items():
        old = before.objects.get(name)
        if old is body:
            continue
        if old is not None and old.shapes is body.shapes and old.subframes is body.subframes:
            move = CollisionObject(id=name, operation=CollisionObject.MOVE, pose=pose_message(body.pose))
            move.header.frame_id = frame
            changes.append(move)
        else:
            changes.append(object_to_message(body, frame))
    return changes
