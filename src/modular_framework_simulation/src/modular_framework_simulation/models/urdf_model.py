# SPDX-License-Identifier: BSD-3-Clause
"""Reads objects written in URDF: links with boxes, cylinders, spheres and meshes, connected by joints."""

from __future__ import annotations

import math
from enum import Enum
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.materials import Material
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_inertial import with_valid_inertia
from modular_framework_simulation.models.sdf_notes import Notes
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.sdf_shapes import MissingMeshError
from modular_framework_simulation.models.sensor_elements import urdf_sensor_elements
from modular_framework_simulation.models.urdf_extensions import UrdfExtensions
from modular_framework_simulation.models.xml_nodes import XmlNode, parse_numbers, parse_xml
from modular_framework_urdf.lengths import MAX_LENGTH_M
from modular_framework_urdf.rotations import Vector3

_GEOMETRIES = ("box", "cylinder", "sphere", "mesh")
_SUPPORTED_TAGS = ("link", "joint", "gazebo", "material")
_FRAME_INERTIAL = specs.Inertial(Pose(), 1e-5, (1e-9, 0.0, 0.0, 1e-9, 0.0, 1e-9))
"""Mass properties of a link without inertia: negligible, but not 0, which the engine cannot simulate."""


class _Type(Enum):
    """URDF joint types that are simulated."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"

    @property
    def spec(self) -> specs.JointType:
        """Returns the equivalent SDF joint type."""
        return specs.JointType(self.value)


def read_urdf_model(text: str, source: str, resources: Resources) -> specs.Model:
    """Reads an object.

    A root link named "world" fixes the object to the world, as in Gazebo.

    Args:
        text: URDF text.
        source: Name of the text in messages.
        resources: Folders and packages for meshes.

    Raises:
        DescriptionError: The text has unsupported or invalid content.
    """
    root = parse_xml(text, source)
    if root.tag != "robot":
        raise DescriptionError(root.location, f"the root element is <{root.tag}>", "allowed: <robot>")
    joint_nodes = root.find_all("joint")
    parents = {_role(joint, "child"): joint for joint in joint_nodes}
    nodes = [link for link in root.find_all("link") if link.name() != "world"]
    if not nodes:
        raise DescriptionError(root.location, "has no <link>", "an object needs a link that is not named 'world'")
    notes = Notes()
    extensions = UrdfExtensions(root, notes)
    for child in root.children:
        if child.tag not in _SUPPORTED_TAGS:
            notes.add(child, "has no effect", child.tag)
    colours = _named_colours(root)
    links = tuple(
        _read_link(node, parents, extensions, resources=resources, colours=colours, notes=notes) for node in nodes
    )
    known = [link.name for link in links] + [specs.WORLD]
    joints = tuple(_read_joint(joint, known, extensions, notes) for joint in joint_nodes)
    _refuse_two_parents(joint_nodes)
    _refuse_mimic_circles(joint_nodes)
    fixed_to_world = all(each.kind is specs.JointType.FIXED for each in joints) and any(
        j.parent == "world" for j in joints
    )
    static = fixed_to_world or extensions.flag("", "static") is True
    self_collide = extensions.flag("", "self_collide", "selfCollide") is True
    sensors = urdf_sensor_elements(root)
    return specs.Model(
        root.name(),
        Pose(),
        static,
        links,
        joints,
        source,
        self_collide=self_collide,
        notes=notes.lines,
        sensors=sensors,
    )


def collision_name(name: str, link: str, index: int) -> str:
    """Returns the name of a <collision>; for an empty name, the name that Gazebo assigns.

    Args:
        name: Name in the description, often empty.
        link: Name of the link.
        index: Index of the <collision> in the link, from 0.
    """
    return name or (f"{link}_collision_{index}" if index else f"{link}_collision")


def _refuse_mimic_circles(joint_nodes: list[XmlNode]) -> None:
    mimics = {joint.name(): mimic for joint in joint_nodes if (mimic := joint.find("mimic")) is not None}
    for name, mimic in mimics.items():
        visited, leader = [name], mimic.attributes.get("joint", "")
        while leader in mimics and leader not in visited:
            visited.append(leader)
            leader = mimics[leader].attributes.get("joint", "")
        if leader in visited:
            circle = " -> ".join([*visited, leader])
            raise DescriptionError(mimic.location, f"joint '{name}' mimics itself ({circle})", "break the circle")


def _refuse_two_parents(joints: list[XmlNode]) -> None:
    seen: set[str] = set()
    for joint in joints:
        child = _role(joint, "child")
        if child in seen:
            raise DescriptionError(joint.location, f"gives link '{child}' a second parent", "allowed: trees")
        seen.add(child)


def _named_colours(root: XmlNode) -> dict[str, specs.Colour]:
    """Returns the colours of the materials in the description, by name."""
    materials = root.find_all("material") + [
        material
        for link in root.find_all("link")
        for visual in link.find_all("visual")
        for material in visual.find_all("material")
    ]
    return {
        material.attributes["name"]: _colour(colour)
        for material in materials
        if material.attributes.get("name") and (colour := material.find("color")) is not None
    }


def _colour(node: XmlNode) -> specs.Colour:
    red, green, blue, alpha = parse_numbers(node.location, node.attributes.get("rgba", ""), 4)
    return (red, green, blue, alpha)


def _role(joint: XmlNode, role: str) -> str:
    return joint.require(role).attributes.get("link", "")


def _pose_in_root(link: str, parents: dict[str, XmlNode], depth: int = 0) -> Pose:
    joint = parents.get(link)
    if joint is None:
        return Pose()
    if depth > len(parents):
        raise DescriptionError(joint.location, "belongs to a loop of joints", "allowed: trees")
    return _pose_in_root(_role(joint, "parent"), parents, depth + 1) @ _origin(joint)


def _origin(node: XmlNode) -> Pose:
    origin = node.find("origin")
    if origin is None:
        return Pose()
    x, y, z = parse_numbers(origin.location, origin.attributes.get("xyz", "0 0 0"), 3)
    roll, pitch, yaw = parse_numbers(origin.location, origin.attributes.get("rpy", "0 0 0"), 3)
    return Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))


def _read_link(
    node: XmlNode,
    parents: dict[str, XmlNode],
    extensions: UrdfExtensions,
    *,
    resources: Resources,
    colours: dict[str, specs.Colour],
    notes: Notes,
) -> specs.Link:
    name = node.name()
    friction, contact = extensions.friction(name), extensions.contact(name)
    collisions = tuple(
        specs.Collision(
            collision_name(child.attributes.get("name", ""), name, index),
            _origin(child),
            _geometry(child.require("geometry"), resources),
            friction,
            contact=contact,
        )
        for index, child in enumerate(node.find_all("collision"))
    )
    visuals = []
    for index, child in enumerate(node.find_all("visual")):
        try:
            shape = _geometry(child.require("geometry"), resources)
        except MissingMeshError as error:
            notes.add(child, f"is not drawn: {error}")
            continue
        visuals.append(_visual(child, f"{name}_visual_{index}", shape, extensions.material(name), colours))
    inertial = node.find("inertial")
    if inertial is None:
        notes.add(node, "has no <inertial>; the link is a frame with negligible mass")
    return specs.Link(
        name,
        _pose_in_root(name, parents),
        _inertial(inertial, collisions, notes) if inertial is not None else _FRAME_INERTIAL,
        collisions,
        tuple(visuals),
        velocity_decay=extensions.velocity_decay(name),
        gravity=extensions.gravity(name),
        kinematic=extensions.flag(name, "kinematic") is True,
        self_collide=extensions.flag(name, "selfCollide"),
    )


def _visual(
    node: XmlNode, name: str, shape: specs.Geometry, replaced: Material | None, colours: dict[str, specs.Colour]
) -> specs.Visual:
    """Reads a <visual>; a Gazebo material replaces the visual's own material."""
    material = node.find("material")
    colour: specs.Colour | None = None
    if replaced is not None:
        colour = replaced.colour
    elif material is not None:
        own = material.find("color")
        colour = _colour(own) if own is not None else colours.get(material.attributes.get("name", ""))
    drawn_by_file = colour is None and isinstance(shape, specs.Mesh)
    return specs.Visual(
        node.attributes.get("name", name), _origin(node), shape, colour or specs.GREY, own_materials=drawn_by_file
    )


