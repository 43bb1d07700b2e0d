# SPDX-License-Identifier: BSD-3-Clause
"""Adds an object to the simulation or removes it, in all places or in none.

The simulation, the map of object types and the collision matrix must agree on which objects exist. When one of them
refuses, what was done before is undone, and the exit code says so.
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
    """A service refused; the text says which and why."""


def call(name: str, service_type: Any, request: Any, refusal: str = "its node logged the reason") -> Any:
    """Calls a service.

    Args:
        name: Name of the service.
        service_type: Its type.
        request: Its request.
        refusal: What it means when the service refuses without a reason.

    Returns:
        The answer.

    Raises:
        RefusedError: It is absent, fails, or answers without success.
    """
    answer = ask(name, service_type, request)
    if not answer.success:
        text = getattr(answer, "status_message", "") or refusal
        raise RefusedError(f"service '{rospy.resolve_name(name)}' refused: {text}")
    return answer


def ask(name: str, service_type: Any, request: Any) -> Any:
    """Calls a service whose refusal is no error.

    Raises:
        RefusedError: It is absent or fails.
    """
    try:
        return request_service(name, service_type, request, SERVICE_TIMEOUT_S)
    except CallError as error:
        raise RefusedError(str(error)) from error


def spawn(request: ObjectRequest) -> None:
    """Spawns an object, or leaves everything as it was.

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
        f"there is an object '{request.name}' already; choose another name (-n), or delete that one first",
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
            # The map of types learns that the simulation has the object, and forgets it when it is deleted there.
            ask("get_object_type", srv.GetGazeboType, srv.GetGazeboTypeRequest(object_name=request.name))
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
    """Deletes an object, also one that came with the world file; or leaves everything as it was.

    The simulation decides whether the object exists: only objects that were spawned here are in the map of types. What
    was deleted there cannot be put back as it was, so all services have to be there before.

    Raises:
        RefusedError: A service is absent or refused.
    """
    _require(
        {
            "gazebo/delete_model": DeleteModel,
            "delete_gazebo_mapping": srv.DeleteGazeboMapping,
            "update_acm_entry": srv.UpdateACMEntry,
        }
    )
    mapping = srv.GetGazeboTypeRequest(object_name=request.name)
    was_spawned_here = ask("get_object_type", srv.GetGazeboType, mapping).success
    call("gazebo/delete_model", DeleteModel, DeleteModelRequest(model_name=request.name))
    if was_spawned_here:  # the map may have noticed by itself that the object is gone
        ask("delete_gazebo_mapping", srv.DeleteGazeboMapping, srv.DeleteGazeboMappingRequest(object_name=request.name))
    call("update_acm_entry", srv.UpdateACMEntry, _acm(srv.UpdateACMEntryRequest.DELETE_ENTRY, request.name))


def _require(services: Mapping[str, Any]) -> None:
    """Waits for services, given with their types; raises RefusedError where one is absent."""
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
        rospy.logerr("manage_object: could not take back what was done: %s", error)


def main() -> int:
    """Runs once.

    Parameters: ``gazebo_model_path``. Services called: ``add_gazebo_mapping``, ``get_object_type``,
    ``delete_gazebo_mapping``, ``gazebo/spawn_sdf_model``, ``gazebo/delete_model``, ``update_acm_entry``.

    Returns:
        0 when done, 1 when a service refused, 2 when the arguments make no sense.
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
