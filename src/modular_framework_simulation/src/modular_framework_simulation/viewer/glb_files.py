# SPDX-License-Identifier: BSD-3-Clause
"""Converts visible shapes to binary glTF for browsers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.drawn_bodies import DrawnBody
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Colour, Visual
from modular_framework_simulation.models.visual_meshes import drawn_bodies_of
from modular_framework_urdf.rotations import rotate_vector

_CREASE_RAD = math.radians(30)
"""Minimum angle between faces whose common edge is drawn sharp."""
_GAMMA = 2.2
"""Exponent of the conversion from screen colours in descriptions to linear colours in glTF."""
_ROUGHNESS = 0.8

PlacedBody = tuple[Pose, DrawnBody]
"""A body and its pose in the link frame."""


def bodies_of_visuals(visuals: Sequence[Visual], log: Callable[[str], None]) -> list[PlacedBody]:
    """Returns the bodies of a link's visual shapes; shapes that cannot be read are logged."""
    bodies: list[PlacedBody] = []
    for visual in visuals:
        try:
            bodies += [(visual.pose, body) for body in drawn_bodies_of(visual)]
        except DescriptionError as error:
            log(f"the visual '{visual.name}' is not drawn: {error}")
    return bodies


def glb_of(bodies: Iterable[PlacedBody], tint: Colour | None = None, outset_m: float = 0.0) -> bytes | None:
    """Converts bodies to binary glTF; returns None without bodies.

    Args:
        bodies: Bodies with their poses.
        tint: Colour of all bodies; None for the bodies' own colours.
        outset_m: Outward displacement of the surfaces [m]. A positive value makes them visible around other surfaces in
            the same place, a negative value hides them.
    """
    import trimesh.exchange.gltf

    gltf: Any = trimesh.exchange.gltf
    scene = trimesh.Scene()
    for pose, body in bodies:
        if len(body.triangles):
            scene.add_geometry(_mesh(body, tint, outset_m), transform=pose_matrix(pose))
    if not scene.geometry:
        return None
    content: bytes = gltf.export_glb(scene, include_normals=True)
    return content


def pose_matrix(pose: Pose) -> NDArray[np.float64]:
    """Returns a pose as a homogeneous transform, shape (4, 4)."""
    matrix = np.eye(4)
    for column, axis in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))):
        matrix[:3, column] = rotate_vector(pose.quaternion, axis)
    matrix[:3, 3] = pose.position
    return matrix


def _mesh(body: DrawnBody, tint: Colour | None, outset_m: float) -> Any:
    import trimesh

    visuals: Any = trimesh.visual
    has_texture = tint is None and body.image is not None and body.uv is not None
    mesh: Any = trimesh.Trimesh(body.vertices, body.triangles, vertex_normals=body.normals, process=False)
    if body.normals is None and not has_texture:
        mesh.merge_vertices()
        mesh = trimesh.graph.smooth_shade(mesh, angle=_CREASE_RAD)
    if outset_m:
        normals = mesh.vertex_normals
        mesh = trimesh.Trimesh(mesh.vertices + outset_m * normals, mesh.faces, vertex_normals=normals, process=False)
    red, green, blue, alpha = tint or body.colour
    material = visuals.material.PBRMaterial(
        baseColorFactor=(*(min(max(c, 0.0), 1.0) ** _GAMMA for c in (red, green, blue)), min(max(alpha, 0.0), 1.0)),
        baseColorTexture=body.image if has_texture else None,
        alphaMode="BLEND" if alpha < 1.0 else "OPAQUE",
        metallicFactor=0.0,
        roughnessFactor=_ROUGHNESS,
        doubleSided=not trimesh.Trimesh(body.vertices, body.triangles).is_volume,  # back faces of solids are hidden
    )
    uv = body.uv[:, :2] if has_texture and body.uv is not None else None
    mesh.visual = visuals.TextureVisuals(uv=uv, material=material)
    return mesh
