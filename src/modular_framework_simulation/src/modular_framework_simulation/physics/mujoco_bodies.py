# SPDX-License-Identifier: BSD-3-Clause
"""Reads bodies for MuJoCo from the same URDF that PyBullet loads.

The frame of a root link is moved to the centre of mass, along the inertia axes. A free body then rotates about this
point without integration errors. All other links keep the frame of their joint.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import trimesh

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Inertial
from modular_framework_simulation.models.solid_inertia import along_principal_axes, is_impossible
from modular_framework_simulation.physics.physics_engine import (
    BASE_INDEX,
    EngineJoint,
    JointKind,
    Log,
    MassProperties,
)
from modular_framework_urdf import xml_text
from modular_framework_urdf.rotations import Quaternion, Vector3
from modular_framework_urdf.xml_text import Element

_KINDS = {
    "fixed": JointKind.FIXED,
    "revolute": JointKind.REVOLUTE,
    "continuous": JointKind.REVOLUTE,
    "prismatic": JointKind.PRISMATIC,
    "spherical": JointKind.BALL,
}
_TYPES = {
    JointKind.REVOLUTE: mujoco.mjtJoint.mjJNT_HINGE,
    JointKind.PRISMATIC: mujoco.mjtJoint.mjJNT_SLIDE,
    JointKind.BALL: mujoco.mjtJoint.mjJNT_BALL,
}
HARDEST_IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""Impedance of contacts, limits and motors: MuJoCo's maximum. The remaining softness, 0.01 % of the forces that would
move the bodies freely, is not visible in any test."""

CONTACT_MARGIN_M = 1e-3
"""Maximum distance of shapes that may touch in the next step [m]. A light finger driven by its motor moves by a tenth
of this distance per step; without this margin, the finger would repeatedly hit the held object."""

_MOMENT_TOLERANCE = 1e-9
"""Relative tolerance by which a moment of inertia may exceed the sum of the others, due to rounding."""


