# SPDX-License-Identifier: BSD-3-Clause
"""Reads a robot's URDF for the simulation, and rewrites the URDF for the physics engine.

In the rewritten URDF, convex hulls replace the collision meshes. Visual shapes are removed unless they are drawn.
The engine then loads the robot and computes its contacts faster.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.sdf_specs import UNLIMITED_FRICTION, Mesh
from modular_framework_simulation.robots.robot_joint import RobotJoint, gripper_joints
from modular_framework_simulation.robots.robot_masses import give_masses, give_rotors
from modular_framework_urdf import xml_text
from modular_framework_urdf.lengths import MAX_LENGTH_M
from modular_framework_urdf.mesh_paths import PackageFinder, mesh_path
from modular_framework_urdf.mesh_reader import MeshError
from modular_framework_urdf.mimics import Mimic, resolve_mimics
from modular_framework_urdf.robot import Joint, Limit, Robot
from modular_framework_urdf.ros2_control import Ros2ControlJoint, read_ros2_control
from modular_framework_urdf.urdf_reader import AttributeFault, read_urdf
from modular_framework_urdf.xml_text import Element

COMMAND_INTERFACES = {
    "position": "hardware_interface/PositionJointInterface",
    "velocity": "hardware_interface/VelocityJointInterface",
    "effort": "hardware_interface/EffortJointInterface",
}
"""Hardware interfaces of ros_control, by command interface of ros2_control."""

MAX_MIMIC_LIMIT = 1e6
"""Magnitude of a mimic joint's limits if the leading joint has no limits [rad or m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotDescription:
    """Robot description for the simulation.

    Attributes:
        name: Name of the robot in the description.
        joints: Movable joints, in file order.
        gripper_joints: Joints of the grippers, in file order.
        links: Names of all links, in file order.
        parents: Parent link by child link.
        engine_urdf: URDF for the physics engine.
        initial_positions: Initial joint positions in the description [rad or m], by joint name.
        frictions: Friction coefficients (`<mu1>` of `<gazebo reference=...>`), by link name.
    """

    name: str
    joints: tuple[RobotJoint, ...]
    gripper_joints: tuple[RobotJoint, ...]
    links: tuple[str, ...]
    parents: dict[str, str]
    engine_urdf: str
    initial_positions: dict[str, float]
    frictions: dict[str, float]


def read_robot(
    text: str,
    find_package: PackageFinder,
    convex_parts: ConvexParts,
    with_visuals: bool,
    end_effector_joints: Collection[str] = (),
) -> RobotDescription:
    """Reads a robot description.

    Args:
        text: URDF text.
        find_package: Function that finds the packages of package:// URIs.
        convex_parts: Converter of collision meshes into convex hulls.
        with_visuals: Whether visual shapes are kept.
        end_effector_joints: Names of joints of grippers, beside the mimic joints and their leading joints.

    Raises:
        DescriptionError: The text is not a valid URDF, or refers to a missing file.
    """
    try:
        root, robot = xml_text.parse(text, "robot_description"), read_urdf(text)
    except AttributeFault as error:
        location = f"{error.location}: {error.owner}, <{error.tag} {error.key}=...>"
        raise DescriptionError(location, f"got '{error.text}'", f"expected {error.expected}") from error
    except xml_text.XmlError as error:
        raise DescriptionError(error.location, error.found, error.allowed) from error
    links = tuple(link.name for link in robot.links)
    if root.tag != "robot" or not links:
        raise DescriptionError("robot_description", f"<{root.tag}> with {len(links)} links", "expected a URDF <robot>")
    simulated = _simulated_joints(text, robot)
    interfaces = _interfaces(robot) | {joint.name: _commands(joint) for joint in simulated}
    _require_parent_and_child(robot)
    joints = _with_leaders(tuple(_joint(joint, interfaces.get(joint.name, ())) for joint in robot.movable_joints()))
    _set_limits(root, joints)
    give_masses(root, robot, find_package)
    grippers = gripper_joints(joints, end_effector_joints)
    give_rotors(root, grippers)
    _rewrite_meshes(root, find_package, convex_parts, with_visuals)
    parents = {joint.child: joint.parent for joint in robot.joints}
    followers = {joint.name for joint in robot.joints if joint.mimic is not None}
    initial = {joint.name: joint.initial_position for joint in simulated if joint.name not in followers}
    text = xml_text.to_text(root)
    return RobotDescription(
        name=root.get("name", "robot"),
        joints=joints,
        gripper_joints=grippers,
        links=links,
        parents=parents,
        engine_urdf=text,
        initial_positions=initial,
        frictions=_frictions(root),
    )


