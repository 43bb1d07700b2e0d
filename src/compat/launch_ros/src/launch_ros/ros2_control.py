# SPDX-License-Identifier: BSD-3-Clause
"""Converts ROS 2's controller files to ros_control."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from launch.core.errors import LaunchError
from launch.core.screen_log import get_logger

from launch_ros.namespaces import full_name, join
from launch_ros.node_parameters import (
    WILDCARDS,
    ParameterSource,
    merge,
    nest_dots,
    parameters_of_node,
    sections,
)
from launch_ros.parameter_descriptions import read_yaml_mapping

MANAGER = "controller_manager"
JOINT_STATE_RATE = 50.0
"""Default rate of joint states [Hz]."""
CONTROLLER_TYPES = {
    "joint_state_broadcaster/JointStateBroadcaster": "joint_state_controller/JointStateController",
    "parallel_gripper_action_controller/GripperActionController": "position_controllers/GripperActionController",
    "imu_sensor_broadcaster/IMUSensorBroadcaster": "imu_sensor_controller/ImuSensorController",
    "force_torque_sensor_broadcaster/ForceTorqueSensorBroadcaster": (
        "force_torque_sensor_controller/ForceTorqueSensorController"
    ),
}
"""ROS 1 names of ROS 2 controller types; `ros1_type` converts types that depend on command interfaces."""
NO_TIME_LIMIT_S = 1e9
"""Value of `goal_time` in ros_control for a goal without a time limit [s]."""
TRAJECTORY_TYPE = "joint_trajectory_controller/JointTrajectoryController"
FORWARD_TYPES = (
    "forward_command_controller/ForwardCommandController",
    "forward_command_controller/MultiInterfaceForwardCommandController",
)


@dataclass(frozen=True, slots=True)
class JointCommands:
    """Names in ros_control for joints with a set of command interfaces.

    Attributes:
        interface: Hardware interface of the joints.
        package: Package of the trajectory controller.
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
"""Names in ros_control, by sorted ROS 2 command interfaces of a joint."""
CONVERTED_PARAMETERS = (
    "command_interfaces",
    "state_interfaces",
    "interface_name",
    "interpolate_from_desired_state",
    "open_loop_control",
)
"""Parameters of ROS 2 controllers that select the type and the constraints in ROS 1. With `open_loop_control`, now
`interpolate_from_desired_state`, motions start at the last commanded positions, as always in ROS 1."""
ROS1_TRAJECTORY_VALUES = {
    "allow_integration_in_goal_trajectories": False,
    "allow_nonzero_velocity_at_trajectory_end": True,
    "cmd_timeout": 0.0,
    "interpolation_method": "splines",
    "set_last_command_interface_value_as_state_on_activation": True,
}
"""Parameters of ROS 2's trajectory controller that ROS 1 does not have, with the values that describe ROS 1."""


def source_of(path: str) -> ParameterSource:
    """Returns the contents of a parameter file."""
    return ParameterSource(read_yaml_mapping(Path(path)), Path(path))


def namespace_of_manager(manager: str, base: str) -> str:
    """Returns the namespace of a controller manager's services from the name in ROS 2's spawner.

    Args:
        manager: Name of the manager's node, such as `/robot/controller_manager`.
        base: Namespace of relative names.
    """
    return join(base, manager.rstrip("/").rpartition("/")[0] or ("/" if manager.startswith("/") else None))


def ros1_type(type_name: str, parameters: Mapping[str, Any]) -> str:
    """Returns the ROS 1 name of a controller type; types that are not specific to ROS 2 are not changed.

    Args:
        type_name: Controller type.
        parameters: Parameters of the controller.

    Raises:
        LaunchError: ROS 1 has no controller for the command interfaces.
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
    """Returns the controller manager's own parameters, without its controllers.

    Args:
        sources: Entries of the node's `parameters`.
        namespace: Namespace of the node.
        name: Name of the node.
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


