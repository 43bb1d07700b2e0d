# SPDX-License-Identifier: BSD-3-Clause
"""ROS 2's controller files and `<ros2_control>` tags as parameters of ros_control."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from launch.core.errors import LaunchError
from launch.core.parameter_plan import Lookup
from launch.core.screen_log import get_logger

from launch_ros.namespaces import full_name, join
from launch_ros.node_parameters import (
    DESCRIPTION,
    ParameterSource,
    merge,
    nest_dots,
    parameters_of_node,
    sections,
)
from launch_ros.parameter_descriptions import read_yaml_mapping

MANAGER = "controller_manager"
MOCK_PLUGINS = ("mock_components/GenericSystem", "fake_components/GenericSystem")
MOCK_TYPE = "modular_framework_control/MockRobotHW"
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
TRAJECTORY_TYPE = "joint_trajectory_controller/JointTrajectoryController"
FORWARD_TYPES = (
    "forward_command_controller/ForwardCommandController",
    "forward_command_controller/MultiInterfaceForwardCommandController",
)
TRAJECTORY_PACKAGES = {
    ("position",): "position_controllers",
    ("velocity",): "velocity_controllers",
    ("effort",): "effort_controllers",
    ("position", "velocity"): "pos_vel_controllers",
    ("acceleration", "position", "velocity"): "pos_vel_acc_controllers",
}
"""By command interfaces, in order: the package of ROS 1's trajectory controller."""
MOCK_INTERFACES = {
    ("position",): "PositionJointInterface",
    ("velocity",): "VelocityJointInterface",
    ("effort",): "EffortJointInterface",
    ("position", "velocity"): "PosVelJointInterface",
    ("acceleration", "position", "velocity"): "PosVelAccJointInterface",
}
"""By command interfaces, in order: the interface of the mock hardware."""


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
        if interfaces not in TRAJECTORY_PACKAGES:
            allowed = "; ".join(" ".join(each) for each in TRAJECTORY_PACKAGES)
            raise LaunchError(f"command_interfaces of a {type_name} are {list(interfaces)}; allowed: {allowed}")
        return f"{TRAJECTORY_PACKAGES[interfaces]}/JointTrajectoryController"
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
    if ros1["type"] == "joint_state_controller/JointStateController":
        ros1.setdefault("publish_rate", JOINT_STATE_RATE)
    return ros1


@dataclass(frozen=True, slots=True)
class Ros2ControlJoint:
    """A joint of a `<ros2_control>` tag.

    Attributes:
        name: Its name.
        command_interfaces: What it is commanded, in order; none for a joint that is only read.
        initial_position: Where it begins [rad|m].
    """

    name: str
    command_interfaces: tuple[str, ...]
    initial_position: float


@dataclass(frozen=True, slots=True)
class Ros2ControlHardware:
    """A `<ros2_control>` tag.

    Attributes:
        name: Its name.
        plugin: Its hardware.
        parameters: Parameters of the hardware.
        joints: Its joints.
    """

    name: str
    plugin: str
    parameters: Mapping[str, Any]
    joints: tuple[Ros2ControlJoint, ...]


def read_ros2_control(urdf: str) -> list[Ros2ControlHardware]:
    """Returns the `<ros2_control>` tags of a robot description.

    Raises:
        LaunchError: The description is no XML, or a tag names no hardware.
    """
    try:
        root = ElementTree.fromstring(urdf)
    except ElementTree.ParseError as error:
        raise LaunchError(f"{DESCRIPTION} is no XML: {error}") from None
    return [_hardware(tag) for tag in root.iter("ros2_control")]


def _hardware(tag: ElementTree.Element) -> Ros2ControlHardware:
    name = tag.get("name", "")
    plugin = (tag.findtext("hardware/plugin") or "").strip()
    if not plugin:
        raise LaunchError(
            f"{DESCRIPTION}: <ros2_control name='{name}'> has no <hardware><plugin>; allowed: {MOCK_PLUGINS[0]}, or "
            "package/Class of a RobotHW"
        )
    parameters = {
        each.get("name", ""): _number_or_text((each.text or "").strip()) for each in tag.findall("hardware/param")
    }
    joints = [_joint(each) for each in tag.findall("joint") if each.find("param[@name='mimic']") is None]
    return Ros2ControlHardware(name, plugin, parameters, tuple(joints))


