# SPDX-License-Identifier: BSD-3-Clause
"""Preparation of a URDF for Pinocchio, and the content of the URDF that Pinocchio does not keep."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import GeometryError, ModelError
from modular_framework_planning.geometry.shapes import Box, Capsule, Cylinder, Mesh, Shape, Sphere
from modular_framework_planning.geometry.spatial import Transform
from modular_framework_planning.robot_model.multi_dof_joint import MultiDofJoint, Variable, multi_dof_joint
from modular_framework_urdf import robot as urdf
from modular_framework_urdf import xml_text
from modular_framework_urdf.joint_limits import JointLimits, described_limits
from modular_framework_urdf.mesh_reader import MeshError, read_mesh
from modular_framework_urdf.mimics import Mimic, resolve_mimics
from modular_framework_urdf.robot import MOVABLE_KINDS, Link, PlacedShapes, Robot
from modular_framework_urdf.srdf_reader import VirtualJoint
from modular_framework_urdf.urdf_reader import AttributeFault, read_urdf

MeshResolver = Callable[[str], str]
VisualMesh = tuple[str, Transform, tuple[float, float, float]]  # URI, pose in the link, scale
PlacedShape = tuple[Shape, Transform]  # shape, pose in the link
CONTINUOUS_BOUND = 1.0e6  # assumed bound of a continuous joint [rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfDocument:
    """A URDF prepared for Pinocchio.

    `xml` contains no geometry. The joints of `xml` and of the mappings are the joints of the URDF and, above the root
    link, the variables of a planar or floating virtual joint.
    """

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
    notes: tuple[str, ...] = ()  # ignored elements, with reasons
    multi_dof_joint: MultiDofJoint | None = None  # planar or floating joint above the root link
    limits: Mapping[str, JointLimits] = field(default_factory=dict)  # limits of the URDF, keyed by joint name


def directory_resolver(root: Path) -> MeshResolver:
    """Returns a resolver that finds meshes below a folder, independent of their package prefix."""

    def resolve(uri: str) -> str:
        relative = uri.split("://", 1)[-1]
        for candidate in (root / relative, root / relative.split("/", 1)[-1]):
            if candidate.is_file():
                return str(candidate)
        raise ModelError(f"mesh '{uri}': no such file below {root}")

    return resolve


def package_resolver(uri: str) -> str:
    """Returns the file path of a package:// or file:// URI or an absolute path; rospkg finds packages."""
    if uri.startswith("package://"):
        import rospkg

        package, _, inner = uri[len("package://") :].partition("/")
        try:
            path = Path(rospkg.RosPack.get_instance().get_path(package)) / inner  # get_instance caches its search
        except rospkg.ResourceNotFound as error:
            raise ModelError(
                f"mesh '{uri}': ROS package '{package}' is not on ROS_PACKAGE_PATH; install it or source the workspace"
            ) from error
    else:
        path = Path(uri.removeprefix("file://"))
    if not path.is_file():
        raise ModelError(f"mesh '{uri}': file {path} does not exist")
    return str(path)


def _check_kinds(robot: Robot) -> None:
    for joint in robot.joints:
        if joint.kind not in (*MOVABLE_KINDS, "fixed") or not joint.parent or not joint.child:
            raise ModelError(
                f"URDF joint '{joint.name}' has type '{joint.kind}'; the type must be "
                f"{', '.join(MOVABLE_KINDS)} or fixed, and both links must be named"
            )


def _mimics(robot: Robot) -> tuple[dict[str, Mimic], tuple[str, ...]]:
    """Returns the resolved mimic joints, and notes about ignored joints; raises ModelError for an invalid mimic."""
    direct = {joint.name: joint.mimic for joint in robot.movable_joints() if joint.mimic is not None}
    try:
        mimics = resolve_mimics(direct, [joint.name for joint in robot.movable_joints()])
    except ValueError as error:
        raise ModelError(str(error)) from error
    return mimics, tuple(
        f"URDF joint '{joint.name}': <mimic> is ignored, because the joint is fixed; remove it, or make the joint "
        "movable"
        for joint in robot.joints
        if joint.kind == "fixed" and joint.mimic is not None
    )


def _xml_for_pinocchio(text: str, base: Sequence[Variable]) -> str:
    """Returns the XML for Pinocchio: kinematics and inertias, with bounded continuous joints and without mimics.

    Args:
        text: URDF document.
        base: Joints to insert above the root link.
    """
    root = xml_text.parse(text, "URDF")
    for link in root.findall("link"):
        for element in (*link.findall("collision"), *link.findall("visual")):
            link.remove(element)
    for variable in base:
        xml_text.add_child(root, "link", name=variable.parent)
        joint = xml_text.add_child(root, "joint", name=variable.name, type=variable.kind)
        xml_text.add_child(joint, "parent", link=variable.parent)
        xml_text.add_child(joint, "child", link=variable.child)
        xml_text.add_child(joint, "axis", xyz=variable.axis)
        bounds = {"lower": repr(-variable.bound), "upper": repr(variable.bound)}
        xml_text.add_child(joint, "limit", **bounds, effort="0", velocity="0")
    for joint in root.findall("joint"):
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = xml_text.add_child(joint, "limit", effort="0", velocity="0")
            limit.set("lower", str(-CONTINUOUS_BOUND))
            limit.set("upper", str(CONTINUOUS_BOUND))
    return xml_text.to_text(root)


