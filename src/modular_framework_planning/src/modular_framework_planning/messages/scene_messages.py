# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of whole PlanningScene messages to and from scene snapshots."""

from __future__ import annotations

from typing import Any

from moveit_msgs.msg import LinkPadding, LinkScale
from moveit_msgs.msg import PlanningScene as SceneMessage
from moveit_msgs.msg import PlanningSceneComponents as Parts

from modular_framework_planning.messages.conversions import scene_with_state, state_message
from modular_framework_planning.messages.octomap_conversions import octomap_message, with_octomap_of
from modular_framework_planning.messages.scene_conversions import (
    apply_collision_object,
    colors_to_message,
    fixed_frames_from,
    frames_to_message,
    object_to_message,
    with_matrix_of,
    write_matrix,
)
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, empty_scene

ALL_PARTS = 0x3FF


def apply_world(scene: PlanningScene, world: Any) -> PlanningScene:
    """Returns the scene after the changes of a PlanningSceneWorld message."""
    for item in world.collision_objects:
        scene = apply_collision_object(scene, item)
    return with_octomap_of(scene, world.octomap)


def apply_scene(scene: PlanningScene, message: SceneMessage) -> PlanningScene:
    """Returns the scene after a diff, or the scene of a full message.

    As in MoveIt, a full message replaces objects, attached objects, octomap and colours. Without allowed collisions,
    the initial allowed collisions return. Unnamed joints, paddings and known frames (including tf frames) stay.

    Raises:
        PlanningError: The message is invalid.
    """
    if not message.is_diff:
        scene = (
            empty_scene(scene.model, scene.positions).with_padding(scene.padding).with_fixed_frames(scene.fixed_frames)
        )
    if message.name:
        scene = scene.with_name(message.name)
    if message.fixed_frame_transforms:
        scene = scene.with_fixed_frames(fixed_frames_from(scene, message.fixed_frame_transforms))
    scene = scene_with_state(scene, message.robot_state, "planning scene robot_state")
    scene = apply_world(scene, message.world)
    scene = with_matrix_of(scene, message.allowed_collision_matrix)
    if message.link_padding or message.link_scale:
        scene = scene.with_padding(
            scene.padding.with_links(
                {item.link_name: item.padding for item in message.link_padding},
                {item.link_name: item.scale for item in message.link_scale},
            )
        )
    if message.object_colors:
        scene = scene.with_colors({c.id: (c.color.r, c.color.g, c.color.b, c.color.a) for c in message.object_colors})
    return scene


def scene_message(scene: PlanningScene, components: int) -> SceneMessage:
    """Returns a message with the requested parts of the scene (bits of PlanningSceneComponents, 0 for all)."""
    requested = components or ALL_PARTS
    message = SceneMessage(is_diff=False)
    if requested & Parts.SCENE_SETTINGS:
        message.name, message.robot_model_name = scene.name, scene.model.name
    if requested & (Parts.ROBOT_STATE | Parts.ROBOT_STATE_ATTACHED_OBJECTS):
        message.robot_state = state_message(scene, None, bool(requested & Parts.ROBOT_STATE_ATTACHED_OBJECTS))
    geometry = bool(requested & Parts.WORLD_OBJECT_GEOMETRY)
    if geometry or requested & Parts.WORLD_OBJECT_NAMES:
        message.world.collision_objects = [
            object_to_message(body, scene.model.planning_frame, geometry) for body in scene.objects.values()
        ]
    if requested & Parts.OCTOMAP:
        message.world.octomap = octomap_message(scene)
    if requested & Parts.TRANSFORMS:
        message.fixed_frame_transforms = frames_to_message(scene)
    if requested & Parts.ALLOWED_COLLISION_MATRIX:
        write_matrix(scene.acm, message.allowed_collision_matrix)
    if requested & Parts.LINK_PADDING_AND_SCALING:
        write_padding(scene, message)
    if requested & Parts.OBJECT_COLORS:
        message.object_colors = colors_to_message(scene)
    return message


def write_padding(scene: PlanningScene, message: SceneMessage) -> None:
    """Writes padding and scale of every link with collision geometry."""
    links = dict.fromkeys(item.link for item in scene.model.link_geometries)
    message.link_padding = [LinkPadding(link, scene.padding.links.get(link, 0.0)) for link in links]
    message.link_scale = [LinkScale(link, scene.padding.scales.get(link, 1.0)) for link in links]
