# SPDX-License-Identifier: BSD-3-Clause
"""Reads the visual shapes of a robot's URDF for the cameras."""

from __future__ import annotations

from collections.abc import Callable

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_urdf import xml_text
from modular_framework_urdf.mesh_paths import PackageFinder, mesh_path
from modular_framework_urdf.mesh_reader import MeshError
from modular_framework_urdf.robot import MeshFile, Shape
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import Element

Colour = tuple[float, float, float, float]

_DEFAULT_COLOUR: Colour = (0.7, 0.7, 0.7, 1.0)
"""Colour of shapes without a material."""


def read_robot_visuals(
    text: str, find_package: PackageFinder, log: Callable[[str], None]
) -> dict[str, tuple[specs.Visual, ...]]:
    """Reads the visual shapes of all links with visual shapes, by link name.

    Args:
        text: URDF that the simulation has accepted.
        find_package: Function that finds the packages of package:// URIs.
        log: Function that logs a shape that is omitted or drawn in another colour.
    """
    root, robot = xml_text.parse(text, "robot_description"), read_urdf(text)
    named_materials = {
        each.get("name", ""): each for each in root.findall("material") if each.find("color") is not None
    }
    visuals: dict[str, tuple[specs.Visual, ...]] = {}
    for element, link in zip(root.findall("link"), robot.links, strict=True):
        shapes = []
        for index, (visual_element, visual) in enumerate(zip(element.findall("visual"), link.visuals, strict=True)):
            pose = Pose.from_xyz_rpy(visual.origin.xyz, visual.origin.rpy)
            for shape in visual.shapes:
                try:
                    geometry = _geometry(shape, find_package)
                except MeshError as error:
                    log(f"robot_description:{visual.line}: a visual of link '{link.name}' is not drawn: {error}")
                    continue
                name = f"{link.name}_{index}"
                colour, without_material = (
                    _colour(visual_element, named_materials, link.name, log),
                    visual_element.find("material") is None,
                )
                shapes.append(specs.Visual(name, pose, geometry, colour, own_materials=without_material))
        if shapes:
            visuals[link.name] = tuple(shapes)
    return visuals


def _geometry(shape: Shape, find_package: PackageFinder) -> specs.Geometry:
    if isinstance(shape, specs.Box | specs.Cylinder | specs.Sphere):
        return shape
    if isinstance(shape, MeshFile):
        return specs.Mesh(mesh_path(shape.uri, find_package), shape.scale)
    raise MeshError(f"<{shape.tag}>", "is not drawn by cameras", "allowed: box, cylinder, sphere or mesh")


def _colour(visual: Element, named_materials: dict[str, Element], link: str, log: Callable[[str], None]) -> Colour:
    material = visual.find("material")
    if material is None:
        return _DEFAULT_COLOUR
    if material.find("color") is None:
        material = named_materials.get(material.get("name", ""))
        if material is None:
            return _DEFAULT_COLOUR
    text = material.find("color").get("rgba", "")
    try:
        red, green, blue, alpha = (float(word) for word in text.split())
    except ValueError:
        location = f"robot_description:{material.sourceline}: <material> of link '{link}'"
        log(f"{location}: got rgba='{text}'; expected four numbers from 0 to 1; drawn grey")
        return _DEFAULT_COLOUR
    return red, green, blue, alpha
