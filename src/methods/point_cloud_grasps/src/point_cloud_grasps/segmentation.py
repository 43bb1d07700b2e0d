# SPDX-License-Identifier: BSD-3-Clause
"""Finds in points what things stand on, and which of the points belong together."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

THINNED_M = 0.002
"""Points that are nearer to each other than this are as one: half of what grasps need to know of a surface."""
PLANE_TRIALS, PLANE_SAMPLES = 200, 3000
"""Planes that are tried, and points that each is judged by."""
PLANE_TOLERANCE_M = 0.006
STEEPEST_COSINE = math.cos(math.radians(10.0))
"""What things stand on is level within this angle."""
LONELY_SPACINGS, LEAST_NEIGHBOURS = 3.0, 4
"""A point with fewer other points within so many spacings is not one of a surface."""


@dataclass(frozen=True, slots=True)
class SupportPlane:
    """What things stand on.

    Attributes:
        normal: (3,) unit vector upwards.
        offset: normal . point of the points on it [m].
    """

    normal: Array
    offset: float

    def heights(self, points: Array) -> Array:
        """Returns how far points (n, 3) are above the plane (n,) [m]."""
        return points @ self.normal - self.offset

    def z_at(self, x: float, y: float) -> float:
        """Returns z of the plane at a place [m]."""
        return float((self.offset - self.normal[0] * x - self.normal[1] * y) / self.normal[2])


def thinned(points: Array) -> Array:
    """Returns the middle of the points (n, 3) in each cube of 2 mm."""
    if not len(points):
        return points
    cubes = np.floor((points - points.min(axis=0)) / THINNED_M).astype(np.int64)
    sizes = cubes.max(axis=0) + 1
    keys = (cubes[:, 0] * sizes[1] + cubes[:, 1]) * sizes[2] + cubes[:, 2]  # one number sorts faster than three
    _, which, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, which, points)
    return sums / counts[:, None]


def find_support(points: Array, generator: np.random.Generator) -> SupportPlane | None:
    """Finds the level plane on which most points lie: RANSAC, then a least-squares fit.

    Args:
        points: (n, 3) points on and around it [m].
        generator: Source of all random choices.

    Returns:
        The plane; None when there are too few points for one.
    """
    if len(points) < 3:
        return None
    corners = points[generator.integers(len(points), size=(PLANE_TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals[lengths > 0] /= lengths[lengths > 0, None]
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    level = normals[:, 2] >= STEEPEST_COSINE
    if not level.any():
        return None
    normals, origins = normals[level], corners[level, 0]
    judges = points[generator.permutation(len(points))[:PLANE_SAMPLES]]
    offsets = (normals * origins).sum(axis=1)
    best = int(np.argmax((np.abs(judges @ normals.T - offsets) <= PLANE_TOLERANCE_M).sum(axis=0)))
    inliers = points[np.abs(points @ normals[best] - offsets[best]) <= PLANE_TOLERANCE_M]
    middle = inliers.mean(axis=0)
    normal = np.linalg.svd(inliers - middle, full_matrices=False)[2][2] if len(inliers) > 3 else normals[best]
    normal = normal if normal[2] > 0.0 else -normal
    return SupportPlane(normal, float(normal @ middle)) if normal[2] >= STEEPEST_COSINE else None


def point_spacing(points: Array) -> float:
    """Returns the usual distance of a point (n, 3) from its nearest neighbour [m]; 2 mm at least."""
    if len(points) < 2:
        return THINNED_M
    distances, _ = cKDTree(points).query(points, k=2)
    return max(THINNED_M, float(np.median(distances[:, 1])))


def has_neighbours(points: Array, spacing: float) -> Mask:
    """Returns which points (n, 3) are among others of a surface whose points are so far apart [m]."""
    tree = cKDTree(points)
    counts = tree.query_ball_point(points, LONELY_SPACINGS * spacing, return_length=True)
    return np.asarray(counts > LEAST_NEIGHBOURS)


def clusters(points: Array, distance: float) -> npt.NDArray[np.int64]:
    """Numbers the groups of points (n, 2) or (n, 3) with gaps of less than a distance [m] between them: (n,) from 0."""
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.int64)
