# SPDX-License-Identifier: BSD-3-Clause
"""Prepares a URDF for Pinocchio: shapes are read, continuous joints become unbounded, mimics are noted."""
from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import GeometryError, ModelError
from modular_framework_planning.geometry.shapes import Box, Capsule, Cylinder, Mesh, Shape, Sphere
from modular_framework_planning.geometry.spatial import Transform
from modular_framework_urdf import xml_text
from modular_framework_urdf.mesh_reader import MeshError, read_mesh
from modular_framework_urdf.mimics import Mimic, resolved
from modular_framework_urdf.xml_text import Element

MeshResolver = Callable[[str], str]
VisualMesh = tuple[str, Transform, tuple[float, float, float]]  # URI, pose in the link, scale
PlacedShape = tuple[Shape, Transform]  # shape, pose in the link
CONTINUOUS_BOUND = 1.0e6  # [rad]; a continuous joint has no end
MOVABLE_KINDS = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, slots=True)
class UrdfDocument:
    """A URDF ready for Pinocchio and what Pinocchio does not keep; the links' geometry is not in `xml`."""

    xml: str
    robot_name: str
    root_link: str
    links: tuple[str, ...]
    joint_parents: Mapping[str, str]
    joint_children: Mapping[str, str]
    joint_kinds: Mapping[str, str]
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    visual_meshes: Mapping[str, tuple[VisualMesh, ...]] = field(default_factory=dict)
    visual_shapes: Mapping[str, tuple[PlacedShape, ...]] = field(default_factory=dict)
    collisions: Mapping[str, tuple[PlacedShape, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # what was ignored, and why


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
            path = Path(rospkg.RosPack.get_instance().get_path(package)) / inner  # which has searched once
        except rospkg.ResourceNotFound as error:
            raise ModelError(f"mesh '{uri}': ROS package '{package}' is not on ROS_PACKAGE_PATH; "
                             "install it or source the workspace") from error
    else:
        path = Path(uri.removeprefix("file://"))
    if not path.is_file():
        raise ModelError(f"mesh '{uri}': file {path} does not exist")
    return str(path)


def _number(element: Element, attribute: str, default: float, where: str) -> float:
    text = element.get(attribute)
    if text is None:
        return default
    try:
        return float(text)
    except ValueError as error:
        raise ModelError(f"{where}: attribute '{attribute}' is '{text}'; a number is needed") from error


@dataclass(frozen=True, slots=True)
class _Joints:
    """What the joints of a URDF say; `notes`: what was ignored, and why."""

    parents: dict[str, str] = field(default_factory=dict)
    children: dict[str, str] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    mimics: dict[str, Mimic] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def _read_joints(root: Element) -> _Joints:
    """Reads the joints and makes them ready for Pinocchio; raises ModelError."""
    result = _Joints()
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        parent, child = joint.find("parent"), joint.find("child")
        if kind not in (*MOVABLE_KINDS, "fixed") or parent is None or child is None:
            raise ModelError(f"URDF joint '{name}': type '{kind}' with parent and child; allowed types are "
                             f"{', '.join(MOVABLE_KINDS)} and fixed, and both links must be named")
        result.parents[name], result.children[name] = parent.get("link", ""), child.get("link", "")
        result.kinds[name] = kind
        _prepare_joint(joint, name, result)
    try:
        mimics = resolved(result.mimics, [name for name, kind in result.kinds.items() if kind != "fixed"])
    except ValueError as error:
        raise ModelError(str(error)) from error
    return replace(result, mimics=mimics)


def _prepare_joint(joint: Element, name: str, result: _Joints) -> None:
    if joint.get("type") == "continuous":
        joint.set("type", "revolute")
        limit = joint.find("limit")
        if limit is None:
            limit = xml_text.add_child(joint, "limit", effort="0", velocity="0")
        limit.set("lower", str(-CONTINUOUS_BOUND))
        limit.set("upper", str(CONTINUOUS_BOUND))
    mimic = joint.find("mimic")
    if mimic is None:
        return
    joint.remove(mimic)
    if joint.get("type") == "fixed":
        result.notes.append(f"URDF joint '{name}': <mimic> is ignored, because the joint is fixed; remove it, or make "
                            "the joint one that moves")
        return
    where = f"URDF joint '{name}' mimic"
    result.mimics[name] = Mimic(mimic.get("joint", ""), _number(mimic, "multiplier", 1.0, where),
                                _number(mimic, "offset", 0.0, where))


def _numbers(text: str | None, default: tuple[float, float, float], where: str) -> tuple[float, float, float]:
    if text is None:
        return default
    try:
        first, second, third = (float(item) for item in text.split())
    except ValueError as error:
        raise ModelError(f"{where}: '{text}'; three numbers are needed") from error
    return first, second, third


def _geometries(link: Element, role: str) -> Iterator[tuple[Element, Transform, str]]:
    """Geometry elements of a link's visuals or collisions, their poses in the link and where that is."""
    where = f"URDF link '{link.get('name')}' {role}"
    for element in link.findall(role):
        origin = element.find("origin")
        xyz = _numbers(None if origin is None else origin.get("xyz"), (0.0, 0.0, 0.0), where)
        rpy = _numbers(None if origin is None else origin.get("rpy"), (0.0, 0.0, 0.0), where)
        pose = pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))
        for geometry in element.findall("geometry/*"):
            yield geometry, pose, where


