# SPDX-License-Identifier: BSD-3-Clause
"""Reads the parts of an SDF link: shapes, friction and inertia."""

from __future__ import annotations

import math

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_frames import pose_of
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.xml_nodes import XmlNode
from modular_framework_urdf.lengths import LARGEST_LENGTH_M
from modular_framework_urdf.mesh_reader import ALLOWED as MESH_FORMATS

SUPPORTED_VERSIONS = ("1.4", "1.5", "1.6", "1.7")
_GEOMETRIES = ("box", "cylinder", "sphere", "plane", "mesh")
_MESH_SUFFIXES = tuple(f".{kind}" for kind in MESH_FORMATS)
_GREY = (0.7, 0.7, 0.7, 1.0)


def read_collision(node: XmlNode, resources: Resources) -> specs.Collision:
    """Reads a <collision>.

    Raises:
        DescriptionError: Its shape, pose or friction cannot be used.
    """
    return specs.Collision(
        node.name(), _optional_pose(node), _read_geometry(node.require("geometry"), resources), _read_friction(node)
    )


def read_visual(node: XmlNode, resources: Resources) -> specs.Visual:
    """Reads a <visual>; material scripts of other programs are read over.

    Raises:
        DescriptionError: Its shape, pose or colour cannot be used.
    """
    colour_node = node.find_path("material", "diffuse") or node.find_path("material", "ambient")
    colour = _GREY
    if colour_node is not None:
        red, green, blue, alpha = colour_node.numbers(4)
        colour = (red, green, blue, alpha)
    geometry = _read_geometry(node.require("geometry"), resources)
    return specs.Visual(node.name(), _optional_pose(node), geometry, colour)


def read_inertial(node: XmlNode) -> specs.Inertial:
    """Reads an <inertial>; an inertia that is not given is that of a unit matrix, as SDF defines.

    Raises:
        DescriptionError: The mass is not positive, or no rigid body has such moments of inertia.
    """
    mass_node, inertia_node = node.find("mass"), node.find("inertia")
    mass = mass_node.number() if mass_node is not None else 1.0
    if mass <= 0:
        raise DescriptionError((mass_node or node).where, f"got mass {mass:g} kg", "allowed: greater than 0")

    def moment(tag: str, default: float) -> float:
        child = inertia_node.find(tag) if inertia_node is not None else None
        return child.number() if child is not None else default

    ixx, iyy, izz = moment("ixx", 1.0), moment("iyy", 1.0), moment("izz", 1.0)
    largest = max(ixx, iyy, izz)
    if min(ixx, iyy, izz) <= 0 or 2 * largest > (ixx + iyy + izz) * (1 + 1e-6):
        raise DescriptionError(
            (inertia_node or node).where,
            f"got moments ixx={ixx:g} iyy={iyy:g} izz={izz:g}",
            "allowed: positive, and none greater than the sum of the other two",
        )
    inertia = (ixx, moment("ixy", 0.0), moment("ixz", 0.0), iyy, moment("iyz", 0.0), izz)
    return specs.Inertial(_optional_pose(node), mass, inertia)


def _optional_pose(node: XmlNode) -> Pose:
    pose = node.find("pose")
    return pose_of(pose) if pose is not None else Pose()


def _read_geometry(node: XmlNode, resources: Resources) -> specs.Geometry:
    shapes = [child for child in node.children if child.tag != "empty"]
    if len(shapes) != 1 or shapes[0].tag not in _GEOMETRIES:
        got = ", ".join(f"<{child.tag}>" for child in shapes) or "nothing"
        raise DescriptionError(node.where, f"holds {got}", f"allowed: exactly one of {', '.join(_GEOMETRIES)}")
    shape = shapes[0]
    match shape.tag:
        case "box":
            x, y, z = _sizes(shape.require("size"), 3)
            return specs.Box((x, y, z))
        case "cylinder":
            return specs.Cylinder(_sizes(shape.require("radius"), 1)[0], _sizes(shape.require("length"), 1)[0])
        case "sphere":
            return specs.Sphere(_sizes(shape.require("radius"), 1)[0])
        case "plane":
            return _read_plane(shape)
        case "mesh":
            return _read_mesh(shape, resources)
    raise DescriptionError(shape.where, "is no known shape", f"allowed: {', '.join(_GEOMETRIES)}")


def _read_plane(node: XmlNode) -> specs.Plane:
    normal_node, size_node = node.find("normal"), node.find("size")
    x, y, z = normal_node.numbers(3) if normal_node is not None else (0.0, 0.0, 1.0)
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-9:
        raise DescriptionError((normal_node or node).where, "got a normal of length 0", "expected a direction")
    width, depth = _positive(size_node, 2) if size_node is not None else (1.0, 1.0)
    return specs.Plane((x / length, y / length, z / length), (width, depth))


def _read_mesh(node: XmlNode, resources: Resources) -> specs.Mesh:
    uri = node.require("uri")
    path = resources.resolve(uri, uri.text.strip())
    if path.suffix.lower() not in _MESH_SUFFIXES:
        raise DescriptionError(uri.where, f"got '{path.name}'", f"allowed: {', '.join(_MESH_SUFFIXES)}")
    if node.find("submesh") is not None:
        raise DescriptionError(node.where, "asks for a <submesh>", "allowed: whole meshes; split the file")
    scale = node.find("scale")
    x, y, z = _positive(scale, 3) if scale is not None else (1.0, 1.0, 1.0)
    return specs.Mesh(path, (x, y, z))


def _read_friction(node: XmlNode) -> specs.Friction:
    friction = node.find_path("surface", "friction")

    def coefficient(*path: str) -> float | None:
        child = friction.find_path(*path) if friction is not None else None
        if child is None:
            return None
        value = child.number()
        if value < 0:
            raise DescriptionError(child.where, f"got {value:g}", "allowed: 0 or greater")
        return value

    lateral = coefficient("ode", "mu")
    if lateral is None:
        lateral = coefficient("bullet", "friction")
    return specs.Friction(
        1.0 if lateral is None else lateral,
        coefficient("torsional", "coefficient"),
        coefficient("bullet", "rolling_friction"),
    )


def _positive(node: XmlNode, count: int) -> tuple[float, ...]:
    values = node.numbers(count)
    if min(values) <= 0:
        raise DescriptionError(node.where, f"got '{node.text.strip()}'", "allowed: greater than 0")
    return values


def _sizes(node: XmlNode, count: int) -> tuple[float, ...]:
    values = _positive(node, count)
    if max(values) > LARGEST_LENGTH_M:
        raise DescriptionError(node.where, f"got '{node.text.strip()}'", f"allowed: at most {LARGEST_LENGTH_M:g} m")
    return values