def _with_leaders(joints: tuple[RobotJoint, ...]) -> tuple[RobotJoint, ...]:
    """Resolves chains of mimic joints to their leading joints, and widens the limits to the leading joint's range.

    Gazebo's mimic plugins and MoveIt ignore the limits of mimic joints. Some public descriptions therefore have limits
    that forbid the relation (Robotiq 2F-85: multiplier -1, limits 0 to 0.88).
    """
    try:
        mimics = resolve_mimics(
            {joint.name: joint.mimic for joint in joints if joint.mimic is not None}, [joint.name for joint in joints]
        )
    except ValueError as error:
        location, _, problem = str(error).partition(": ")
        raise DescriptionError(f"robot_description: {location}", *problem.split("; ", 1)) from error
    by_name = {joint.name: joint for joint in joints}
    return tuple(
        _follower(joint, mimics[joint.name], by_name[mimics[joint.name].leader]) if joint.name in mimics else joint
        for joint in joints
    )


def _follower(joint: RobotJoint, mimic: Mimic, leader: RobotJoint) -> RobotJoint:
    lower, upper = mimic.range_of(leader.lower, leader.upper)
    effort = min(joint.effort, leader.effort / abs(mimic.multiplier))  # the leading joint's drive supplies the power
    return replace(joint, mimic=mimic, lower=min(joint.lower, lower), upper=max(joint.upper, upper), effort=effort)


def _set_limits(root: Element, joints: tuple[RobotJoint, ...]) -> None:
    """Writes the limits of mimic joints into the URDF."""
    mimics = {joint.name: joint for joint in joints if joint.mimic is not None}
    for element in root.findall("joint"):
        joint, limit = mimics.get(element.get("name", "")), element.find("limit")
        if joint is not None and limit is not None:
            limit.set("lower", repr(max(joint.lower, -MAX_MIMIC_LIMIT)))
            limit.set("upper", repr(min(joint.upper, MAX_MIMIC_LIMIT)))


def _interfaces(robot: Robot) -> dict[str, tuple[str, ...]]:
    """Returns the hardware interfaces of the transmissions, by joint name."""
    interfaces: dict[str, tuple[str, ...]] = {}
    for transmission in robot.transmissions:
        for joint in transmission.joints:
            if not joint.interfaces:
                location = (
                    f"robot_description:{joint.line}: <transmission name='{transmission.name}'>, joint '{joint.name}'"
                )
                raise DescriptionError(
                    location, "has no <hardwareInterface>", "add a position, velocity or effort interface"
                )
            interfaces[joint.name] = interfaces.get(joint.name, ()) + tuple(each.text for each in joint.interfaces)
    return interfaces


def _simulated_joints(text: str, robot: Robot) -> list[Ros2ControlJoint]:
    """Returns the joints of `<ros2_control>` tags with simulated hardware."""
    try:
        tags = read_ros2_control(text)
    except xml_text.XmlError as error:
        raise DescriptionError(error.location, error.found, error.allowed) from error
    movable = [joint.name for joint in robot.movable_joints()]
    joints = [joint for tag in tags if tag.is_simulated for joint in tag.joints]
    for joint in joints:
        if joint.name not in movable:
            location = f"robot_description:{joint.line}: <ros2_control>, joint '{joint.name}'"
            raise DescriptionError(location, "is not a movable joint", f"allowed: {', '.join(movable)}")
    return joints