def _visual_meshes(link: Element) -> Iterator[VisualMesh]:
    for geometry, pose, where in _geometries(link, "visual"):
        if geometry.tag == "mesh":
            yield geometry.get("filename", ""), pose, _numbers(geometry.get("scale"), (1.0, 1.0, 1.0), where)


def _visual_shapes(link: Element) -> Iterator[PlacedShape]:
    for geometry, pose, where in _geometries(link, "visual"):
        shape = None if geometry.tag == "capsule" else _primitive(geometry, where)  # no marker shows a capsule
        if shape is not None:
            yield shape, pose


def _primitive(geometry: Element, where: str) -> Shape | None:
    match geometry.tag:
        case "box":
            return Box(*_numbers(geometry.get("size"), (1.0, 1.0, 1.0), where))
        case "sphere":
            return Sphere(_number(geometry, "radius", 1.0, where))
        case "cylinder" | "capsule":
            radius, length = _number(geometry, "radius", 1.0, where), _number(geometry, "length", 1.0, where)
            return (Cylinder if geometry.tag == "cylinder" else Capsule)(radius=radius, height=length)
    return None


def _collisions(link: Element, resolve: MeshResolver) -> Iterator[PlacedShape]:
    """Shapes of a link; raises ModelError for a mesh that is not there or cannot be read, or an unknown shape."""
    for geometry, pose, where in _geometries(link, "collision"):
        if geometry.tag == "mesh":
            scale = _numbers(geometry.get("scale"), (1.0, 1.0, 1.0), where)
            try:
                mesh = read_mesh(resolve(geometry.get("filename", "")), scale)
            except MeshError as error:
                raise ModelError(f"{where}: {error}") from error
            yield Mesh(mesh.vertices, mesh.triangles), pose
            continue
        try:
            shape = _primitive(geometry, where)
        except GeometryError as error:
            raise ModelError(f"{where}: {error.reason}") from error
        if shape is None:
            raise ModelError(f"{where}: <{geometry.tag}>; allowed are box, capsule, cylinder, sphere and mesh")
        yield shape, pose


def _without_geometry(root: Element) -> str:
    """Returns the document as Pinocchio gets it: kinematics and inertias."""
    for link in root.findall("link"):
        for element in (*link.findall("collision"), *link.findall("visual")):
            link.remove(element)
    return xml_text.to_text(root)


def load_urdf(text: str, resolve: MeshResolver = package_resolver) -> UrdfDocument:
    """Parses a URDF and makes it ready for Pinocchio.

    Args:
        text: the document, xacro already expanded.
        resolve: turns a mesh URI into the path of an existing file.

    Raises:
        ModelError: not XML, a DOCTYPE, no root link, an unsupported joint type, a mesh that cannot be read.
    """
    try:
        root = xml_text.parse(text, "URDF")
    except xml_text.XmlError as error:
        raise ModelError(f"{error} (is robot_description loaded, and its xacro expanded?)") from error
    joints = _read_joints(root)
    links = tuple(link.get("name", "") for link in root.findall("link"))
    roots = [link for link in links if link not in joints.children.values()]
    if len(roots) != 1:
        raise ModelError(f"URDF: {len(roots)} links without a parent joint ({', '.join(roots)}); exactly one is needed")
    meshes = {link.get("name", ""): tuple(_visual_meshes(link)) for link in root.findall("link")}
    shapes = {link.get("name", ""): tuple(_visual_shapes(link)) for link in root.findall("link")}
    collisions = {link.get("name", ""): tuple(_collisions(link, resolve)) for link in root.findall("link")}
    return UrdfDocument(_without_geometry(root), root.get("name", ""), roots[0], links, joints.parents,
                        joints.children, joints.kinds, joints.mimics, meshes, shapes, collisions, tuple(joints.notes))
