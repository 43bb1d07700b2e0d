# SPDX-License-Identifier: BSD-3-Clause
"""Reads the collision shapes and visible shapes of an SDF link."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.materials import Material, script_material
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_frames import FrameTree
from modular_framework_simulation.models.sdf_notes import Notes
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.sdf_surface import read_bounce, read_friction, read_surface_contact
from modular_framework_simulation.models.visual_meshes import image_fault, image_faults
from modular_framework_simulation.models.xml_nodes import XmlNode
from modular_framework_urdf.lengths import MAX_LENGTH_M
from modular_framework_urdf.mesh_reader import ALLOWED as MESH_FORMATS

_GEOMETRIES = ("box", "cylinder", "sphere", "capsule", "plane", "mesh")
_MESH_SUFFIXES = tuple(f".{kind}" for kind in MESH_FORMATS)


@dataclass(frozen=True, slots=True)
class Reading:
    """Context for reading a model.

    Attributes:
        resources: Folders and packages for included models and meshes.
        version: SDF version of the file.
        notes: Collector of notes on elements that have no effect or are replaced.
    """

    resources: Resources
    version: tuple[int, ...]
    notes: Notes = field(default_factory=Notes)


def read_collisions(node: XmlNode, link: str, frames: FrameTree, reading: Reading) -> list[specs.Collision]:
    """Reads a <collision>, which has one shape in general, no shape if empty, and three shapes for a capsule.

    Args:
        node: The <collision> element.
        link: Name of the link.
        frames: Frames of the model.
        reading: Context of the model.

    Raises:
        DescriptionError: The shape, pose or surface is unsupported or invalid.
    """
    name = node.name()
    friction, bounce, contact = read_friction(node), read_bounce(node), read_surface_contact(node)
    pose = frames.pose_in_link(link, node.find("pose"))
    return [
        specs.Collision(name if not index else f"{name}_{index}", pose @ offset, shape, friction, bounce, contact)
        for index, (offset, shape) in enumerate(_read_geometry(node.require("geometry"), reading.resources))
    ]


def read_visuals(node: XmlNode, link: str, frames: FrameTree, reading: Reading) -> list[specs.Visual]:
    """Reads a <visual>; a shape without mesh file is omitted, and a shape without material is grey, with a note.

    Args:
        node: The <visual> element.
        link: Name of the link.
        frames: Frames of the model.
        reading: Context of the model.

    Raises:
        DescriptionError: The shape, pose or colour is unsupported or invalid.
    """
    name = node.name()
    try:
        shapes = _read_geometry(node.require("geometry"), reading.resources)
    except MissingMeshError as error:
        reading.notes.add(node, f"is not drawn: {error}")
        return []
    material = _read_material(node, reading)
    for shape in (shape for _, shape in shapes if isinstance(shape, specs.Mesh) and material is None):
        for image, fault in image_faults(shape.path).items():
            noun = "material library" if image.endswith(".mtl") else "image"
            line = f"the {noun} '{image}' of {shape.path.name} {fault}; drawn without a texture"
            reading.notes.add(node, line, image)
    transparency = node.find("transparency")
    look = material or Material()
    red, green, blue, alpha = look.colour
    if transparency is not None:
        alpha *= 1 - min(max(transparency.number(), 0.0), 1.0)
    pose = frames.pose_in_link(link, node.find("pose"))
    return [
        specs.Visual(
            name if not index else f"{name}_{index}",
            pose @ offset,
            shape,
            (red, green, blue, alpha),
            look.texture,
            material is None and isinstance(shape, specs.Mesh),
        )
        for index, (offset, shape) in enumerate(shapes)
    ]


def _read_material(visual: XmlNode, reading: Reading) -> Material | None:
    """Returns the material of a visual; None if the visual has no material."""
    node = visual.find("material")
    if node is None:
        return None
    script, colour_node = node.find("script"), node.find("diffuse") or node.find("ambient")
    named: Material | None = None
    if script is not None:
        try:
            named = script_material(script, reading.resources)
        except DescriptionError as error:
            reading.notes.add(script, f"{error.problem}; drawn grey ({error.allowed})")
            named = Material()
        if named.missing_texture:
            reading.notes.add(script, f"the image '{named.missing_texture}' does not exist; drawn in a plain colour")
        elif named.texture is not None and (fault := image_fault(named.texture)):
            reading.notes.add(script, f"the image '{named.texture}' {fault}; drawn in a plain colour")
            named = Material(named.colour)
    if colour_node is None:
        return named
    red, green, blue, *alpha = colour_node.number_list(3, 4)
    colour = (red, green, blue, alpha[0] if alpha else 1.0)
    return Material(colour, named.texture if named is not None else None)


class MissingMeshError(DescriptionError):
    """The file of a mesh does not exist."""


def _read_geometry(node: XmlNode, resources: Resources) -> list[tuple[Pose, specs.Geometry]]:
    """Returns the shapes of a <geometry> and the pose of each shape in the geometry's frame."""
    if node.find("empty") is not None and len(node.children) == 1:
        return []
    if len(node.children) != 1 or node.children[0].tag not in _GEOMETRIES:
        got = ", ".join(f"<{child.tag}>" for child in node.children) or "nothing"
        raise DescriptionError(node.location, f"contains {got}", f"allowed: exactly one of {', '.join(_GEOMETRIES)}")
    shape = node.children[0]
    match shape.tag:
        case "box":
            x, y, z = _sizes(shape.require("size"), 3)
            return [(Pose(), specs.Box((x, y, z)))]
        case "cylinder":
            radius, length = _sizes(shape.require("radius"), 1)[0], _sizes(shape.require("length"), 1)[0]
            return [(Pose(), specs.Cylinder(radius, length))]
        case "sphere":
            return [(Pose(), specs.Sphere(_sizes(shape.require("radius"), 1)[0]))]
        case "capsule":
            return _capsule(_sizes(shape.require("radius"), 1)[0], _sizes(shape.require("length"), 1)[0])
        case "plane":
            return [(Pose(), _read_plane(shape))]
        case "mesh":
            return [(Pose(), _read_mesh(shape, resources))]
    raise DescriptionError(shape.location, "is not a known shape", f"allowed: {', '.join(_GEOMETRIES)}")