def _commands(joint: Ros2ControlJoint) -> tuple[str, ...]:
    """Converts the command interfaces of a joint to hardware interfaces of ros_control."""
    unknown = [name for name in joint.command_interfaces if name not in COMMAND_INTERFACES]
    if unknown:
        location = f"robot_description:{joint.line}: <ros2_control>, joint '{joint.name}'"
        allowed = f"allowed in simulation: {', '.join(COMMAND_INTERFACES)}"
        raise DescriptionError(location, f"has the command interface '{unknown[0]}'", allowed)
    return tuple(COMMAND_INTERFACES[name] for name in joint.command_interfaces)


def _require_parent_and_child(robot: Robot) -> None:
    for joint in robot.joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if not link:
                location = f"robot_description:{joint.line}: joint '{joint.name}'"
                raise DescriptionError(location, f"has no <{role} link=...>", "a joint connects two links")


def _joint(joint: Joint, interfaces: tuple[str, ...]) -> RobotJoint:
    continuous = joint.kind == "continuous"
    limit = joint.limit or Limit(0.0, 0.0, None, None)
    return RobotJoint(
        name=joint.name,
        parent_link=joint.parent,
        child_link=joint.child,
        axis=joint.axis,
        lower=float("-inf") if continuous else limit.lower,
        upper=float("inf") if continuous else limit.upper,
        effort=1e3 if limit.effort is None else limit.effort,
        velocity=1e3 if limit.velocity is None else limit.velocity,
        interfaces=interfaces,
        mimic=joint.mimic,
    )


def _frictions(root: Element) -> dict[str, float]:
    frictions = {}
    for extension in root.findall("gazebo"):
        link, coefficient = extension.get("reference"), extension.find("mu1")
        if link is None or coefficient is None:
            continue
        try:
            value = float((coefficient.text or "").strip())
        except ValueError:
            value = math.nan
        if math.isnan(value):
            location = f"robot_description: <gazebo reference='{link}'>, <mu1>"
            allowed = "allowed: a number; -1 for surfaces that never slide"
            raise DescriptionError(location, f"got '{coefficient.text}'", allowed)
        frictions[link] = UNLIMITED_FRICTION if value < 0 else value
    return frictions


def _rewrite_meshes(root: Element, find_package: PackageFinder, convex_parts: ConvexParts, with_visuals: bool) -> None:
    for link in root.findall("link"):
        if not with_visuals:
            for visual in link.findall("visual"):
                link.remove(visual)
        for shape in link.findall("collision") + link.findall("visual"):
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                _require_sizes(link.get("name", ""), shape)
                continue
            path = _mesh_path(link.get("name", ""), mesh.get("filename", ""), find_package)
            if shape.tag == "visual":
                mesh.set("filename", str(path))
                continue
            x, y, z = (float(value) for value in mesh.get("scale", "1 1 1").split())
            mesh.set("filename", str(convex_parts.hull(Mesh(path, (x, y, z)))))
            mesh.attrib.pop("scale", None)


def _require_sizes(link: str, shape: Element) -> None:
    """Raises DescriptionError for a primitive shape too large for the engine's position accuracy of a millimetre."""
    for element in shape.findall("geometry/*"):
        for key, text in ((key, element.get(key)) for key in ("size", "radius", "length")):
            try:
                max_length = max((abs(float(word)) for word in (text or "").split()), default=0.0)
            except ValueError:
                max_length = math.inf
            if not max_length <= MAX_LENGTH_M:
                location = f"robot_description: <{shape.tag}> of link '{link}', <{element.tag} {key}=...>"
                raise DescriptionError(location, f"got '{text}'", f"allowed: lengths of at most {MAX_LENGTH_M:g} m")


def _mesh_path(link: str, uri: str, find_package: PackageFinder) -> Path:
    try:
        return mesh_path(uri, find_package)
    except MeshError as error:
        raise DescriptionError(f"robot_description: mesh of link '{link}'", error.found, error.allowed) from error
