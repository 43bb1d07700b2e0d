# SPDX-License-Identifier: BSD-3-Clause
"""Queries the models of the simulation, so that managers follow spawned and deleted objects."""

from __future__ import annotations

from collections.abc import Callable, Collection

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


def remove_deleted_objects(remove_missing: Callable[[Collection[str]], list[str]], store: str) -> None:
    """Removes the objects deleted from the simulation, if the parameter ``simulation`` is true; logs every failure.

    Args:
        remove_missing: Function that removes the objects whose model is not among the given models, and returns the
            removed names.
        store: Name of the store, for messages.
    """
    if rospy.get_param(SIMULATION_PARAMETER, False) is not True:
        return
    name = "gazebo/get_world_properties"
    try:
        response = request_service(name, GetWorldProperties, GetWorldPropertiesRequest(), SERVICE_TIMEOUT_S)
        if not response.success:
            raise CallError(f"service '{rospy.resolve_name(name)}' refused: {response.status_message}")
    except CallError as error:
        rospy.logwarn("%s: the models of the simulation are unknown: %s", store, error)
        return
    for removed in remove_missing(response.model_names):
        rospy.loginfo("%s: '%s' is no longer in the simulation and was removed", store, removed)


def planning_scene_objects(timeout_s: float) -> list[str]:
    """Returns the IDs of all objects of the planning scene, of attached objects too.

    Args:
        timeout_s: Maximum wait for the service, and then for its response [s].

    Raises:
        CallError: move_group does not answer.
    """
    components = PlanningSceneComponents.WORLD_OBJECT_NAMES | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS
    request = GetPlanningSceneRequest(components=PlanningSceneComponents(components=components))
    scene = request_service("get_planning_scene", GetPlanningScene, request, timeout_s).scene
    ids = [item.id for item in scene.world.collision_objects]
    return ids + [item.object.id for item in scene.robot_state.attached_collision_objects]


def new_movable_objects(excluded_ids: Collection[str]) -> list[str]:
    """Returns the objects of the planning scene that are movable models of the simulation.

    Static models such as tables are excluded, because a request without object names must not allow collisions with
    them. Returns an empty list if the parameter ``simulation`` is not true.

    Args:
        excluded_ids: Object IDs to exclude.

    Returns:
        Object IDs in the planning scene, ``<model>__<link>``.

    Raises:
        CallError: move_group or the simulation does not answer.
    """
    if rospy.get_param(SIMULATION_PARAMETER, False) is not True:
        return []
    get_properties = rospy.ServiceProxy("gazebo/get_model_properties", GetModelProperties)
    names = planning_scene_objects(SERVICE_TIMEOUT_S)
    wait_for_service(get_properties, SERVICE_TIMEOUT_S)
    movable = []
    for name in names:
        model, separator, _link = name.rpartition(LINK_SEPARATOR)
        if separator and name not in excluded_ids:
            properties_request = GetModelPropertiesRequest(model_name=model)
            properties = call_service(get_properties, properties_request, SERVICE_TIMEOUT_S)
            if properties.success and not properties.is_static:
                movable.append(name)
    return movable