@dataclass(frozen=True, slots=True)
class Shape:
    """Collision shape.

    Attributes:
        pose: Pose in the frame of the link.
        kind: MuJoCo's type of the shape.
        size: MuJoCo's size parameters [m].
        mesh: File with the vertices of a convex body; empty for other shapes.
        scale: Scale factors of the vertices.
    """

    pose: Pose
    kind: int
    size: Vector3
    mesh: str = ""
    scale: Vector3 = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Link:
    """Link of a body.

    Attributes:
        name: Name in the description.
        parent: Index of the parent link, -1 for the root; None for the root itself.
        pose: Pose of the link frame in the parent link's frame.
        mass: Mass properties, with mass 0 for a fixed root.
        shapes: Collision shapes.
        joint: Joint to the parent link; None for the root.
        axis: Axis of the joint in the link frame.
    """

    name: str
    parent: int | None
    pose: Pose
    mass: MassProperties
    shapes: tuple[Shape, ...]
    joint: EngineJoint | None = None
    axis: Vector3 = (0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class BodyTree:
    """Links of a body: the root first, then the links by index, so that link i is at position i + 1."""

    name: str
    fixed: bool
    links: tuple[Link, ...]


def read_tree(text: str, name: str, fixed: bool, log: Log) -> BodyTree:
    """Reads a body.

    Args:
        text: URDF with absolute mesh paths.
        name: Name of the model for error messages.
        fixed: Whether the root link is fixed to the world.
        log: Function that logs deviations from the description.

    Raises:
        DescriptionError: MuJoCo cannot represent the body.
    """
    root = xml_text.parse(text, f"model '{name}'")
    elements = {element.get("name", ""): element for element in root.findall("link")}
    child_joints: dict[str, list[Element]] = {}
    children = set()
    for joint in root.findall("joint"):
        child_joints.setdefault(joint.find("parent").get("link"), []).append(joint)
        children.add(joint.find("child").get("link"))
    roots = [link for link in elements if link not in children]
    if len(roots) != 1:
        raise DescriptionError(f"model '{name}'", f"has {len(roots)} root links: {roots}", "expected one root link")
    mass, shapes = _matter(elements[roots[0]], name, log)
    if fixed:
        mass = mass._replace(mass=0.0)
    links = [Link(roots[0], parent=None, pose=Pose(), mass=mass, shapes=shapes)]
    pending = [(joint, BASE_INDEX) for joint in reversed(child_joints.get(roots[0], []))]
    while pending:
        element, parent = pending.pop()
        child, index = element.find("child").get("link"), len(links) - 1
        x, y, z = _numbers(element.find("axis"), "xyz", (1.0, 0.0, 0.0))
        joint = _joint(element, index, name)
        mass, shapes = _matter(elements[child], name, log)
        links.append(Link(child, parent, _origin(element), mass, shapes, joint=joint, axis=(x, y, z)))
        pending += [(each, index) for each in reversed(child_joints.get(child, []))]
    return BodyTree(name, fixed, tuple(links))


def _joint(element: Element, index: int, model: str) -> EngineJoint:
    kind, name = _KINDS.get(element.get("type", "")), element.get("name", "")
    if kind is None:
        raise DescriptionError(
            f"model '{model}', joint '{name}'",
            f"is of type '{element.get('type')}'",
            f"allowed with the physics engine mujoco: {', '.join(_KINDS)}",
        )
    limit, dynamics = element.find("limit"), element.find("dynamics")
    lower, upper = -math.inf, math.inf
    if limit is not None and element.get("type") in ("revolute", "prismatic"):
        lower, upper = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
        if lower > upper:
            lower, upper = -math.inf, math.inf
    damping, friction = (0.0 if dynamics is None else float(dynamics.get(key, "0")) for key in ("damping", "friction"))
    child = element.find("child").get("link")
    return EngineJoint(
        index=index,
        name=name,
        child_link=child,
        kind=kind,
        lower=lower,
        upper=upper,
        damping=damping,
        friction=friction,
    )


def _matter(element: Element, model: str, log: Log) -> tuple[MassProperties, tuple[Shape, ...]]:
    """Returns the mass and the shapes of a <link>."""
    name = element.get("name", "")
    shapes = tuple(_shape(collision, model, name) for collision in element.findall("collision"))
    return _mass(element.find("inertial"), f"model '{model}', link '{name}'", log), shapes


def _mass(inertial: Element | None, location: str, log: Log) -> MassProperties:
    if inertial is None:  # only a root that is fixed to the world has no inertia
        return MassProperties(0.0, (0.0, 0.0, 0.0), Pose())
    record = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (float(record.get(key, "0")) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    mass = float(inertial.find("mass").get("value"))
    principal = along_principal_axes(Inertial(_origin(inertial), mass, (xx, xy, xz, yy, yz, zz)))
    moments = principal.inertia[0], principal.inertia[3], principal.inertia[5]
    if is_impossible(moments, _MOMENT_TOLERANCE):
        log(
            f"{location}: no rigid body has the moments of inertia {list(moments)}, because the largest exceeds the "
            "sum of the others; MuJoCo rejects them, and their mean is used for all three"
        )
        moments = (sum(moments) / 3.0,) * 3
    return MassProperties(mass, moments, principal.pose)


def _shape(collision: Element, model: str, link: str) -> Shape:
    pose, geometry = _origin(collision), collision.find("geometry")[0]
    kinds = mujoco.mjtGeom
    match geometry.tag:
        case "box":
            x, y, z = _numbers(geometry, "size", (0.0, 0.0, 0.0))
            return Shape(pose, kinds.mjGEOM_BOX, (x / 2, y / 2, z / 2))
        case "cylinder":
            radius, length = float(geometry.get("radius")), float(geometry.get("length"))
            return Shape(pose, kinds.mjGEOM_CYLINDER, (radius, length / 2, 0.0))
        case "sphere":
            return Shape(pose, kinds.mjGEOM_SPHERE, (float(geometry.get("radius")), 0.0, 0.0))
        case "capsule":
            radius, length = float(geometry.get("radius")), float(geometry.get("length"))
            return Shape(pose, kinds.mjGEOM_CAPSULE, (radius, length / 2, 0.0))
        case "plane":
            normal = _numbers(geometry, "normal", (0.0, 0.0, 1.0))
            return Shape(pose @ Pose((0.0, 0.0, 0.0), _rotation_to(normal)), kinds.mjGEOM_PLANE, (0.0, 0.0, 1.0))
        case "mesh":
            x, y, z = _numbers(geometry, "scale", (1.0, 1.0, 1.0))
            return Shape(pose, kinds.mjGEOM_MESH, (0.0, 0.0, 0.0), geometry.get("filename"), (x, y, z))
    raise DescriptionError(
        f"model '{model}', link '{link}'",
        f"has a collision shape <{geometry.tag}>",
        "allowed with the physics engine mujoco: box, capsule, cylinder, mesh, plane, sphere",
    )


def _numbers(element: Element | None, key: str, default: tuple[float, ...]) -> tuple[float, ...]:
    text = None if element is None else element.get(key)
    return default if text is None else tuple(float(word) for word in text.split())


def _origin(element: Element) -> Pose:
    origin, zero = element.find("origin"), (0.0, 0.0, 0.0)
    (x, y, z), (roll, pitch, yaw) = _numbers(origin, "xyz", zero), _numbers(origin, "rpy", zero)
    return Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))


def _rotation_to(normal: Iterable[float]) -> Quaternion:
    """Returns the rotation from the z axis to a direction, as a quaternion xyzw."""
    result = np.zeros(4)
    mujoco.mju_quatZ2Vec(result, np.array(list(normal), dtype=float))
    w, x, y, z = result.tolist()
    return (x, y, z, w)


def wxyz(quaternion: Quaternion) -> tuple[float, float, float, float]:
    """Converts a quaternion to MuJoCo's order."""
    x, y, z, w = quaternion
    return (w, x, y, z)


