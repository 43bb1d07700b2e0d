# SPDX-License-Identifier: BSD-3-Clause
"""The hardware of a robot for ros_control: what `<ros2_control>` in its description names, or mock hardware."""

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
"""Kinds of joints that controllers move."""


@dataclass(frozen=True, slots=True)
class HardwarePlan:
    """How the control node gets its hardware.

    Attributes:
        parameters: Parameters of the node.
        around: Parameters of its namespace.
        simulated: Whether the simulation is to run in its place: world, robot, controllers and clock are one program.
    """

    parameters: Mapping[str, Any] = field(default_factory=dict)
    around: Mapping[str, Any] = field(default_factory=dict)
    simulated: bool = False


def hardware_plan(
    lookup: Lookup, namespace: str, private: Mapping[str, Any], controllers: Mapping[str, Mapping[str, Any]]
) -> HardwarePlan:
    """Returns the hardware of the control node: what `<ros2_control>` in the robot's description names.

    Without such a tag it is mock hardware with all joints of the robot that can be moved, in the first state of each
    group that the SRDF names. Where `type` or `robot_hardware` says it already, there is nothing to add.

    Args:
        lookup: Look-up of parameters.
        namespace: Namespace of the node.
        private: The node's own parameters.
        controllers: Controllers with their parameters.

    Raises:
        LaunchError: There is neither description nor joint, or the hardware cannot be had together.
    """
    if "type" in private or lookup(full_name(namespace, "robot_hardware")) is not None:
        return HardwarePlan()
    urdf = private.get(DESCRIPTION) or lookup(full_name(namespace, DESCRIPTION))
    try:
        tags = read_ros2_control(urdf, DESCRIPTION) if urdf else ()
    except xml_text.XmlError as error:
        raise LaunchError(str(error)) from None
    if any(tag.simulated for tag in tags):
        return _simulation(tags, namespace)
    described = [part for tag in tags for part in _parts(tag)]
    if not described:
        joints = _joints_of_description(urdf, lookup(full_name(namespace, f"{DESCRIPTION}_semantic"))) if urdf else []
        described = [("mock", _mock(joints or _joints_of_controllers(controllers), ("position",)))]
        get_logger().warning(
            "the robot description has no <ros2_control> tag: mock hardware for %s",
            ", ".join(described[0][1]["joints"]),
        )
    if len(described) == 1:
        return HardwarePlan(parameters=described[0][1])
    return HardwarePlan(around={"robot_hardware": [name for name, _ in described], **dict(described)})


def _simulation(tags: Iterable[Ros2ControlHardware], namespace: str) -> HardwarePlan:
    """Returns the simulation, which reads joints and initial positions from the description by itself."""
    others = [tag for tag in tags if not tag.simulated]
    if others:
        raise LaunchError(
            f"{DESCRIPTION}: <ros2_control name='{others[0].name}'> is {others[0].plugin} beside simulated hardware; "
            "allowed: all of it simulated, or none, because the clock of a simulation is not that of other hardware"
        )
    if namespace != "/":
        raise LaunchError(
            f"a control node in namespace {namespace} has simulated hardware; allowed: namespace /, because the "
            f"simulation has one robot, /{DESCRIPTION}"
        )
    return HardwarePlan({name: value for tag in tags for name, value in tag.parameters.items()}, simulated=True)


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