def _placed_shapes(items: tuple[PlacedShapes, ...]) -> Iterator[tuple[urdf.Shape, Transform]]:
    """Yields the shapes of visual or collision elements and their poses in the link frame."""
    for item in items:
        pose = pin.SE3(pin.rpy.rpyToMatrix(*item.origin.rpy), np.array(item.origin.xyz))
        for shape in item.shapes:
            yield shape, pose


def _visual_meshes(link: Link) -> Iterator[VisualMesh]:
    for shape, pose in _placed_shapes(link.visuals):
        if isinstance(shape, urdf.MeshFile):
            yield shape.uri, pose, shape.scale


def _visual_shapes(link: Link) -> Iterator[PlacedShape]:
    for shape, pose in _placed_shapes(link.visuals):
        primitive = (
            None if isinstance(shape, urdf.Capsule) else _primitive(shape)
        )  # there is no marker type for a capsule
        if primitive is not None:
            yield primitive, pose


def _primitive(shape: urdf.Shape) -> Shape | None:
    match shape:
        case urdf.Box(size):
            return Box(*size)
        case urdf.Sphere(radius):
            return Sphere(radius)
        case urdf.Cylinder(radius, length):
            return Cylinder(radius=radius, height=length)
        case urdf.Capsule(radius, length):
            return Capsule(radius=radius, height=length)
    return None


def _collisions(link: Link, resolve: MeshResolver) -> Iterator[PlacedShape]:
    """Yields the collision shapes of a link; raises ModelError for an unreadable mesh or an unknown shape."""
    source_name = f"URDF link '{link.name}' collision"
    for shape, pose in _placed_shapes(link.collisions):
        if isinstance(shape, urdf.UnknownShape):
            raise ModelError(f"{source_name}: <{shape.tag}>; allowed: box, capsule, cylinder, sphere and mesh")
        try:
            if isinstance(shape, urdf.MeshFile):
                mesh = read_mesh(resolve(shape.uri), shape.scale)
                yield Mesh(mesh.vertices, mesh.triangles), pose
            elif (primitive := _primitive(shape)) is not None:
                yield primitive, pose
        except MeshError as error:
            raise ModelError(f"{source_name}: {error}") from error
        except GeometryError as error:
            raise ModelError(f"{source_name}: {error.reason}") from error


def load_urdf(
    text: str, resolve: MeshResolver = package_resolver, virtual_joints: Sequence[VirtualJoint] = ()
) -> UrdfDocument:
    """Parses a URDF and prepares it for Pinocchio.

    Args:
        text: URDF document with expanded xacro.
        resolve: Returns the file path of a mesh URI.
        virtual_joints: Virtual joints of the SRDF; a joint that moves the root link is added to the tree.

    Raises:
        ModelError: Invalid XML, a DOCTYPE, an invalid number, no unique root link, an unsupported joint type or an
            unreadable mesh.
    """
    try:
        robot = read_urdf(text, "URDF")
    except AttributeFault as error:
        raise ModelError(str(error)) from error
    except xml_text.XmlError as error:
        raise ModelError(f"{error} (is robot_description loaded, and its xacro expanded?)") from error
    _check_kinds(robot)
    mimics, notes = _mimics(robot)
    roots = robot.root_links()
    if len(roots) != 1:
        raise ModelError(f"URDF: {len(roots)} links without a parent joint ({', '.join(roots)}); exactly one is needed")
    links = tuple(link.name for link in robot.links)
    base, ignored = multi_dof_joint(virtual_joints, roots[0], links)
    variables = base.chain() if base else ()
    joints = (*variables, *robot.joints)
    return UrdfDocument(
        xml=_xml_for_pinocchio(text, variables),
        robot_name=robot.name,
        root_link=roots[0],
        links=links,
        joint_parents={joint.name: joint.parent for joint in joints},
        joint_children={joint.name: joint.child for joint in joints},
        joint_kinds={joint.name: joint.kind for joint in joints},
        mimics=mimics,
        visual_meshes={link.name: tuple(_visual_meshes(link)) for link in robot.links},
        visual_shapes={link.name: tuple(_visual_shapes(link)) for link in robot.links},
        collisions={link.name: tuple(_collisions(link, resolve)) for link in robot.links},
        notes=(*notes, *ignored),
        multi_dof_joint=base,
        limits={joint.name: described_limits(joint) for joint in robot.movable_joints()},
    )
