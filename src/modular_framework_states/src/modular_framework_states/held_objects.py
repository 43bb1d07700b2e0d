# SPDX-License-Identifier: BSD-3-Clause
"""Finds the objects held by the manipulator in the planning scene, and detaches them."""

from __future__ import annotations

import rospy
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