def _inertial(node: XmlNode, collisions: tuple[specs.Collision, ...], notes: Notes) -> specs.Inertial:
    mass_node, inertia = node.require("mass"), node.require("inertia")
    mass = parse_numbers(mass_node.location, mass_node.attributes.get("value", ""), 1)[0]
    if mass <= 0:
        raise DescriptionError(mass_node.location, f"got mass {mass:g} kg", "allowed: greater than 0")
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    xx, xy, xz, yy, yz, zz = (
        parse_numbers(inertia.location, inertia.attributes.get(each, "0"), 1)[0] for each in names
    )
    return with_valid_inertia(specs.Inertial(_origin(node), mass, (xx, xy, xz, yy, yz, zz)), collisions, inertia, notes)


def _geometry(node: XmlNode, resources: Resources) -> specs.Geometry:
    shape = node.children[0] if node.children else node

    def lengths(attribute: str, count: int, default: str = "") -> tuple[float, ...]:
        values = parse_numbers(shape.location, shape.attributes.get(attribute, default), count)
        if attribute == "scale" and all(values):
            return values
        if min(values) <= 0:
            raise DescriptionError(shape.location, f"got {attribute}='{values}'", "allowed: greater than 0")
        if max(values) > MAX_LENGTH_M:
            problem = f"got {attribute}='{shape.attributes.get(attribute)}'"
            raise DescriptionError(shape.location, problem, f"allowed: at most {MAX_LENGTH_M:g} m")
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
            return specs.Mesh(_mesh_file(shape, resources), (x, y, z))
    raise DescriptionError(node.location, f"contains <{shape.tag}>", f"allowed: one of {', '.join(_GEOMETRIES)}")