def controller_parameters(
    sources: Iterable[ParameterSource], given_types: Mapping[str, str] | None = None
) -> dict[str, dict[str, Any]]:
    """Returns the controllers with their parameters, converted to ROS 1.

    A ROS 2 file lists the controllers and types in the controller manager's section and has a section per controller,
    which may contain the type instead; a ROS 1 file has a mapping with a type per controller.

    Args:
        sources: Parameter files of the controllers.
        given_types: Types that replace types in the files, keyed by name of a controller with a section.
    """
    types: dict[str, str] = {}
    found: dict[str, dict[str, Any]] = {}
    for source in sources:
        if not source.has_sections:
            named = {key: value for key, value in source.content.items() if _is_controller(value)}
            found |= {name: nest_dots(value) for name, value in named.items()}
            types |= {name: str(value["type"]) for name, value in named.items()}
            continue
        for pattern, values in sorted(sections(source.content), key=lambda each: "*" not in each[0]):
            inner = nest_dots(values)
            name = pattern.rpartition("/")[2]
            own = {key: value for key, value in inner.items() if _is_controller(value)}
            types |= {key: str(value["type"]) for key, value in own.items()}
            if _is_controller(inner):
                types.setdefault(name, str(inner["type"]))
            if not own and name not in WILDCARDS:
                merge(found.setdefault(name, {}), inner)
    types |= {name: type_name for name, type_name in (given_types or {}).items() if name in found}
    for name, parameters in found.items():
        if types.get(name) == TRAJECTORY_TYPE:
            _warn_of_other_values(name, parameters)
    return {name: _ros1_parameters(found.get(name, {}), type_name) for name, type_name in types.items()}


def _warn_of_other_values(name: str, parameters: Mapping[str, Any]) -> None:
    """Logs the parameters of a trajectory controller whose values ROS 1 does not have."""
    for key, value in (ROS1_TRAJECTORY_VALUES | {"command_joints": parameters.get("joints")}).items():
        if parameters.get(key, value) not in (value, []):
            get_logger().warning(
                "controller %s: %s %s has no effect; ROS 1 always has %s", name, key, parameters[key], value
            )


def _is_controller(value: Any) -> bool:
    return isinstance(value, Mapping) and isinstance(value.get("type"), str) and "/" in value["type"]


def _ros1_parameters(parameters: Mapping[str, Any], type_name: str) -> dict[str, Any]:
    ros1 = {name: value for name, value in parameters.items() if name not in CONVERTED_PARAMETERS}
    ros1["type"] = ros1_type(type_name, parameters)
    if type_name == TRAJECTORY_TYPE:
        for name in (*ROS1_TRAJECTORY_VALUES, "command_joints"):
            ros1.pop(name, None)
        ros1 |= _ros1_trajectory_parameters(parameters)
    if ros1["type"] == "joint_state_controller/JointStateController":
        ros1.setdefault("publish_rate", JOINT_STATE_RATE)
        if isinstance(ros1.get("extra_joints"), list):  # ROS 2 has names, ROS 1 mappings
            ros1["extra_joints"] = [{"name": each} if isinstance(each, str) else each for each in ros1["extra_joints"]]
    return ros1


def _ros1_trajectory_parameters(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Converts the parameters of ROS 2's trajectory controller that have another name or meaning in ROS 1."""
    constraints = dict(parameters.get("constraints", {}))
    if not constraints.get("goal_time"):
        constraints["goal_time"] = NO_TIME_LIMIT_S
    if "velocity" not in parameters.get("state_interfaces", ("position", "velocity")):
        constraints["stopped_velocity_tolerance"] = 0.0  # an unavailable velocity is not checked
    gains = {joint: dict(values) for joint, values in parameters.get("gains", {}).items()}
    for values in gains.values():
        values.pop("angle_wraparound", None)  # ROS 1 takes this from the joint's type
    feed_forward = {
        joint: values.pop("ff_velocity_scale") for joint, values in gains.items() if "ff_velocity_scale" in values
    }
    return {"constraints": constraints} | ({"gains": gains, "velocity_ff": feed_forward} if gains else {})
