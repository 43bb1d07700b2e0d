# SPDX-License-Identifier: BSD-3-Clause
"""Spawns or deletes an object in the simulation, the object types and the collision matrix, atomically.

If one of them refuses, the earlier steps are undone and the exit code is nonzero.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import rospy
from gazebo_msgs.srv import DeleteModel, DeleteModelRequest, SpawnModel, SpawnModelRequest
from geometry_msgs.msg import Point, Pose, Quaternion

from modular_framework_core import srv
from modular_framework_core.scene.manage_object import ObjectRequest, ObjectRequestError, parse_request
from modular_framework_ros.calls import CallError, request_service, wait_for_service
from modular_framework_urdf.rotations import quaternion_from_rpy

SERVICE_TIMEOUT_S = 15.0


class RefusedError(RuntimeError):
    """A service is missing, failed or refused a request."""


def call(name: str, service_type: Any, request: Any, refusal: str = "its node logged the reason") -> Any:
    """Calls a service and returns the response.

    Args:
        name: Name of the service.
        service_type: Service type.
        request: Service request.
        refusal: Error message for a refusal without a reason.

    Raises:
        RefusedError: The service is missing, fails, or returns without success.
    """
    response = call_without_check(name, service_type, request)
    if not response.success:
        text = getattr(response, "status_message", "") or refusal
        raise RefusedError(f"service '{rospy.resolve_name(name)}' refused: {text}")
    return response


def call_without_check(name: str, service_type: Any, request: Any) -> Any:
    """Calls a service whose refusal is not an error, and returns the response.

    Args:
        name: Name of the service.
        service_type: Service type.
        request: Service request.

    Raises:
        RefusedError: The service is missing or fails.
    """
    try:
        return request_service(name, service_type, request, SERVICE_TIMEOUT_S)
    except CallError as error:
        raise RefusedError(str(error)) from error


def spawn(request: ObjectRequest) -> None:
    """Spawns an object. On failure, all changes are undone.

    Raises:
        RefusedError: A service refused, or the file cannot be read.
    """
    if request.sdf_file is None:
        raise RefusedError(f"no SDF file is known for '{request.name}'")
    _require(
        {
            "add_gazebo_mapping": srv.AddGazeboMapping,
            "gazebo/spawn_sdf_model": SpawnModel,
            "get_object_type": srv.GetGazeboType,
            "update_acm_entry": srv.UpdateACMEntry,
        }
    )
    try:
        xml = request.sdf_file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RefusedError(f"'{request.sdf_file}' cannot be read: {error}") from error
    pose = Pose(Point(*request.position_m), Quaternion(*quaternion_from_rpy(*request.rpy_rad)))
    call(
        "add_gazebo_mapping",
        srv.AddGazeboMapping,
        srv.AddGazeboMappingRequest(object_name=request.name, object_type=request.object_type),
        f"an object '{request.name}' exists already; choose a different name (-n), or delete that object first",
    )
    try:
        call(
            "gazebo/spawn_sdf_model",
            SpawnModel,
            SpawnModelRequest(
                model_name=request.name, model_xml=xml, initial_pose=pose, reference_frame=request.reference_frame
            ),
        )
        try:
            # After this request, the map of types notices the deletion of the object in the simulation.
            call_without_check("get_object_type", srv.GetGazeboType, srv.GetGazeboTypeRequest(object_name=request.name))
            call("update_acm_entry", srv.UpdateACMEntry, _acm(srv.UpdateACMEntryRequest.ADD_ENTRY, request.name))
        except RefusedError:
            _undo("gazebo/delete_model", DeleteModel, DeleteModelRequest(model_name=request.name))
            raise
    except RefusedError:
        _undo(
            "delete_gazebo_mapping", srv.DeleteGazeboMapping, srv.DeleteGazeboMappingRequest(object_name=request.name)
        )
        raise


def delete(request: ObjectRequest) -> None:
    """Deletes an object, including an object of the world file.

    A deletion in the simulation cannot be undone; therefore all services must exist before the first step. Objects of
    the world file are not in the map of types.

    Raises:
        RefusedError: A service is missing or refused.
    """
    _require(
        {
            "gazebo/delete_model": DeleteModel,
            "delete_gazebo_mapping": srv.DeleteGazeboMapping,
            "update_acm_entry": srv.UpdateACMEntry,
        }
    )
    mapping = srv.GetGazeboTypeRequest(object_name=request.name)
    was_spawned_here = call_without_check("get_object_type", srv.GetGazeboType, mapping).success
    call("gazebo/delete_model", DeleteModel, DeleteModelRequest(model_name=request.name))
    if was_spawned_here:  # the map may have removed the object already
        call_without_check(
            "delete_gazebo_mapping", srv.DeleteGazeboMapping, srv.DeleteGazeboMappingRequest(object_name=request.name)
        )
    call("update_acm_entry", srv.UpdateACMEntry, _acm(srv.UpdateACMEntryRequest.DELETE_ENTRY, request.name))


def _require(services: Mapping[str, Any]) -> None:
    """Waits for services, name -> type; raises RefusedError if a service is missing."""
    for name, service_type in services.items():
        try:
            wait_for_service(rospy.ServiceProxy(name, service_type), SERVICE_TIMEOUT_S)
        except CallError as error:
            raise RefusedError(f"nothing was changed: {error}") from error


def _acm(action: int, name: str) -> srv.UpdateACMEntryRequest:
    return srv.UpdateACMEntryRequest(action=action, entry_name=name)


def _undo(name: str, service_type: Any, request: Any) -> None:
    try:
        call(name, service_type, request)
    except RefusedError as error:
        rospy.logerr("manage_object: could not undo the earlier changes: %s", error)


def main() -> int:
    """Runs the node ``manage_object``.

    Parameters: ``gazebo_model_path``. Services called: ``add_gazebo_mapping``, ``get_object_type``,
    ``delete_gazebo_mapping``, ``gazebo/spawn_sdf_model``, ``gazebo/delete_model``, ``update_acm_entry``.

    Returns:
        Exit code: 0 for success, 1 if a service refused, 2 for invalid arguments.
    """
    rospy.init_node("manage_object", anonymous=True)
    try:
        request = parse_request(rospy.myargv(sys.argv)[1:], str(rospy.get_param("gazebo_model_path", "")))
        (delete if request.delete else spawn)(request)
    except ObjectRequestError as error:
        rospy.logfatal("manage_object: %s", error)
        return 2
    except RefusedError as error:
        rospy.logfatal("manage_object: %s", error)
        return 1
    rospy.loginfo("Object '%s' was %s.", request.name, "deleted" if request.delete else "spawned")
    return 0