def _mesh_file(shape: XmlNode, resources: Resources) -> Path:
    try:
        return resources.resolve(shape, shape.attributes.get("filename", ""))
    except DescriptionError as error:
        raise MissingMeshError(error.location, error.problem, error.allowed) from error


def _read_joint(node: XmlNode, links: list[str], extensions: UrdfExtensions, notes: Notes) -> specs.Joint:
    kind = node.choice("type", _Type, "joint type").spec
    for role in ("parent", "child"):
        if _role(node, role) not in links:
            raise DescriptionError(node.location, f"{role} '{_role(node, role)}' is not a link", f"allowed: {links}")
    if (mimic := node.find("mimic")) is not None:
        notes.add(mimic, "has no effect, as in Gazebo; the joint moves independently")
    limit, dynamics = node.find("limit"), node.find("dynamics")
    lower, upper = -math.inf, math.inf
    if limit is not None and kind in (specs.JointType.REVOLUTE, specs.JointType.PRISMATIC):
        lower, upper = _number(limit, "lower", 0.0), _number(limit, "upper", 0.0)
        if lower > upper:
            problem = f"got lower {lower:g} and upper {upper:g}"
            raise DescriptionError(limit.location, problem, "allowed: a lower limit below the upper limit")
    return specs.Joint(
        node.name(),
        kind,
        _role(node, "parent"),
        _role(node, "child"),
        pose=Pose(),
        axis=_axis(node),
        lower=lower,
        upper=upper,
        effort=_number(limit, "effort", math.inf),
        velocity=_number(limit, "velocity", math.inf),
        dynamics=extensions.dynamics(
            node.name(), _number(dynamics, "damping", 0.0), _number(dynamics, "friction", 0.0)
        ),
        location=node.location,
    )


def _axis(node: XmlNode) -> Vector3:
    axis = node.find("axis")
    x, y, z = (
        parse_numbers(axis.location, axis.attributes.get("xyz", "1 0 0"), 3) if axis is not None else (1.0, 0.0, 0.0)
    )
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-9:
        raise DescriptionError((axis or node).location, "got an axis of length 0", "expected a direction")
    return (x / length, y / length, z / length)


def _number(node: XmlNode | None, attribute: str, default: float) -> float:
    if node is None or attribute not in node.attributes:
        return default
    return parse_numbers(node.location, node.attributes[attribute], 1)[0]
