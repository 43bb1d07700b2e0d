# SPDX-License-Identifier: BSD-3-Clause
"""Determines the hardware of a robot for ros_control, from `<ros2_control>` in its description or as mock hardware."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from launch.core.errors import LaunchError
from launch.core.parameter_plan import Lookup
from launch.core.screen_log import get_logger

from launch_ros.namespaces import full_name
from launch_ros.node_parameters import DESCRIPTION
from launch_ros.ros2_control import JOINT_COMMANDS
from modular_framework_urdf import xml_text
from modular_framework_urdf.robot import Joint
from modular_framework_urdf.ros2_control import (
    MOCK_PLUGINS,
    Ros2ControlHardware,
    Ros2ControlJoint,
    read_ros2_control,
)
from modular_framework_urdf.srdf_reader import read_srdf
from modular_framework_urdf.urdf_reader import read_urdf

MOCK_TYPE = "modular_framework_control/MockRobotHW"
SINGLE_AXIS = ("revolute", "continuous", "prismatic")
"""Types of joints that controllers move."""


@dataclass(frozen=True, slots=True)
class HardwarePlan:
    """Hardware of a control node.

    Attributes:
        parameters: Parameters of the node.
        namespace_parameters: Parameters of the node's namespace.
        simulated: Whether the simulation replaces the node, as it contains world, robot, controllers and clock.
    """

    parameters: Mapping[str, Any] = field(default_factory=dict)
    namespace_parameters: Mapping[str, Any] = field(default_factory=dict)
    simulated: bool = False


def hardware_plan(
    lookup: Lookup, namespace: str, private: Mapping[str, Any], controllers: Mapping[str, Mapping[str, Any]]
) -> HardwarePlan:
    """Returns the hardware of a control node, as named by `<ros2_control>` in the robot description.

    Without this tag, the hardware is mock hardware with all movable joints, initially in the first state of each group
    in the SRDF. If `type` or `robot_hardware` already defines the hardware, nothing is added.

    Args:
        lookup: Parameter lookup.
        namespace: Namespace of the node.
        private: Parameters of the node.
        controllers: Parameters of the controllers, by name.

    Raises:
        LaunchError: Neither a description nor a joint is given, or the hardware cannot be combined.
    """
    if "type" in private or lookup(full_name(namespace, "robot_hardware")) is not None:
        return HardwarePlan()
    urdf = private.get(DESCRIPTION) or lookup(full_name(namespace, DESCRIPTION))
    try:
        tags = read_ros2_control(urdf, DESCRIPTION) if urdf else ()
    except xml_text.XmlError as error:
        raise LaunchError(str(error)) from None
    if any(tag.is_simulated for tag in tags):
        return _simulation(tags, namespace)
    described = [part for tag in tags for part in _hardware_parts(tag)]
    if not described:
        joints = _joints_of_description(urdf, lookup(full_name(namespace, f"{DESCRIPTION}_semantic"))) if urdf else []
        described = [("mock", _mock(joints or _joints_of_controllers(controllers), ("position",)))]
        get_logger().warning(
            "the robot description has no <ros2_control> tag; using mock hardware for %s",
            ", ".join(described[0][1]["joints"]),
        )
    if len(described) == 1:
        return HardwarePlan(parameters=described[0][1])
    return HardwarePlan(namespace_parameters={"robot_hardware": [name for name, _ in described], **dict(described)})


def _simulation(tags: Iterable[Ros2ControlHardware], namespace: str) -> HardwarePlan:
    """Returns the simulation, which reads joints and initial positions from the description itself."""
    others = [tag for tag in tags if not tag.is_simulated]
    if others:
        raise LaunchError(
            f"{DESCRIPTION}: <ros2_control name='{others[0].name}'> is {others[0].plugin} beside simulated hardware; "
            "allowed: only simulated hardware, or none, because other hardware does not follow the simulation's clock"
        )
    if namespace != "/":
        raise LaunchError(
            f"a control node in namespace {namespace} has simulated hardware; allowed: namespace /, because the "
            f"simulation has a single robot, /{DESCRIPTION}"
        )
    return HardwarePlan({name: value for tag in tags for name, value in tag.parameters.items()}, simulated=True)


def _hardware_parts(hardware: Ros2ControlHardware) -> list[tuple[str, dict[str, Any]]]:
    """Returns the ROS 1 hardware of a tag, by name; mock hardware is split, because it has one command interface."""
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
        if interfaces not in JOINT_COMMANDS:
            allowed = "; ".join(" ".join(each) for each in JOINT_COMMANDS)
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
        "command_interface": JOINT_COMMANDS[interfaces].interface,
    }


def _joints_of_description(urdf: str, srdf: str | None) -> list[Ros2ControlJoint]:
    """Returns the movable joints, initially in their first group state, or at the allowed position nearest to 0."""
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
            f"the hardware is unknown: the parameter {DESCRIPTION} is not set, and no controller has joints; set the "
            "description for a node of this namespace, or add joints to a controller"
        )
    return [Ros2ControlJoint(name, ("position",), 0.0) for name in names]
