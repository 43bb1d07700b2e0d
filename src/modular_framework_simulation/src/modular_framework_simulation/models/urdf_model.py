# SPDX-License-Identifier: BSD-3-Clause
"""Reads simple objects written in URDF: links with boxes, cylinders, spheres and meshes, joined by simple joints."""

from __future__ import annotations

import math

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.xml_nodes import XmlNode, parse_numbers, parse_xml
from modular_framework_urdf.lengths import LARGEST_LENGTH_M

_GEOMETRIES = ("box", "cylinder", "sphere", "mesh")


def read_urdf_model(text: str, source: str, resources: Resources) -> specs.Model:
    """Reads an object.

    A root link called "world" fastens the object to the world, as it does in Gazebo.

    Args:
        text: URDF.
        source: What to call the text in messages.
        resources: Where meshes are found.

    Raises:
        DescriptionError: Something in it cannot be used.
    """
    root = parse_xml(text, source)
    if root.tag != "robot":
        raise DescriptionError(root.where, f"the root element is <{root.tag}>", "allowed: <robot>")
    joint_nodes = root.find_all("joint")
    parents = {_role(joint, "child"): joint for joint in joint_nodes}
    nodes = [link for link in root.find_all("link") if link.name() != "world"]
    if not nodes:
        raise DescriptionError(root.where, "has no <link>", "an object needs at least one besides 'world'")
    frictions = _frictions(root)
    links = tuple(_read_link(node, parents, frictions, resources) for node in nodes)
    known = [link.name for link in links] + ["world"]
    joints = tuple(_read_joint(joint, known) for joint in joint_nodes)
    fastened = all(each.kind is specs.JointType.FIXED for each in joints) and any(j.parent == "world" for j in joints)
    static = fastened or any(child.text.strip() == "true" for child in _gazebo_tags(root, "static"))
    return specs.Model(root.name(), Pose(), static, links, joints, source)


def _gazebo_tags(root: XmlNode, tag: str) -> list[XmlNode]:
    return [child for extension in root.find_all("gazebo") for child in extension.find_all(tag)]


def _frictions(root: XmlNode) -> dict[str, specs.Friction]:
    frictions = {}
    for extension in root.find_all("gazebo"):
        mu = extension.find("mu1")
        if mu is not None and "reference" in extension.attributes:
            frictions[extension.attributes["reference"]] = specs.Friction(max(0.0, mu.number()))
    return frictions


def _role(joint: XmlNode, role: str) -> str:
    return joint.require(role).attributes.get("link", "")


def _pose_in_root(link: str, parents: dict[str, XmlNode], depth: int = 0) -> Pose:
    joint = parents.get(link)
    if joint is None:
        return Pose()
    if depth > len(parents):
        raise DescriptionError(joint.where, "belongs to a loop of joints", "allowed: trees")
    return _pose_in_root(_role(joint, "parent"), parents, depth + 1) @ _origin(joint)


def _origin(node: XmlNode) -> Pose:
    origin = node.find("origin")
    if origin is None:
        return Pose()
    x, y, z = parse_numbers(origin.where, origin.attributes.get("xyz", "0 0 0"), 3)
    roll, pitch, yaw = parse_numbers(origin.where, origin.attributes.get("rpy", "0 0 0"), 3)
    return Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))


def _read_link(
    node: XmlNode, parents: dict[str, XmlNode], frictions: dict[str, specs.Friction], resources: Resources
) -> specs.Link:
    friction = frictions.get(node.name(), specs.Friction())
    collisions = tuple(
        specs.Collision(
            child.attributes.get("name", f"{node.name()}_collision_{number}"),
            _origin(child),
            _geometry(child.require("geometry"), resources),
            friction,
        )
        for number, child in enumerate(node.find_all("collision"))
    )
    inertial = node.find("inertial")
    spec = _inertial(inertial) if inertial is not None else None
    return specs.Link(node.name(), _pose_in_root(node.name(), parents), spec, collisions, ())


def _inertial(node: XmlNode) -> specs.Inertial:
    mass_node, inertia = node.require("mass"), node.require("inertia")
    mass = parse_numbers(mass_node.where, mass_node.attributes.get("value", ""), 1)[0]
    if mass <= 0:
        raise DescriptionError(mass_node.where, f"got mass {mass:g} kg", "allowed: greater than 0")
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    xx, xy, xz, yy, yz, zz = (parse_numbers(inertia.where, inertia.attributes.get(each, "0"), 1)[0] for each in names)
    return specs.Inertial(_origin(node), mass, (xx, xy, xz, yy, yz, zz))


def _geometry(node: XmlNode, resources: Resources) -> specs.Geometry:
    shape = node.children[0] if node.children else node

    def lengths(attribute: str, count: int, default: str = "") -> tuple[float, ...]:
        values = parse_numbers(shape.where, shape.attributes.get(attribute, default), count)
        if min(values) <= 0:
            raise DescriptionError(shape.where, f"got {attribute}='{values}'", "allowed: greater than 0")
        if attribute != "scale" and max(values) > LARGEST_LENGTH_M:
            problem = f"got {attribute}='{shape.attributes.get(attribute)}'"
            raise DescriptionError(shape.where, problem, f"allowed: at most {LARGEST_LENGTH_M:g} m")
        return values

    match shape.tag:
        case "box":
            x, y, z = lengths("size", 3)
            return specs.Box((x, y, z))
        case "cylinder":
            return specs.Cylinder(lengths("radius", 1)[0], lengths("length", 1)[0])
        case "sphere":
            return specs.Sphere(lengths("radius", 1)[0])
        case "mesh":
            x, y, z = lengths("scale", 3, "1 1 1")
            return specs.Mesh(resources.resolve(shape, shape.attributes.get("filename", "")), (x, y, z))
    raise DescriptionError(node.where, f"holds <{shape.tag}>", f"allowed: one of {', '.join(_GEOMETRIES)}")


def _read_joint(node: XmlNode, links: list[str]) -> specs.Joint:
    kind = node.choice("type", specs.JointType, "joint type")
    for role in ("parent", "child"):
        if _role(node, role) not in links:
            raise DescriptionError(node.where, f"{role} '{_role(node, role)}' is no link", f"allowed: {links}")
    axis, limit = node.find("axis"), node.find("limit")
    x, y, z = parse_numbers(node.where, axis.attributes.get("xyz", "1 0 0"), 3) if axis is not None else (1.0, 0.0, 0.0)
    bounds = (-math.inf, math.inf)
    if limit is not None:
        lower, upper = (parse_numbers(limit.where, limit.attributes.get(key, "0"), 1)[0] for key in ("lower", "upper"))
        bounds = (lower, upper)
    return specs.Joint(
        node.name(), kind, _role(node, "parent"), _role(node, "child"), Pose(), (x, y, z), bounds[0], bounds[1]
    )
