# SPDX-License-Identifier: BSD-3-Clause
"""Tool spawn_model, a client of the simulation's services."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import rospy
from gazebo_msgs import srv
from std_srvs.srv import Empty

from modular_framework_ros.calls import is_advertised
from modular_framework_ros.start_up import start_timeout, wait_for_start
from modular_framework_simulation.gazebo_ros import conversions, ros_names
from modular_framework_simulation.gazebo_ros.spawn_model_command import (
    Format,
    Source,
    SpawnCommand,
    parse_spawn_command,
)
from modular_framework_urdf import xml_text

_PACKAGE_SCHEME, _MODEL_SCHEME = "package://", "model://"


class SpawnError(Exception):
    """The model was not spawned."""


def main() -> int:
    """Runs the tool.

    Returns:
        Exit code: 0 if all requests succeeded, 1 otherwise.
    """
    command = parse_spawn_command(rospy.myargv()[1:])
    rospy.init_node("spawn_model", anonymous=True)
    try:
        _spawn(command)
    except (SpawnError, rospy.ROSException, rospy.ServiceException, OSError) as error:
        rospy.logerr("spawn_model: %s", error)
        return 1
    if command.bond:
        rospy.core.add_preshutdown_hook(lambda _reason: _delete(command))
        rospy.loginfo("spawn_model: '%s' is deleted when this program ends", command.model)
        rospy.spin()
    return 0


def _delete(command: SpawnCommand) -> None:
    """Deletes the model without waiting, because the simulation may have ended."""
    name = ros_names.in_namespace(ros_names.DELETE_MODEL, command.gazebo_namespace)
    try:
        response = rospy.ServiceProxy(name, srv.DeleteModel)(command.model)
    except (rospy.ROSException, rospy.ServiceException, OSError) as error:
        rospy.logerr("spawn_model: '%s' was not deleted: %s", command.model, error)
        return
    if not response.success:
        rospy.logerr("spawn_model: '%s' was not deleted: %s", command.model, response.status_message)


def _spawn(command: SpawnCommand) -> None:
    if command.wait_for:
        _wait_for_model(command)
    text = _description(command)
    if command.package_to_model:
        text = package_to_model(text, command.source_name or command.source.value)
    if command.namespace.strip("/"):
        rospy.logwarn(
            "spawn_model: -robot_namespace %s applies to sensors only; the controllers are those of the robot that "
            "the simulation was started with",
            command.namespace,
        )
    name = ros_names.SPAWN_SDF_MODEL if command.format is Format.SDF else ros_names.SPAWN_URDF_MODEL
    pose = conversions.pose_to_msg(command.pose)
    response = _call(
        command, name, srv.SpawnModel, command.model, text, command.namespace, pose, command.reference_frame
    )
    rospy.loginfo("spawn_model: %s", response.status_message)
    if command.joints:
        joints, values = list(command.joints), list(command.joints.values())
        parameter = command.source_name if command.source is Source.PARAM else ""
        _call(
            command,
            ros_names.SET_MODEL_CONFIGURATION,
            srv.SetModelConfiguration,
            command.model,
            parameter,
            joints,
            values,
        )
    if command.unpause:
        _call(command, ros_names.UNPAUSE_PHYSICS, Empty)


def _description(command: SpawnCommand) -> str:
    match command.source:
        case Source.FILE:
            return _not_empty(Path(command.source_name).read_text(encoding="utf-8"), f"file {command.source_name}")
        case Source.STDIN:
            return _not_empty(sys.stdin.read(), "the standard input")
        case Source.DATABASE:
            return f"<sdf version='1.6'><include><uri>model://{command.source_name}</uri></include></sdf>"
        case Source.PARAM:
            text = rospy.get_param(command.source_name, None)
            if not isinstance(text, str):
                raise SpawnError(f"parameter {rospy.resolve_name(command.source_name)} is not a text; upload the model")
            return text


def _not_empty(text: str, source: str) -> str:
    if not text.strip():
        raise SpawnError(f"{source} is empty; give the description of a model")
    return text


def package_to_model(text: str, source: str) -> str:
    """Replaces package:// by model:// in the mesh URIs of a description, so that model folders are searched.

    Args:
        text: The description.
        source: Name of the description in messages.

    Raises:
        SpawnError: The description is not well-formed XML.
    """
    try:
        root = xml_text.parse(text, source)
    except xml_text.XmlError as error:
        raise SpawnError(str(error)) from error
    for mesh in root.iter("mesh"):
        uri = mesh.get("filename", "")
        if uri.startswith(_PACKAGE_SCHEME):
            mesh.set("filename", _MODEL_SCHEME + uri.removeprefix(_PACKAGE_SCHEME))
    return xml_text.to_text(root)


def _wait_for_model(command: SpawnCommand) -> None:
    name = ros_names.in_namespace(ros_names.GET_WORLD_PROPERTIES, command.gazebo_namespace)
    _wait_for_service(name)
    world = rospy.ServiceProxy(name, srv.GetWorldProperties)
    model = command.wait_for
    if not wait_for_start(lambda: model in world().model_names, f"model '{model}' of the simulation"):
        raise SpawnError(
            f"model '{model}' did not appear within {start_timeout():g} s (parameter /start_timeout); "
            "spawn it first, or correct the name after -wait"
        )


def _wait_for_service(name: str) -> None:
    if not wait_for_start(lambda: is_advertised(name), f"service '{name}' of the simulation"):
        raise SpawnError(
            f"service '{name}' was not advertised within {start_timeout():g} s (parameter "
            "/start_timeout); start the simulation"
        )


def _call(command: SpawnCommand, service: str, kind: Any, *values: Any) -> Any:
    name = ros_names.in_namespace(service, command.gazebo_namespace)
    _wait_for_service(name)
    response = rospy.ServiceProxy(name, kind)(*values)
    if not getattr(response, "success", True):
        raise SpawnError(response.status_message)
    return response
