# SPDX-License-Identifier: BSD-3-Clause
"""Reads from the planning scene the objects that the manipulator holds, and detaches them."""

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

from modular_framework_ros.calls import CallError, call_service, wait_for_service

PREFIX_PARAMETER = "manipulator_prefix"
SERVICE_TIMEOUT_S = 10.0


def held_objects() -> dict[str, str]:
    """Returns {object: link} of what is attached to links of the manipulator in the planning scene.

    The links are those with ``manipulator_prefix`` in their names; without that parameter, all links of the robot.

    Raises:
        CallError: move_group does not answer.
    """
    prefix = str(rospy.get_param(PREFIX_PARAMETER, ""))
    proxy = rospy.ServiceProxy("get_planning_scene", GetPlanningScene)
    wait_for_service(proxy, SERVICE_TIMEOUT_S)
    components = PlanningSceneComponents(components=PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS)
    scene = call_service(proxy, GetPlanningSceneRequest(components=components), SERVICE_TIMEOUT_S).scene
    return {
        item.object.id: item.link_name
        for item in scene.robot_state.attached_collision_objects
        if prefix in item.link_name
    }


def detach(objects: dict[str, str]) -> None:
    """Detaches objects, which stay in the world at their present poses.

    Args:
        objects: {object: link it is attached to}.

    Raises:
        CallError: move_group does not answer, or refuses.
    """
    proxy = rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene)
    wait_for_service(proxy, SERVICE_TIMEOUT_S)
    scene = PlanningScene(is_diff=True)
    scene.robot_state.is_diff = True
    scene.robot_state.attached_collision_objects = [
        AttachedCollisionObject(link_name=link, object=CollisionObject(id=name, operation=CollisionObject.REMOVE))
        for name, link in objects.items()
    ]
    if not call_service(proxy, ApplyPlanningSceneRequest(scene=scene), SERVICE_TIMEOUT_S).success:
        raise CallError(
            f"service '{proxy.resolved_name}' did not detach {', '.join(objects)}; its node logged the reason"
        )
