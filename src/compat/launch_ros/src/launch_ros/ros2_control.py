# SPDX-License-Identifier: BSD-3-Clause
"""ROS 2's controller files in the words of ros_control."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from launch.core.errors import LaunchError

from launch_ros.namespaces import full_name, join
from launch_ros.node_parameters import (
    ParameterSource,
    merge,
    nest_dots,
    parameters_of_node,
    sections,
)
from launch_ros.parameter_descriptions import read_yaml_mapping

MANAGER = "controller_manager"
JOINT_STATE_RATE = 50.0
"""Rate of joint states [1/s] when the file names none."""
CONTROLLER_TYPES = {
    "joint_state_broadcaster/JointStateBroadcaster": "joint_state_controller/JointStateController",
    "parallel_gripper_action_controller/GripperActionController": "position_controllers/GripperActionController",
    "imu_sensor_broadcaster/IMUSensorBroadcaster": "imu_sensor_controller/ImuSensorController",
    "force_torque_sensor_broadcaster/ForceTorqueSensorBroadcaster": (
        "force_torque_sensor_controller/ForceTorqueSensorController"
    ),
}
"""Types of ROS 2 that have one other name on ROS 1; those that depend on interfaces are in `ros1_type`."""
NO_TIME_LIMIT_S = 1e9
"""`goal_time` of ros_control for a goal that may be reached at any time after its end [s]."""
TRAJECTORY_TYPE = "joint_trajectory_controller/JointTrajectoryController"
FORWARD_TYPES = (
    "forward_command_controller/ForwardCommandController",
    "forward_command_controller/MultiInterfaceForwardCommandController",
)


@dataclass(frozen=True, slots=True)
class JointCommands:
    """The words of ros_control for joints that take certain commands.

    Attributes:
        interface: Their hardware interface.
        package: Package of their trajectory controller.
    """

    interface: str
    package: str


JOINT_COMMANDS = {
    ("position",): JointCommands("PositionJointInterface", "position_controllers"),
    ("velocity",): JointCommands("VelocityJointInterface", "velocity_controllers"),
    ("effort",): JointCommands("EffortJointInterface", "effort_controllers"),
    ("position", "velocity"): JointCommands("PosVelJointInterface", "pos_vel_controllers"),
    ("acceleration", "position", "velocity"): JointCommands("PosVelAccJointInterface", "pos_vel_acc_controllers"),
}
"""By ROS 2's command interfaces of a joint, in order."""


def source_of(path: str) -> ParameterSource:
    """Returns what a parameter file holds."""
    return ParameterSource(read_yaml_mapping(Path(path)), Path(path))


def namespace_of_manager(manager: str, around: str) -> str:
    """Returns the namespace of a controller manager's services, from the name ROS 2's spawner takes.

    Args:
        manager: Name of the manager's node, `/robot/controller_manager`.
        around: Namespace for a relative name.
    """
    return join(around, manager.rstrip("/").rpartition("/")[0] or ("/" if manager.startswith("/") else None))


def ros1_type(type_name: str, parameters: Mapping[str, Any]) -> str:
    """Returns ROS 1's name of a controller type; a type that is not of ROS 2 stays as it is.

    Args:
        type_name: The type.
        parameters: Parameters of the controller.

    Raises:
        LaunchError: ROS 1 has no controller for these command interfaces.
    """
    if type_name == TRAJECTORY_TYPE:
        interfaces = tuple(sorted(parameters.get("command_interfaces", ["position"])))
        if interfaces not in JOINT_COMMANDS:
            allowed = "; ".join(" ".join(each) for each in JOINT_COMMANDS)
            raise LaunchError(f"command_interfaces of a {type_name} are {list(interfaces)}; allowed: {allowed}")
        return f"{JOINT_COMMANDS[interfaces].package}/JointTrajectoryController"
    if type_name in FORWARD_TYPES:
        interface = str(parameters.get("interface_name", "position"))
        return f"{interface}_controllers/JointGroup{interface.capitalize()}Controller"
    return CONTROLLER_TYPES.get(type_name, type_name)


def manager_parameters(sources: Sequence[ParameterSource], namespace: str, name: str) -> dict[str, Any]:
    """Returns what entries give to the controller manager itself, without its controllers.

    Args:
        sources: Entries of its `parameters`.
        namespace: Its namespace.
        name: Its name.
    """
    private: dict[str, Any] = {}
    for source in sources:
        names = {full_name(namespace, name), full_name(namespace, MANAGER), f"/{MANAGER}"}
        given: dict[str, Any] = {}
        for node in sorted(names):
            merge(given, parameters_of_node([source], node))
        merge(private, {key: value for key, value in given.items() if not _is_controller(value)})
    if "update_rate" in private:
        private["rate"] = float(private.pop("update_rate"))
    return private


def controller_parameters(sources: Iterable[ParameterSource]) -> dict[str, dict[str, Any]]:
    """Returns the controllers that entries describe, with their parameters in the words of ROS 1.

    A file of ROS 2 names them and their types below the controller manager and has a section for each; a file of
    ROS 1 has a mapping with a type for each.
    """
    types: dict[str, str] = {}
    found: dict[str, dict[str, Any]] = {}
    for source in sources:
        if not source.has_sections:
            named = {key: value for key, value in source.content.items() if _is_controller(value)}
            found |= {name: nest_dots(value) for name, value in named.items()}
            types |= {name: str(value["type"]) for name, value in named.items()}
            continue
        for pattern, values in sections(source.content):
            inner = nest_dots(values)
            own = {key: value for key, value in inner.items() if _is_controller(value)}
            types |= {name: str(value["type"]) for name, value in own.items()}
            if not own and "*" not in pattern:
                merge(found.setdefault(pattern.rpartition("/")[2], {}), inner)
    return {name: _ros1_parameters(found.get(name, {}), type_name) for name, type_name in types.items()}


def _is_controller(value: Any) -> bool:
    return isinstance(value, Mapping) and isinstance(value.get("type"), str) and "/" in value["type"]


def _ros1_parameters(parameters: Mapping[str, Any], type_name: str) -> dict[str, Any]:
    ros1 = {**parameters, "type": ros1_type(type_name, parameters)}
    if type_name == TRAJECTORY_TYPE:
        ros1 |= _ros1_trajectory_parameters(parameters)
    if ros1["type"] == "joint_state_controller/JointStateController":
        ros1.setdefault("publish_rate", JOINT_STATE_RATE)
    return ros1


def _ros1_trajectory_parameters(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Returns what ROS 2's trajectory controller names otherwise, or means otherwise, than that of ROS 1.

    `open_loop_control` needs no translation: a motion of ROS 1 begins where the one before it commands the joints.
    """
    constraints = dict(parameters.get("constraints", {}))
    if not constraints.get("goal_time"):
        constraints["goal_time"] = NO_TIME_LIMIT_S
    if "velocity" not in parameters.get("state_interfaces", ("position", "velocity")):
        constraints["stopped_velocity_tolerance"] = 0.0  # a velocity that is not read is not checked
    gains = {joint: dict(values) for joint, values in parameters.get("gains", {}).items()}
    feed_forward = {
        joint: values.pop("ff_velocity_scale") for joint, values in gains.items() if "ff_velocity_scale" in values
    }
    return {"constraints": constraints} | ({"gains": gains, "velocity_ff": feed_forward} if gains else {})