class SpecWriter:
    """Writes bodies into a MuJoCo model.

    Args:
        spec: Specification of the model.
    """

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self._spec = spec
        self._meshes: dict[tuple[str, Vector3], str] = {}

    def add(self, number: int, tree: BodyTree, centre_in_world: Pose, colliding: frozenset[frozenset[int]]) -> None:
        """Adds a body.

        Args:
            number: Id of the body, which is part of MuJoCo's names.
            tree: Links of the body.
            centre_in_world: Pose of the root link's centre in the world frame.
            colliding: Pairs of link indices that collide with each other; other pairs of the body do not collide.
        """
        bodies: list[mujoco.MjsBody] = []
        for position, link in enumerate(tree.links):
            parent_body = self._spec.worldbody if link.parent is None else bodies[link.parent + 1]
            bodies.append(
                self._add_link(
                    parent_body,
                    link,
                    body_name(number, position - 1),
                    number=number,
                    tree=tree,
                    centre_in_world=centre_in_world,
                )
            )
        link_indices = [position - 1 for position, link in enumerate(tree.links) if link.shapes]
        for first, a in enumerate(link_indices):
            for b in link_indices[first + 1 :]:
                if frozenset((a, b)) not in colliding:
                    self._spec.add_exclude(bodyname1=body_name(number, a), bodyname2=body_name(number, b))

    def weld(self, number: int, index: int, other: int, other_in_link: Pose) -> None:
        """Welds the root link of a body to a link of another body.

        Args:
            number: Id of the body with the link.
            index: Index of the link.
            other: Id of the welded body.
            other_in_link: Pose of the welded body's centre in the frame of the link.
        """
        anchor, torque_scale = (0.0, 0.0, 0.0), 1.0
        self._spec.add_equality(
            type=mujoco.mjtEq.mjEQ_WELD,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1=body_name(number, index),
            name2=body_name(other, -1),
            data=(*anchor, *other_in_link.position, *wxyz(other_in_link.quaternion), torque_scale),
        )

    def _add_link(
        self,
        parent_body: mujoco.MjsBody,
        link: Link,
        name: str,
        *,
        number: int,
        tree: BodyTree,
        centre_in_world: Pose,
    ) -> mujoco.MjsBody:
        centre, pose = link.mass.centre_in_link, link.pose
        shift = Pose()
        if link.parent is None:
            pose, shift, centre = centre_in_world, centre.inverse(), Pose()
        elif link.parent < 0:
            pose = tree.links[0].mass.centre_in_link.inverse() @ pose
        body = parent_body.add_body(name=name, pos=pose.position, quat=wxyz(pose.quaternion))
        if link.mass.mass > 0.0:
            body.explicitinertial = True
            body.mass, body.inertia = link.mass.mass, link.mass.moments
            body.ipos, body.iquat = centre.position, wxyz(centre.quaternion)
        if link.parent is None and not tree.fixed:
            body.add_freejoint(name=joint_name(number, -1))
        if link.joint is not None and link.joint.kind is not JointKind.FIXED:
            self._add_joint(body, link.joint, link.axis, joint_name(number, link.joint.index))
        for shape in link.shapes:
            self._add_shape(body, shape, shift)
        return body

    def _add_joint(self, body: mujoco.MjsBody, joint: EngineJoint, axis: Vector3, name: str) -> None:
        limited = joint.kind is not JointKind.BALL and (math.isfinite(joint.lower) or math.isfinite(joint.upper))
        unlimited = 1e6
        body.add_joint(
            name=name,
            type=_TYPES[joint.kind],
            axis=axis,
            limited=int(limited),
            range=(max(joint.lower, -unlimited), min(joint.upper, unlimited)) if limited else (0.0, 0.0),
            solimp_limit=HARDEST_IMPEDANCE,
            solimp_friction=HARDEST_IMPEDANCE,
        )

    def _add_shape(self, body: mujoco.MjsBody, shape: Shape, shift: Pose) -> None:
        pose = shift @ shape.pose
        options = {"meshname": self._mesh(shape)} if shape.mesh else {"size": shape.size}
        body.add_geom(
            type=shape.kind,
            pos=pose.position,
            quat=wxyz(pose.quaternion),
            condim=6,
            margin=CONTACT_MARGIN_M,
            solimp=HARDEST_IMPEDANCE,
            mass=0.0,
            **options,
        )

    def _mesh(self, shape: Shape) -> str:
        key = (shape.mesh, shape.scale)
        if key not in self._meshes:
            self._meshes[key] = f"mesh_{len(self._meshes)}"
            mesh: Any = trimesh.load(shape.mesh, force="mesh", process=False)
            points = np.asarray(mesh.vertices) * shape.scale
            self._spec.add_mesh(name=self._meshes[key], uservert=points.astype(np.float32).ravel())
        return self._meshes[key]


def body_name(number: int, index: int) -> str:
    """Returns MuJoCo's name of a link."""
    return f"{number}:{index}"


def joint_name(number: int, index: int) -> str:
    """Returns MuJoCo's name of the joint of a link; the index -1 stands for the free joint of the body."""
    return f"{number}:{index}"
