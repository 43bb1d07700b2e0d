# SPDX-License-Identifier: BSD-3-Clause
"""The hardware of a robot for ros_control: what `<ros2_control>` in its description names, or mock hardware."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from launch.core.errors import LaunchError
from launch.core.parameter_plan import Lookup
from launch.core.screen_log import get_logger

from launch_ros.namespaces import full_name
from launch_ros.node_parameters import DESCRIPTION
from modular_framework_urdf import xml_text
from modular_framework_urdf.robot import Joint
from modular_framework_urdf.srdf_reader import read_srdf
from modular_framework_urdf.urdf_reader import read_urdf

MOCK_PLUGINS = ("mock_components/GenericSystem", "fake_components/GenericSystem")
MOCK_TYPE = "modular_framework_control/MockRobotHW"
SINGLE_AXIS = ("revolute", "continuous", "prismatic")
"""Kinds of joints that controllers move."""
MOCK_INTERFACES = {
    ("position",): "PositionJointInterface",
    ("velocity",): "VelocityJointInterface",
    ("effort",): "EffortJointInterface",
    ("position", "velocity"): "PosVelJointInterface",
    ("acceleration", "position", "velocity"): "PosVelAccJointInterface",
}
"""By command interfaces, in order: the interface of the mock hardware."""


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
        root = xml_text.parse(urdf, DESCRIPTION)
    except xml_text.XmlError as error:
        raise LaunchError(str(error)) from None
    return [_hardware(tag) for tag in root.iter("ros2_control")]


def _hardware(tag: xml_text.Element) -> Ros2ControlHardware:
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


def _joint(tag: xml_text.Element) -> Ros2ControlJoint:
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
    """Returns the parameters of the control node that describe its hardware.

    It is what `<ros2_control>` in the robot's description names. Without such a tag it is mock hardware with all joints
    of the robot that can be moved, in the first state of each group that the SRDF names. Where `type` or
    `robot_hardware` says it already, there is nothing to add.

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
    described = [part for each in (read_ros2_control(urdf) if urdf else []) for part in _parts(each)]
    if not described:
        joints = _joints_of_description(urdf, lookup(full_name(namespace, f"{DESCRIPTION}_semantic"))) if urdf else []
        described = [("mock", _mock(joints or _joints_of_controllers(controllers), ("position",)))]
        get_logger().warning(
            "the robot description has no <ros2_control> tag: mock hardware for %s",
            ", ".join(described[0][1]["joints"]),
        )
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


def _joints_of_description(urdf: str, srdf: str | None) -> list[Ros2ControlJoint]:
    """Returns the joints that can be moved; each begins as its first group state, or as near to 0 as it may."""
    states: dict[str, float] = {}
    for of_group in (read_srdf(srdf).group_states if srdf else {}).values():
        for positions in of_group.values():
            states = {**positions, **states}
    moved = [joint for joint in read_urdf(urdf).joints if joint.kind in SINGLE_AXIS and joint.mimic is None]
    return [Ros2ControlJoint(each.name, ("position",), states.get(each.name, _nearest_to_0(each))) for each in moved]


def _nearest_to_0(joint: Joint) -> float:
    if joint.limit is None or joint.kind == "continuous":
        return 0.0
    return min(max(0.0, joint.limit.lower), joint.limit.upper)


def _joints_of_controllers(controllers: Mapping[str, Mapping[str, Any]]) -> list[Ros2ControlJoint]:
    names: dict[str, None] = {}
    for parameters in controllers.values():
        single = [parameters["joint"]] if isinstance(parameters.get("joint"), str) else []
        names |= dict.fromkeys([*parameters.get("joints", ()), *single])
    if not names:
        raise LaunchError(
            f"the hardware is not known: there is no parameter {DESCRIPTION}, and no controller names a joint; give "
            "the description to a node of this namespace, or name joints"
        )
    return [Ros2ControlJoint(name, ("position",), 0.0) for name in names]
