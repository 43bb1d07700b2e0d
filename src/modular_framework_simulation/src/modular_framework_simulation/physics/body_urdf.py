# SPDX-License-Identifier: BSD-3-Clause
"""Writes a model as URDF for the physics engine.

The engine's URDF loader supports inertia tensors, compound shapes, joint limits and meshes in one call, unlike its
function interface. A static model becomes a single link with the shapes of all its links.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.joint_trees import JointTree, joint_trees
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.solid_inertia import along_principal_axes, is_impossible, principal_moments
from modular_framework_simulation.models.visual_meshes import VisualMeshes
from modular_framework_urdf.rotations import rpy_from_quaternion

_NO_LIMIT = 1e3
"""Replacement for a missing limit of a joint with one limit, or of a prismatic joint [rad or m]."""

STATIC_LINK = "static"
"""Name of the single link of a static model in the URDF."""


@dataclass(frozen=True, slots=True)
class BodyUrdf:
    """Model as URDF for the engine.

    Attributes:
        text: URDF text.
        root_in_model: Pose of the URDF's root link in the model frame.
        fixed: Whether the root link is fixed to the world.
        frame_in_link: Pose of the URDF's link frame in the model's link frame, by link name.
        further: Other trees of a model whose joints do not connect all links.
    """

    text: str
    root_in_model: Pose
    fixed: bool
    frame_in_link: dict[str, Pose]
    further: tuple[BodyUrdf, ...] = ()


def model_to_urdf(model: specs.Model, convex_parts: ConvexParts, with_visuals: bool, concave: bool = True) -> BodyUrdf:
    """Converts a model to URDF.

    Args:
        model: Description of the model; its pose has no effect.
        convex_parts: Converter of meshes for the engine.
        with_visuals: Whether to write visual shapes, for a window.
        concave: Whether meshes of a static model are kept exactly; otherwise, convex parts replace them.

    Raises:
        DescriptionError: A mesh is unsupported or invalid.
    """
    writer = _Writer(convex_parts, with_visuals)
    if model.static:
        shapes = [writer.shapes(link, link.pose, exact=concave) for link in model.links]
        body = f'<link name="{STATIC_LINK}">{"".join(shapes)}</link>'
        return BodyUrdf(_robot(model.name, [body]), Pose(), True, {})
    first, *further = [_tree_to_urdf(model, tree, writer) for tree in joint_trees(model)]
    return dataclasses.replace(first, further=tuple(further))


def _tree_to_urdf(model: specs.Model, tree: JointTree, writer: _Writer) -> BodyUrdf:
    # A URDF link frame is at the parent joint, an SDF link frame is arbitrary; `frame_in_link` is their transform.
    frame_in_link = {name: Pose() for name in (specs.WORLD, *tree.links)}
    frame_in_link.update({joint.child: joint.pose for joint in tree.joints})
    poses = {link.name: link.pose for link in model.links} | {specs.WORLD: Pose()}
    links = {link.name: link for link in model.links}
    parts = [f"<link name={quoteattr(specs.WORLD)}/>"] if tree.root == specs.WORLD else []
    for name in tree.links:
        shift = frame_in_link[name].inverse()
        inertial, shapes = writer.inertial(links[name], shift), writer.shapes(links[name], shift, exact=False)
        parts.append(f"<link name={quoteattr(name)}>{inertial}{shapes}</link>")
    for joint in tree.joints:
        parent_frame = poses[joint.parent] @ frame_in_link[joint.parent]
        parts.append(_joint(joint, parent_frame.inverse() @ poses[joint.child] @ joint.pose))
    return BodyUrdf(_robot(model.name, parts), poses[tree.root], tree.root == specs.WORLD, frame_in_link)


class _Writer:
    def __init__(self, convex_parts: ConvexParts, with_visuals: bool) -> None:
        self._convex_parts = convex_parts
        self._visual_meshes = VisualMeshes(convex_parts.cache_folder)
        self._with_visuals = with_visuals

    def shapes(self, link: specs.Link, shift: Pose, exact: bool) -> str:
        """Writes the shapes of a link.

        Args:
            link: The link.
            shift: Pose of the link frame in the URDF's link frame.
            exact: Whether meshes keep their exact triangles.
        """
        text = ""
        for collision in link.collisions:
            for geometry, attributes in self._collision_geometries(collision.geometry, exact):
                text += f"<collision{attributes}>{_origin(shift @ collision.pose)}{geometry}</collision>"
        if self._with_visuals:
            for index, visual in enumerate(link.visuals):
                for part, (geometry, colour) in enumerate(self._visual_geometries(visual)):
                    rgba = " ".join(f"{value:g}" for value in colour)
                    material = f'<material name={quoteattr(f"{link.name}_{index}_{part}")}><color rgba="{rgba}"/>'
                    text += f"<visual>{_origin(shift @ visual.pose)}{geometry}{material}</material></visual>"
        return text

    def _visual_geometries(self, visual: specs.Visual) -> Iterable[tuple[str, specs.Colour]]:
        if visual.texture is not None or isinstance(visual.geometry, specs.Mesh | specs.Plane):
            return [(_mesh_file(str(part.file)), part.colour) for part in self._visual_meshes.parts(visual)]
        return [(_geometry(visual.geometry), visual.colour)]

    def inertial(self, link: specs.Link, shift: Pose) -> str:
        """Writes the mass properties of a link.

        Args:
            link: The link.
            shift: Pose of the link frame in the URDF's link frame.
        """
        inertial = link.inertial or specs.Inertial(Pose(), 1.0, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
        if is_impossible(
            principal_moments(inertial.inertia)
        ):  # the engine accepts the moments of such a link, but no products of inertia
            inertial = along_principal_axes(inertial)
        names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        moments = " ".join(f'{name}="{value!r}"' for name, value in zip(names, inertial.inertia, strict=True))
        return (
            f"<inertial>{_origin(shift @ inertial.pose)}"
            f'<mass value="{inertial.mass!r}"/><inertia {moments}/></inertial>'
        )

    def _collision_geometries(self, geometry: specs.Geometry, exact: bool) -> Iterable[tuple[str, str]]:
        if isinstance(geometry, specs.Mesh):
            if exact:
                return [(_mesh_file(str(self._convex_parts.exact(geometry))), ' concave="yes"')]
            return [(_mesh_file(str(file)), "") for file in self._convex_parts.parts(geometry)]
        return [(_geometry(geometry), "")]


def _robot(name: str, parts: list[str]) -> str:
    return f'<?xml version="1.0"?>\n<robot name={quoteattr(name)}>\n' + "\n".join(parts) + "\n</robot>\n"


def _joint(joint: specs.Joint, pose_in_parent: Pose) -> str:
    kind, limit = "spherical" if joint.kind is specs.JointType.BALL else joint.kind.value, ""
    if joint.kind in (specs.JointType.REVOLUTE, specs.JointType.PRISMATIC):
        lower, upper = joint.lower, joint.upper
        if kind == "revolute" and not (math.isfinite(lower) or math.isfinite(upper)):
            kind = "continuous"
        else:
            bounds = (max(lower, -_NO_LIMIT), min(upper, _NO_LIMIT))
            limit = f'<limit lower="{bounds[0]!r}" upper="{bounds[1]!r}" effort="0" velocity="100"/>'
    axis = " ".join(repr(value) for value in joint.axis)
    return (
        f'<joint name={quoteattr(joint.name)} type="{kind}">{_origin(pose_in_parent)}'
        f"<parent link={quoteattr(joint.parent)}/><child link={quoteattr(joint.child)}/>"
        f'<axis xyz="{axis}"/>{limit}</joint>'
    )


def _origin(pose: Pose) -> str:
    xyz = " ".join(repr(value) for value in pose.position)
    rpy = " ".join(repr(value) for value in rpy_from_quaternion(pose.quaternion))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'


def _mesh_file(path: str) -> str:
    return f"<geometry><mesh filename={quoteattr(path)}/></geometry>"


def _geometry(geometry: specs.Geometry) -> str:
    match geometry:
        case specs.Box(size=(x, y, z)):
            shape = f'<box size="{x!r} {y!r} {z!r}"/>'
        case specs.Cylinder(radius=radius, length=length):
            shape = f'<cylinder radius="{radius!r}" length="{length!r}"/>'
        case specs.Sphere(radius=radius):
            shape = f'<sphere radius="{radius!r}"/>'
        case specs.Plane(normal=(x, y, z)):
            shape = f'<plane normal="{x!r} {y!r} {z!r}"/>'
        case specs.Mesh(path=path, scale=(x, y, z)):
            shape = f'<mesh filename={quoteattr(str(path))} scale="{x!r} {y!r} {z!r}"/>'
    return f"<geometry>{shape}</geometry>"