def _joint(tag: ElementTree.Element) -> Ros2ControlJoint:
    name = tag.get("name", "")
    interfaces = tuple(sorted(each.get("name", "") for each in tag.findall("command_interface")))
    text = tag.findtext("state_interface[@name='position']/param[@name='initial_value']")
    text = text or tag.findtext("param[@name='initial_position']") or "0"
    try:
        return Ros2ControlJoint(name, interfaces, float(text))
    except ValueError:
        raise LaunchError(f"{DESCRIPTION}: <ros2_control>: initial value of joint '{name}' is '{text}'") from None


def _number_or_text(text: str) -> Any:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for number in (int, float):
        try:
            return number(text)
        except ValueError:
            continue
    return text


def hardware_parameters(
    lookup: Lookup, namespace: str, private: Mapping[str, Any], controllers: Mapping[str, Mapping[str, Any]]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Returns the parameters that tell the control node its hardware.

    It is what `<ros2_control>` in the robot's description names. Without such a tag it is mock hardware with the joints
    of the controllers. Where `type` or `robot_hardware` says it already, there is nothing to add.

    Args:
        lookup: Look-up of parameters.
        namespace: Namespace of the node.
        private: The node's own parameters.
        controllers: Controllers with their parameters.

    Returns:
        Parameters of the node, and of its namespace.

    Raises:
        LaunchError: There is neither description nor joint.
    """
    if "type" in private or lookup(full_name(namespace, "robot_hardware")) is not None:
        return {}, {}
    urdf = private.get(DESCRIPTION) or lookup(full_name(namespace, DESCRIPTION))
    if urdf is None:
        get_logger().warning("no parameter %s: limits of joints are not known", full_name(namespace, DESCRIPTION))
    described = [part for each in (read_ros2_control(urdf) if urdf else []) for part in _parts(each)]
    if not described:
        described = [_mock_of_controllers(controllers)]
    if len(described) == 1:
        return described[0][1], {}
    return {}, {"robot_hardware": [name for name, _ in described], **dict(described)}


def _parts(hardware: Ros2ControlHardware) -> list[tuple[str, dict[str, Any]]]:
    """Returns the hardware of ROS 1 for a tag, by name; mock hardware has one kind of command, so it may be several."""
    name = re.sub(r"\W", "_", hardware.name) or "hardware"
    if hardware.plugin not in MOCK_PLUGINS:
        joints = [joint.name for joint in hardware.joints]
        return [(name, {"type": hardware.plugin, "joints": joints, **hardware.parameters})]
    by_interfaces: dict[tuple[str, ...], list[Ros2ControlJoint]] = {}
    for joint in hardware.joints:
        by_interfaces.setdefault(joint.command_interfaces or ("position",), []).append(joint)
    several = len(by_interfaces) > 1
    parts = []
    for interfaces, members in by_interfaces.items():
        if interfaces not in MOCK_INTERFACES:
            allowed = "; ".join(" ".join(each) for each in MOCK_INTERFACES)
            raise LaunchError(
                f"{DESCRIPTION}: <ros2_control name='{hardware.name}'>: joint '{members[0].name}' has the command "
                f"interfaces {list(interfaces)}; allowed for mock hardware: {allowed}"
            )
        parts.append((f"{name}_{'_'.join(interfaces)}" if several else name, _mock(members, interfaces)))
    return parts


def _mock(joints: Iterable[Ros2ControlJoint], interfaces: tuple[str, ...]) -> dict[str, Any]:
    members = list(joints)
    return {
        "type": MOCK_TYPE,
        "joints": [joint.name for joint in members],
        "initial_positions": {joint.name: joint.initial_position for joint in members},
        "command_interface": MOCK_INTERFACES[interfaces],
    }


def _mock_of_controllers(controllers: Mapping[str, Mapping[str, Any]]) -> tuple[str, dict[str, Any]]:
    names: dict[str, None] = {}
    for parameters in controllers.values():
        single = [parameters["joint"]] if isinstance(parameters.get("joint"), str) else []
        names |= dict.fromkeys([*parameters.get("joints", ()), *single])
    if not names:
        raise LaunchError(
            "the hardware is not known: the robot description has no <ros2_control> tag, and no controller names a "
            "joint; add one of them"
        )
    get_logger().warning(
        "the robot description has no <ros2_control> tag: mock hardware for the joints of the controllers: %s",
        ", ".join(names),
    )
    return "mock", _mock([Ros2ControlJoint(name, ("position",), 0.0) for name in names], ("position",))
