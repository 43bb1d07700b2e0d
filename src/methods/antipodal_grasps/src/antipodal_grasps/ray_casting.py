# SPDX-License-Identifier: BSD-3-Clause
"""Intersects straight lines with closed meshes, after Moeller and Trumbore (1997)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modular_framework_urdf.mesh_reader import TriangleMesh

Array = npt.NDArray[np.float64]

TOLERANCE = 1e-9
"""Tolerance for lines parallel to a triangle's plane, and for lines that pass a triangle's edge."""
BATCH = 2_000_000
"""Number of line-triangle combinations that are computed at once."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """Intersection of a line with a triangle.

    Attributes:
        distance: Distance from the line's origin along its direction [m]; negative behind the origin.
        normal: Outward unit normal of the triangle, shape (3,).
        enters: Whether the line enters the solid.
    """

    distance: float
    normal: Array
    enters: bool


def line_crossings(mesh: TriangleMesh, origins: Array, directions: Array) -> list[list[Crossing]]:
    """Returns the intersections of each line with a mesh, in order along the line.

    Args:
        mesh: Triangles, counter-clockwise seen from outside.
        origins: Point of each line, shape (n, 3) [m].
        directions: Unit vectors, shape (n, 3).
    """
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    corners, normals = corners[lengths > 0.0], normals[lengths > 0.0]
    units = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    crossings: list[list[Crossing]] = []
    batch = max(1, BATCH // max(1, len(corners)))
    for start in range(0, len(origins), batch):
        along = directions[start : start + batch]
        distances, hits = _intersect(corners, normals, origins[start : start + batch], along)
        for row in range(len(along)):
            hit_indices = np.flatnonzero(hits[row])
            hit_indices = hit_indices[np.argsort(distances[row, hit_indices], kind="stable")]
            crossings.append(
                [
                    Crossing(float(distances[row, number]), units[number], bool(units[number] @ along[row] < 0.0))
                    for number in hit_indices
                ]
            )
    return crossings


def _intersect(
    corners: Array, normals: Array, origins: Array, directions: Array
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Returns the distances and whether there is an intersection, both of shape (lines, triangles).

    Each triple product is computed as a matrix product: det[o - c, d, e] = e . (o x d) - d . (e x c).
    """
    corner, first, second = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    facing = directions @ normals.T
    parallel = np.abs(facing) < TOLERANCE * np.linalg.norm(normals, axis=1)
    inverse = -1.0 / np.where(parallel, 1.0, facing)
    moments = np.cross(origins, directions)
    u = (moments @ second.T - directions @ np.cross(second, corner).T) * inverse
    v = (directions @ np.cross(first, corner).T - moments @ first.T) * inverse
    distances = (origins @ normals.T - (corner * normals).sum(axis=1)) * inverse
    return distances, ~parallel & (u >= -TOLERANCE) & (v >= -TOLERANCE) & (u + v <= 1.0 + TOLERANCE)
