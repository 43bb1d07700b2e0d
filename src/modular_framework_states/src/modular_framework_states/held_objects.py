# SPDX-License-Identifier: BSD-3-Clause
"""Finds the objects held by the manipulator in the planning scene, and detaches them."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
import rospy
from geometry_msgs.msg import Pose
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    PlanningScene,
    PlanningSceneComponents,
)
from moveit_msgs.srv import (
    ApplyPlanningScene,
    ApplyPlanningSceneRequest,
    GetPlanningScene,
    GetPlanningSceneRequest,
)

from modular_framework_core.task_runner.manipulator_links import manipulator_links
from modular_framework_ros.calls import CallError, request_service

PREFIX_PARAMETER = "manipulator_prefix"
SERVICE_TIMEOUT_S = 10.0
REST_M, REST_RAD = 1.0e-3, 0.01
"""Largest motion of an object at rest."""


def held_objects() -> dict[str, str]:
    """Returns {object: link} for the objects attached to links of the manipulator in the planning scene.

    Links of the manipulator contain ``manipulator_prefix`` in their names; without that parameter, all links count.

    Raises:
        CallError: move_group does not respond.
    """
    prefix = str(rospy.get_param(PREFIX_PARAMETER, ""))
    components = PlanningSceneComponents(components=PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS)
    request = GetPlanningSceneRequest(components=components)
    scene = request_service("get_planning_scene", GetPlanningScene, request, SERVICE_TIMEOUT_S).scene
    return {
        item.object.id: item.link_name
        for item in scene.robot_state.attached_collision_objects
        if not prefix or manipulator_links([item.link_name], prefix)
    }


def object_poses(names: Collection[str]) -> dict[str, Pose]:
    """Returns the poses of world objects in the planning scene, {object: pose in the planning frame}.

    Raises:
        CallError: move_group does not respond, or has no such object.
    """
    components = PlanningSceneComponents(components=PlanningSceneComponents.WORLD_OBJECT_NAMES)
    request = GetPlanningSceneRequest(components=components)
    scene = request_service("get_planning_scene", GetPlanningScene, request, SERVICE_TIMEOUT_S).scene
    poses = {item.id: item.pose for item in scene.world.collision_objects if item.id in names}
    if missing := sorted(set(names) - poses.keys()):
        raise CallError(f"the planning scene has no {', '.join(missing)} in the world")
    return poses


def have_moved(before: Mapping[str, Pose], after: Mapping[str, Pose]) -> bool:
    """Returns whether an object has moved by more than REST_M or rotated by more than REST_RAD."""
    for name, pose in before.items():
        (start, turn), (end, turned) = (_arrays(item) for item in (pose, after[name]))
        if np.linalg.norm(end - start) > REST_M or 2.0 * np.arccos(min(abs(turn @ turned), 1.0)) > REST_RAD:
            return True
    return False


def _arrays(pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Returns position (3,) [m] and quaternion (4,)."""
    position, turn = pose.position, pose.orientation
    return np.array([position.x, position.y, position.z]), np.array([turn.x, turn.y, turn.z, turn.w])


def detach(objects: dict[str, str]) -> None:
    """Detaches objects, which stay in the world at their present poses.

    Args:
        objects: {object: link to which it is attached}.

    Raises:
        CallError: move_group does not respond or rejects the change.
    """
    scene = PlanningScene(is_diff=True)
    scene.robot_state.is_diff = True
    scene.robot_state.attached_collision_objects = [
        AttachedCollisionObject(link_name=link, object=CollisionObject(id=name, operation=CollisionObject.REMOVE))
        for name, link in objects.items()
    ]
    request = ApplyPlanningSceneRequest(scene=scene)
    if not request_service("apply_planning_scene", ApplyPlanningScene, request, SERVICE_TIMEOUT_S).success:
        service = rospy.resolve_name("apply_planning_scene")
        raise CallError(f"service '{service}' did not detach {', '.join(objects)}; its node logged the reason")
