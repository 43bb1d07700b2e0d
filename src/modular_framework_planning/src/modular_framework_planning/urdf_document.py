# SPDX-License-Identifier: BSD-3-Clause
"""Prepares a URDF for Pinocchio: mesh files are found, continuous joints become unbounded, mimics are noted."""
from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import ModelError
from modular_framework_planning.shapes import Box, Cylinder, Shape, Sphere
from modular_framework_planning.spatial import Transform

MeshResolver = Callable[[str], str]
VisualMesh = tuple[str, Transform, tuple[float, float, float]]  # URI, pose in the link, scale
VisualShape = tuple[Shape, Transform]  # primitive, pose in the link
CONTINUOUS_BOUND = 1.0e6  # [rad]; a continuous joint has no end
MOVABLE_KINDS = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: position = multiplier * leader + offset."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class UrdfDocument:
    """A URDF ready for Pinocchio and what Pinocchio does not keep."""

    xml: str
    robot_name: str
    root_link: str
    links: tuple[str, ...]
    joint_parents: Mapping[str, str]
    joint_children: Mapping[str, str]
    joint_kinds: Mapping[str, str]
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    visual_meshes: Mapping[str, tuple[VisualMesh, ...]] = field(default_factory=dict)
    visual_shapes: Mapping[str, tuple[VisualShape, ...]] = field(default_factory=dict)


def directory_resolver(root: Path) -> MeshResolver:
    """Returns a resolver that looks every mesh up below one folder, whatever its package prefix."""
    def resolve(uri: str) -> str:
        relative = uri.split("://", 1)[-1]
        for candidate in (root / relative, root / relative.split("/", 1)[-1]):
            if candidate.is_file():
                return str(candidate)
        raise ModelError(f"mesh '{uri}': no such file below {root}")
    return resolve


def package_resolver(uri: str) -> str:
    """Finds package://, file:// and absolute mesh paths; packages are looked up by rospkg."""
    if uri.startswith("package://"):
        import rospkg

        package, _, inner = uri[len("package://"):].partition("/")
        try:
            path = Path(rospkg.RosPack().get_path(package)) / inner
        except rospkg.ResourceNotFound as error:
            raise ModelError(f"mesh '{uri}': ROS package '{package}' is not on ROS_PACKAGE_PATH; "
                             "install it or source the workspace") from error
    else:
        path = Path(uri.removeprefix("file://"))
    if not path.is_file():
        raise ModelError(f"mesh '{uri}': file {path} does not exist")
    return str(path)


def _number(element: ET.Element, attribute: str, default: float, where: str) -> float:
    text = element.get(attribute)
    if text is None:
        return default
    try:
        return float(text)
    except ValueError as error:
        raise ModelError(f"{where}: attribute '{attribute}' is '{text}'; a number is needed") from error


def _prepare_joint(joint: ET.Element, name: str, mimics: dict[str, Mimic]) -> None:
    if joint.get("type") == "continuous":
        joint.set("type", "revolute")
        limit = joint.find("limit")
        if limit is None:
            limit = ET.SubElement(joint, "limit", {"effort": "0", "velocity": "0"})
        limit.set("lower", str(-CONTINUOUS_BOUND))
        limit.set("upper", str(CONTINUOUS_BOUND))
    mimic = joint.find("mimic")
    if mimic is not None:
        where = f"URDF joint '{name}' mimic"
        mimics[name] = Mimic(mimic.get("joint", ""), _number(mimic, "multiplier", 1.0, where),
                             _number(mimic, "offset", 0.0, where))
        joint.remove(mimic)


def _numbers(text: str | None, default: tuple[float, float, float], where: str) -> tuple[float, float, float]:
    if text is None:
        return default
    try:
        first, second, third = (float(item) for item in text.split())
    except ValueError as error:
        raise ModelError(f"{where}: '{text}'; three numbers are needed") from error
    return first, second, third


def _visuals(link: ET.Element) -> Iterator[tuple[ET.Element, Transform, str]]:
    """Geometry elements of a link's visuals, their poses in the link and where that is."""
    where = f"URDF link '{link.get('name')}' visual"
    for visual in link.findall("visual"):
        origin = visual.find("origin")
        xyz = _numbers(None if origin is None else origin.get("xyz"), (0.0, 0.0, 0.0), where)
        rpy = _numbers(None if origin is None else origin.get("rpy"), (0.0, 0.0, 0.0), where)
        pose = pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))
        for geometry in visual.findall("geometry/*"):
            yield geometry, pose, where


def _visual_meshes(link: ET.Element) -> Iterator[VisualMesh]:
    for geometry, pose, where in _visuals(link):
        if geometry.tag == "mesh":
            yield geometry.get("filename", ""), pose, _numbers(geometry.get("scale"), (1.0, 1.0, 1.0), where)


def _visual_shapes(link: ET.Element) -> Iterator[VisualShape]:
    for geometry, pose, where in _visuals(link):
        if geometry.tag == "box":
            yield Box(*_numbers(geometry.get("size"), (1.0, 1.0, 1.0), where)), pose
        elif geometry.tag == "sphere":
            yield Sphere(_number(geometry, "radius", 1.0, where)), pose
        elif geometry.tag == "cylinder":
            radius, length = _number(geometry, "radius", 1.0, where), _number(geometry, "length", 1.0, where)
            yield Cylinder(radius=radius, height=length), pose


def _resolve_meshes(root: ET.Element, resolve: MeshResolver) -> None:
    """Makes collision meshes file paths and takes the visual elements out."""
    for link in root.findall("link"):
        for collision in link.findall("collision"):
            for mesh in collision.iter("mesh"):
                mesh.set("filename", resolve(mesh.get("filename", "")))
        for visual in link.findall("visual"):
            link.remove(visual)


def load_urdf(text: str, resolve: MeshResolver = package_resolver) -> UrdfDocument:
    """Parses a URDF and makes it ready for Pinocchio.

    Args:
        text: the document, xacro already expanded.
        resolve: turns a mesh URI into the path of an existing file.

    Raises:
        ModelError: not XML, no root link, an unsupported joint type, a mesh that is not there.
    """
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise ModelError(f"URDF: not an XML document ({error}); is robot_description loaded and expanded?") from error
    parents: dict[str, str] = {}
    children: dict[str, str] = {}
    kinds: dict[str, str] = {}
    mimics: dict[str, Mimic] = {}
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        parent, child = joint.find("parent"), joint.find("child")
        if kind not in (*MOVABLE_KINDS, "fixed") or parent is None or child is None:
            raise ModelError(f"URDF joint '{name}': type '{kind}' with parent and child; allowed types are "
                             f"{', '.join(MOVABLE_KINDS)} and fixed, and both links must be named")
        parents[name], children[name], kinds[name] = parent.get("link", ""), child.get("link", ""), kind
        _prepare_joint(joint, name, mimics)
    links = tuple(link.get("name", "") for link in root.findall("link"))
    roots = [link for link in links if link not in children.values()]
    if len(roots) != 1:
        raise ModelError(f"URDF: {len(roots)} links without a parent joint ({', '.join(roots)}); exactly one is needed")
    meshes = {link.get("name", ""): tuple(_visual_meshes(link)) for link in root.findall("link")}
    shapes = {link.get("name", ""): tuple(_visual_shapes(link)) for link in root.findall("link")}
    _resolve_meshes(root, resolve)
    return UrdfDocument(ET.tostring(root, encoding="unicode"), root.get("name", ""), roots[0], links, parents,
                        children, kinds, mimics, meshes, shapes)
