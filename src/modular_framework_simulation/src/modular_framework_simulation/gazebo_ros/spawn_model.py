# SPDX-License-Identifier: BSD-3-Clause
"""The tool spawn_model: a client of the simulation's services."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import rospy
from gazebo_msgs import srv
from std_srvs.srv import Empty

from modular_framework_ros.start_up import start_timeout, wait_for_start
from modular_framework_simulation.gazebo_ros import conversions, ros_names
from modular_framework_simulation.gazebo_ros.spawn_model_command import (
    Format,
    Source,
    SpawnCommand,
    parse_spawn_command,
)


class SpawnError(Exception):
    """The model could not be spawned."""


def main() -> int:
    """Runs the tool.

    Returns:
        Exit code: 0 when everything asked for was done, 1 otherwise.
    """
    command = parse_spawn_command(rospy.myargv()[1:])
    rospy.init_node("spawn_model", anonymous=True)
    try:
        _spawn(command)
    except (SpawnError, rospy.ROSException, rospy.ServiceException, OSError) as error:
        rospy.logerr("spawn_model: %s", error)
        return 1
    if command.bond:
        rospy.on_shutdown(lambda: _call(ros_names.DELETE_MODEL, srv.DeleteModel, command.model))
        rospy.spin()
    return 0


def _spawn(command: SpawnCommand) -> None:
    text = _description(command)
    if command.wait_for:
        _wait_for_model(command.wait_for)
    name = ros_names.SPAWN_SDF_MODEL if command.format is Format.SDF else ros_names.SPAWN_URDF_MODEL
    pose = conversions.pose_to_msg(command.pose)
    answer = _call(name, srv.SpawnModel, command.model, text, command.namespace, pose, command.reference_frame)
    rospy.loginfo("spawn_model: %s", answer.status_message)
    if command.joints:
        joints, values = list(command.joints), list(command.joints.values())
        parameter = command.source_name if command.source is Source.PARAM else ""
        _call(ros_names.SET_MODEL_CONFIGURATION, srv.SetModelConfiguration, command.model, parameter, joints, values)
    if command.unpause:
        _call(ros_names.UNPAUSE_PHYSICS, Empty)


def _description(command: SpawnCommand) -> str:
    match command.source:
        case Source.FILE:
            return Path(command.source_name).read_text(encoding="utf-8")
        case Source.STDIN:
            return sys.stdin.read()
        case Source.DATABASE:
            return f"<sdf version='1.6'><include><uri>model://{command.source_name}</uri></include></sdf>"
        case Source.PARAM:
            text = rospy.get_param(command.source_name, None)
            if not isinstance(text, str):
                raise SpawnError(f"parameter {rospy.resolve_name(command.source_name)} holds no text; upload the model")
            return text


def _wait_for_model(model: str) -> None:
    _wait_for_service(ros_names.GET_WORLD_PROPERTIES)
    world = rospy.ServiceProxy(ros_names.GET_WORLD_PROPERTIES, srv.GetWorldProperties)
    if not wait_for_start(lambda: model in world().model_names, f"model '{model}' of the simulation"):
        raise SpawnError(
            f"model '{model}' did not appear within {start_timeout():g} s (parameter /start_timeout); "
            "spawn it first, or correct the name after -wait"
        )


def _wait_for_service(name: str) -> None:
    def advertised() -> bool:
        try:
            rospy.wait_for_service(name, 0.2)
        except rospy.ROSException:
            return False
        return True

    if not wait_for_start(advertised, f"service '{name}' of the simulation"):
        raise SpawnError(
            f"service '{name}' was not advertised within {start_timeout():g} s (parameter "
            "/start_timeout); start the simulation"
        )


def _call(name: str, kind: Any, *values: Any) -> Any:
    _wait_for_service(name)
    answer = rospy.ServiceProxy(name, kind)(*values)
    if not getattr(answer, "success", True):
        raise SpawnError(answer.status_message)
    return answer
