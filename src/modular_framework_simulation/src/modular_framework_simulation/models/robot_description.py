# SPDX-License-Identifier: BSD-3-Clause
"""Reads what the simulation needs of a robot's URDF, and rewrites the URDF for the physics engine.

The engine gets convex hulls in place of the collision meshes and, without a window, no visual shapes: it then loads in
a fraction of the time and computes contacts faster.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.sdf_specs import Mesh
from modular_framework_urdf import xml_text
from modular_framework_urdf.lengths import LARGEST_LENGTH_M
from modular_framework_urdf.mesh_paths import PackageFinder, mesh_path
from modular_framework_urdf.mesh_reader import MeshError
from modular_framework_urdf.mimics import Mimic, resolved
from modular_framework_urdf.xml_text import Element

MOVABLE_TYPES = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, slots=True)
class RobotJoint:
    """A movable joint of the robot.

    Attributes:
        name: As in the description.
        parent_link: The link it is fastened to.
        child_link: The link it moves.
        lower: [rad or m]
        upper: [rad or m]
        effort: Largest effort of its drive [Nm or N].
        velocity: Largest velocity [rad/s or m/s].
        interfaces: Hardware interfaces its transmission names; empty for a joint without a drive of its own.
        mimic: The joint it follows, if it follows one.
    """

    name: str
    parent_link: str
    child_link: str
    lower: float
    upper: float
    effort: float
    velocity: float
    interfaces: tuple[str, ...]
    mimic: Mimic | None


@dataclass(frozen=True, slots=True)
class RobotDescription:
    """A robot as the simulation sees it.

    Attributes:
        name: Name of the robot in its description.
        joints: The movable joints, in file order.
        links: All link names, in file order.
        parents: Parent link of every link that has one.
        engine_urdf: The URDF for the physics engine.
    """

    name: str
    joints: tuple[RobotJoint, ...]
    links: tuple[str, ...]
    parents: dict[str, str]
    engine_urdf: str


def read_robot(
    text: str, find_package: PackageFinder, convex_parts: ConvexParts, with_visuals: bool
) -> RobotDescription:
    """Reads a robot description.

    Args:
        text: URDF.
        find_package: Looks up the packages of package:// URIs.
        convex_parts: Makes convex hulls of collision meshes.
        with_visuals: Whether visual shapes are kept.

    Raises:
        DescriptionError: The text is no URDF, or refers to something that is not there.
    """
    try:
        root = xml_text.parse(text, "robot_description")
    except xml_text.XmlError as error:
        raise DescriptionError(error.where, error.found, error.allowed) from error
    links = tuple(link.get("name", "") for link in root.findall("link"))
    if root.tag != "robot" or not links:
        raise DescriptionError("robot_description", f"<{root.tag}> with {len(links)} links", "expected a URDF <robot>")
    transmissions = _transmissions(root)
    joints = tuple(
        _joint(joint, transmissions) for joint in root.findall("joint") if joint.get("type") in MOVABLE_TYPES
    )
    joints = _with_leaders(joints)
    _rewrite_meshes(root, find_package, convex_parts, with_visuals)
    _give_frames_no_weight(root)
    engine_urdf = xml_text.to_text(root)
    parents = {_link_of(joint, "child"): _link_of(joint, "parent") for joint in root.findall("joint")}
    return RobotDescription(root.get("name", "robot"), joints, links, parents, engine_urdf)


def _with_leaders(joints: tuple[RobotJoint, ...]) -> tuple[RobotJoint, ...]:
    """Lets every mimic joint follow the joint that drives its chain of mimic joints."""
    try:
        mimics = resolved({joint.name: joint.mimic for joint in joints if joint.mimic is not None},
                          [joint.name for joint in joints])
    except ValueError as error:
        where, _, problem = str(error).partition(": ")
        raise DescriptionError(f"robot_description: {where}", *problem.split("; ", 1)) from error
    return tuple(replace(joint, mimic=mimics.get(joint.name)) for joint in joints)


def _transmissions(root: Element) -> dict[str, tuple[str, ...]]:
    interfaces: dict[str, tuple[str, ...]] = {}
    for transmission in root.findall("transmission"):
        for joint in transmission.findall("joint"):
            name = joint.get("name", "")
            texts = [(each.text or "").strip() for each in joint.findall("hardwareInterface")]
            if not texts:
                where = f"robot_description: <transmission name='{transmission.get('name')}'>, joint '{name}'"
                raise DescriptionError(where, "has no <hardwareInterface>", "name the position, velocity or effort one")
            interfaces[name] = interfaces.get(name, ()) + tuple(texts)
    return interfaces


def _joint(joint: Element, transmissions: dict[str, tuple[str, ...]]) -> RobotJoint:
    name = joint.get("name", "")
    limit, mimic_element = joint.find("limit"), joint.find("mimic")

    def limit_value(key: str, default: float) -> float:
        return _number(name, limit, key, default) if limit is not None else default

    continuous = joint.get("type") == "continuous"
    mimic = None
    if mimic_element is not None:
        mimic = Mimic(
            mimic_element.get("joint", ""),
            _number(name, mimic_element, "multiplier", 1.0),
            _number(name, mimic_element, "offset", 0.0),
        )
    return RobotJoint(
        name=name,
        parent_link=_link_of(joint, "parent"),
        child_link=_link_of(joint, "child"),
        lower=float("-inf") if continuous else limit_value("lower", 0.0),
        upper=float("inf") if continuous else limit_value("upper", 0.0),
        effort=limit_value("effort", 1e3),
        velocity=limit_value("velocity", 1e3),
        interfaces=transmissions.get(name, ()),
        mimic=mimic,
    )


def _link_of(joint: Element, role: str) -> str:
    element = joint.find(role)
    if element is None or not element.get("link"):
        where = f"robot_description: joint '{joint.get('name')}'"
        raise DescriptionError(where, f"has no <{role} link=...>", "a joint connects two links")
    return element.get("link", "")


def _number(joint: str, element: Element, key: str, default: float) -> float:
    text = element.get(key)
    try:
        return default if text is None else float(text)
    except ValueError as error:
        where = f"robot_description: joint '{joint}', <{element.tag} {key}=...>"
        raise DescriptionError(where, f"got '{text}'", "expected a number") from error


def _rewrite_meshes(
    root: Element, find_package: PackageFinder, convex_parts: ConvexParts, with_visuals: bool
) -> None:
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
    """Refuses primitives that are larger than the engine can place to the millimetre."""
    for element in shape.findall("geometry/*"):
        for key, text in ((key, element.get(key)) for key in ("size", "radius", "length")):
            try:
                largest = max((abs(float(word)) for word in (text or "").split()), default=0.0)
            except ValueError:
                largest = math.inf
            if not largest <= LARGEST_LENGTH_M:
                where = f"robot_description: <{shape.tag}> of link '{link}', <{element.tag} {key}=...>"
                raise DescriptionError(where, f"got '{text}'", f"allowed: lengths of at most {LARGEST_LENGTH_M:g} m")


def _give_frames_no_weight(root: Element) -> None:
    """Links without mass are mere frames; the engine would take each of them for a kilogram."""
    for link in root.findall("link"):
        if link.find("inertial") is None:
            inertial = xml_text.add_child(link, "inertial")
            xml_text.add_child(inertial, "mass", value="1e-5")
            moments = {"ixx": "1e-9", "ixy": "0", "ixz": "0", "iyy": "1e-9", "iyz": "0", "izz": "1e-9"}
            xml_text.add_child(inertial, "inertia", **moments)


def _mesh_path(link: str, uri: str, find_package: PackageFinder) -> Path:
    try:
        return mesh_path(uri, find_package)
    except MeshError as error:
        raise DescriptionError(f"robot_description: mesh of link '{link}'", error.found, error.allowed) from error
