# SPDX-License-Identifier: BSD-3-Clause
"""Converts the shapes of objects to closed triangle meshes, for methods that cast rays or compute distances."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from modular_framework_urdf.mesh_reader import TriangleMesh

Array = npt.NDArray[np.float64]

ROUND_SIDES = 64
SPHERE_DIVISIONS = 3
"""Subdivisions of a sphere: 1,280 triangles, whose normals deviate by at most 4 degrees."""


def box(size: Sequence[float]) -> TriangleMesh:
    """Returns a box around the origin with the lengths `size` along x, y, z [m]."""
    return _scale_mesh(_unit("box"), size)


def cylinder(height: float, radius: float) -> TriangleMesh:
    """Returns a cylinder along z around the origin [m], as an inscribed prism with 64 sides."""
    return _scale_mesh(_unit("cylinder"), (radius, radius, height))


def cone(height: float, radius: float) -> TriangleMesh:
    """Returns a cone along z with the tip up [m]; the origin is at half the height."""
    return _scale_mesh(_unit("cone"), (radius, radius, height))


def sphere(radius: float) -> TriangleMesh:
    """Returns a sphere around the origin [m]."""
    return _scale_mesh(_unit("sphere"), (radius, radius, radius))


def outward(mesh: TriangleMesh) -> TriangleMesh:
    """Returns a closed mesh with triangles that are counter-clockwise seen from outside."""
    corners = mesh.vertices[mesh.triangles]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return mesh if volume >= 0.0 else TriangleMesh(mesh.vertices, mesh.triangles[:, ::-1])


def move_mesh(mesh: TriangleMesh, rotation: Array, translation: Array) -> TriangleMesh:
    """Returns a mesh after a rigid motion.

    Args:
        mesh: Mesh to move.
        rotation: Rotation matrix (3, 3).
        translation: Translation (3,) [m].
    """
    return TriangleMesh(mesh.vertices @ rotation.T + translation, mesh.triangles)


def join_meshes(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Concatenates meshes; overlapping solids are not merged."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return TriangleMesh(
        np.vstack([mesh.vertices for mesh in meshes]),
        np.vstack([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]),
    )


def _scale_mesh(mesh: TriangleMesh, factors: Sequence[float]) -> TriangleMesh:
    return TriangleMesh(mesh.vertices * np.array(factors, dtype=float), mesh.triangles)


@functools.cache
def _unit(kind: str) -> TriangleMesh:
    """Returns a cached shape of radius or length 1."""
    import trimesh  # slow to load

    match kind:
        case "box":
            mesh = trimesh.creation.box((1.0, 1.0, 1.0))
        case "cylinder":
            mesh = trimesh.creation.cylinder(1.0, 1.0, sections=ROUND_SIDES)
        case "cone":
            mesh = trimesh.creation.cone(1.0, 1.0, sections=ROUND_SIDES)
            mesh.apply_translation([0.0, 0.0, -0.5])
        case _:
            mesh = trimesh.creation.icosphere(SPHERE_DIVISIONS, 1.0)
    return TriangleMesh(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))
