# SPDX-License-Identifier: BSD-3-Clause
"""Asks the simulation for its models: managers know the objects of a world file, and forget those that were deleted."""

from __future__ import annotations

from collections.abc import Collection

import rospy
from gazebo_msgs.srv import (
    GetModelProperties,
    GetModelPropertiesRequest,
    GetWorldProperties,
    GetWorldPropertiesRequest,
)
from moveit_msgs.msg import PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene, GetPlanningSceneRequest

from modular_framework_core.managers.acm import LINK_SEPARATOR
from modular_framework_ros.calls import CallError, call_service, request_service, wait_for_service

SIMULATION_PARAMETER = "simulation"
SERVICE_TIMEOUT_S = 3.0


def simulated_models() -> list[str] | None:
    """Returns the names of all models in the simulation; None without one (parameter ``simulation`` not true).

    Raises:
        CallError: The simulation does not answer.
    """
    if rospy.get_param(SIMULATION_PARAMETER, False) is not True:
        return None
    name = "gazebo/get_world_properties"
    answer = request_service(name, GetWorldProperties, GetWorldPropertiesRequest(), SERVICE_TIMEOUT_S)
    if not answer.success:
        raise CallError(f"service '{rospy.resolve_name(name)}' refused: {answer.status_message}")
    return list(answer.model_names)


def new_movable_objects(known: Collection[str]) -> list[str]:
    """Returns the objects of the planning scene that are models of the simulation and free to move.

    Tables, pedestals and other static models are left out: the manipulator must never be allowed to touch them by
    a request that names no object. Without a simulation (parameter ``simulation`` not true) there are none.

    Args:
        known: Ids that are left out.

    Returns:
        Ids of the planning scene, ``<model>__<link>``.

    Raises:
        CallError: move_group or the simulation does not answer.
    """
    if rospy.get_param(SIMULATION_PARAMETER, False) is not True:
        return []
    get_scene = rospy.ServiceProxy("get_planning_scene", GetPlanningScene)
    get_properties = rospy.ServiceProxy("gazebo/get_model_properties", GetModelProperties)
    for proxy in (get_scene, get_properties):
        wait_for_service(proxy, SERVICE_TIMEOUT_S)
    wanted = PlanningSceneComponents.WORLD_OBJECT_NAMES | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS
    request = GetPlanningSceneRequest(components=PlanningSceneComponents(components=wanted))
    scene = call_service(get_scene, request, SERVICE_TIMEOUT_S).scene
    ids = [item.id for item in scene.world.collision_objects]
    ids += [item.object.id for item in scene.robot_state.attached_collision_objects]
    found = []
    for name in ids:
        model, separator, _link = name.rpartition(LINK_SEPARATOR)
        if separator and name not in known:
            asked = GetModelPropertiesRequest(model_name=model)
            properties = call_service(get_properties, asked, SERVICE_TIMEOUT_S)
            if properties.success and not properties.is_static:
                found.append(name)
    return found
