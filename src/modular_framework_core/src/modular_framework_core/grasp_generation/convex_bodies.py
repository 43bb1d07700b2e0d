# SPDX-License-Identifier: BSD-3-Clause
"""Converts the collision shapes of a URDF to convex bodies, and computes their extent along z."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import rospkg
from scipy.spatial import ConvexHull, QhullError

from modular_framework_urdf.mesh_paths import mesh_path
from modular_framework_urdf.mesh_reader import MeshError, read_mesh
from modular_framework_urdf.robot import Box, Cylinder, MeshFile, PlacedShapes, Sphere, UnknownShape

Array = npt.NDArray[np.float64]

ROUND_SIDES = 24
MIN_SLOPE = 1e-9
MESH_TOLERANCE_M = 1.0e-3
"""Maximum distance of the convex body from the hull of its mesh; limits the number of faces of rounded meshes."""


class ShapeError(ValueError):
    """A collision shape is unusable; the message completes a sentence whose subject is the shape."""


@dataclass(frozen=True, slots=True)
class ConvexBody:
    """Convex body.

    Attributes:
        corners: Corners, shape (k, 3) [m].
        planes: Outward unit normal and offset of each face, shape (m, 4); inside, normal . point + offset <= 0.
    """

    corners: Array
    planes: Array

    def transformed(self, transform: Array) -> ConvexBody:
        """Returns the body after a transform of shape (4, 4)."""
        normals = self.planes[:, :3] @ transform[:3, :3].T
        offsets = self.planes[:, 3] - normals @ transform[:3, 3]
        return ConvexBody(self.corners @ transform[:3, :3].T + transform[:3, 3], np.column_stack([normals, offsets]))


def convex_hull(points: Array, tolerance_m: float = 0.0) -> ConvexBody:
    """Computes the convex hull of points.

    Args:
        points: At least four points that are not in one plane, shape (n, 3) [m].
        tolerance_m: Maximum distance of the faces from the exact hull [m]; a larger tolerance gives fewer faces.

    Raises:
        ShapeError: All points lie in one plane.
    """
    try:
        hull = ConvexHull(points, qhull_options=f"Qt W{tolerance_m}" if tolerance_m else "Qt")
    except QhullError as error:
        raise ShapeError(f"has no volume: {len(points)} points, all in one plane; a solid is needed") from error
    planes = np.unique(np.round(hull.equations, 12), axis=0)
    if tolerance_m:  # the points that Qhull omitted are outside its faces
        planes[:, 3] = -(planes[:, :3] @ points.T).max(axis=1)
    return ConvexBody(points[hull.vertices], planes)


def collision_body(collision: PlacedShapes) -> ConvexBody:
    """Returns the convex body of a URDF collision element in the frame of the shape.

    A cylinder or sphere is enclosed by a polyhedron with 24 sides. A mesh is enclosed by its convex hull with a
    tolerance of 1 mm.

    Raises:
        ShapeError: The element has no known shape, or its mesh cannot be read.
    """
    match collision.shapes[0] if collision.shapes else UnknownShape("missing"):
        case Box(size):
            return convex_hull(_corners_of_box(_positive("size", size)))
        case Cylinder(radius, length):
            _positive("radius", (radius,))
            _positive("length", (length,))
            return convex_hull(_around_cylinder(radius, length))
        case Sphere(radius):
            _positive("radius", (radius,))
            return convex_hull(_around_sphere(radius))
        case MeshFile() as mesh:
            return convex_hull(_mesh_vertices(mesh), MESH_TOLERANCE_M)
        case other:
            raise ShapeError(f"is {other.tag!r}; allowed: box, cylinder, sphere, mesh")


def max_z_on_lines(planes: Array, lines_xy: Array, margin: float) -> Array:
    """Computes the maximum z of convex bodies on lines parallel to z.

    Args:
        planes: Faces of n bodies with m faces each, shape (n, m, 4); see ConvexBody.
        lines_xy: x and y of the lines, shape (k, 2) [m].
        margin: Distance by which each face is moved outwards before the computation [m].

    Returns:
        Maximum z, shape (n, k) [m]; -inf if a line misses the body.
    """
    level = planes[:, :, :2] @ lines_xy.T + planes[:, :, 3:] - margin  # (n, m, k); inside: level + normal_z z <= 0
    slope = planes[:, :, 2:3]
    bound = -level / np.where(np.abs(slope) > MIN_SLOPE, slope, 1.0)
    high = np.where(slope > MIN_SLOPE, bound, np.inf).min(axis=1)
    low = np.where(slope < -MIN_SLOPE, bound, -np.inf).max(axis=1)
    beside = ((np.abs(slope) <= MIN_SLOPE) & (level > 0.0)).any(axis=1)
    return np.where(beside | (low > high), -np.inf, high)


def _positive(name: str, values: tuple[float, ...]) -> tuple[float, ...]:
    if not all(0.0 < value < math.inf for value in values):
        text = " ".join(f"{value:g}" for value in values)
        raise ShapeError(f"has the {name} '{text}'; allowed: numbers above 0")
    return values


def _corners_of_box(size: tuple[float, ...]) -> Array:
    return np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * size


def _around_cylinder(radius: float, length: float) -> Array:
    angles = np.arange(ROUND_SIDES) * 2 * math.pi / ROUND_SIDES
    ring = radius / math.cos(math.pi / ROUND_SIDES) * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.vstack([np.column_stack([ring, np.full(ROUND_SIDES, z)]) for z in (-length / 2, length / 2)])


def _around_sphere(radius: float) -> Array:
    rings = np.arange(ROUND_SIDES // 2 + 1) * 2 * math.pi / ROUND_SIDES - math.pi / 2
    angles = np.arange(ROUND_SIDES) * 2 * math.pi / ROUND_SIDES
    latitude, longitude = (grid.ravel() for grid in np.meshgrid(rings, angles))
    outer_radius = radius / math.cos(math.pi / ROUND_SIDES) ** 2
    directions = [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    return outer_radius * np.column_stack(directions)


def _mesh_vertices(mesh: MeshFile) -> Array:
    try:
        return read_mesh(mesh_path(mesh.uri, rospkg.RosPack().get_path), mesh.scale).vertices
    except MeshError as error:
        raise ShapeError(f"is the mesh '{mesh.uri}', which cannot be used: {error}") from error