def _capsule(radius: float, length: float) -> list[tuple[Pose, specs.Geometry]]:
    """Returns the shapes of a capsule: a cylinder with a sphere at each end."""
    ends = (Pose((0.0, 0.0, length / 2)), Pose((0.0, 0.0, -length / 2)))
    return [(Pose(), specs.Cylinder(radius, length)), *((end, specs.Sphere(radius)) for end in ends)]


def _read_plane(node: XmlNode) -> specs.Plane:
    normal_node, size_node = node.find("normal"), node.find("size")
    x, y, z = normal_node.numbers(3) if normal_node is not None else (0.0, 0.0, 1.0)
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-9:
        raise DescriptionError((normal_node or node).location, "got a normal of length 0", "expected a direction")
    width, depth = _positive(size_node, 2) if size_node is not None else (1.0, 1.0)
    return specs.Plane((x / length, y / length, z / length), (width, depth))


def _read_mesh(node: XmlNode, resources: Resources) -> specs.Mesh:
    uri = node.find("uri") or node.find("filename") or node.require("uri")  # <filename> up to SDF 1.3
    try:
        path = resources.resolve(uri, uri.text.strip())
    except DescriptionError as error:
        raise MissingMeshError(error.location, error.problem, error.allowed) from error
    if path.suffix.lower() not in _MESH_SUFFIXES:
        raise DescriptionError(uri.location, f"got '{path.name}'", f"allowed: {', '.join(_MESH_SUFFIXES)}")
    scale = node.find("scale")
    x, y, z = scale.numbers(3) if scale is not None else (1.0, 1.0, 1.0)
    if scale is not None and not all((x, y, z)):
        raise DescriptionError(scale.location, f"got '{scale.text.strip()}'", "allowed: numbers different from 0")
    submesh = node.find("submesh")
    if submesh is None:
        return specs.Mesh(path, (x, y, z), location=node.location)
    center = submesh.find("center")
    name = submesh.require("name").text.strip()
    return specs.Mesh(path, (x, y, z), name, center.flag() if center is not None else False, node.location)


def _positive(node: XmlNode, count: int) -> tuple[float, ...]:
    values = node.numbers(count)
    if min(values) <= 0:
        raise DescriptionError(node.location, f"got '{node.text.strip()}'", "allowed: greater than 0")
    return values


def _sizes(node: XmlNode, count: int) -> tuple[float, ...]:
    values = _positive(node, count)
    if max(values) > MAX_LENGTH_M:
        raise DescriptionError(node.location, f"got '{node.text.strip()}'", f"allowed: at most {MAX_LENGTH_M:g} m")
    return values
