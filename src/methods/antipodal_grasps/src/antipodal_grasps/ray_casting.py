# SPDX-License-Identifier: BSD-3-Clause
"""Cuts straight lines with closed meshes, after Moeller and Trumbore (1997)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modular_framework_urdf.mesh_reader import TriangleMesh

Array = npt.NDArray[np.float64]

ROUNDING = 1e-9
"""A line meets no triangle to whose plane it is parallel within this, and goes through one that it passes this near."""
BATCH = 2_000_000
"""Pairs of a line and a triangle that are computed at once."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """Where a line goes through a triangle.

    Attributes:
        distance: From the line's origin along its direction [m]; negative behind it.
        normal: (3,) outward unit normal of the triangle.
        enters: Whether the line goes into the solid there.
    """

    distance: float
    normal: Array
    enters: bool


def lines_through(mesh: TriangleMesh, origins: Array, directions: Array) -> list[list[Crossing]]:
    """Returns where each line crosses triangles of a mesh, in order along the line.

    Args:
        mesh: Triangles, counter-clockwise seen from outside.
        origins: (n, 3) a point of each line [m].
        directions: (n, 3) unit vectors.
    """
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    corners, normals = corners[lengths > 0.0], normals[lengths > 0.0]
    units = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    found: list[list[Crossing]] = []
    batch = max(1, BATCH // max(1, len(corners)))
    for start in range(0, len(origins), batch):
        along = directions[start : start + batch]
        distances, hits = _cut(corners, normals, origins[start : start + batch], along)
        for row in range(len(along)):
            numbers = np.flatnonzero(hits[row])
            numbers = numbers[np.argsort(distances[row, numbers], kind="stable")]
            found.append(
                [
                    Crossing(float(distances[row, number]), units[number], bool(units[number] @ along[row] < 0.0))
                    for number in numbers
                ]
            )
    return found


def _cut(corners: Array, normals: Array, origins: Array, directions: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Returns distances and whether there is a crossing, both of shape (lines, triangles).

    Every triple product is one product of matrices: det[o - c, d, e] = e . (o x d) - d . (e x c).
    """
    corner, first, second = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    facing = directions @ normals.T
    parallel = np.abs(facing) < ROUNDING * np.linalg.norm(normals, axis=1)
    inverse = -1.0 / np.where(parallel, 1.0, facing)
    moments = np.cross(origins, directions)
    u = (moments @ second.T - directions @ np.cross(second, corner).T) * inverse
    v = (directions @ np.cross(first, corner).T - moments @ first.T) * inverse
    distances = (origins @ normals.T - (corner * normals).sum(axis=1)) * inverse
    return distances, ~parallel & (u >= -ROUNDING) & (v >= -ROUNDING) & (u + v <= 1.0 + ROUNDING)
