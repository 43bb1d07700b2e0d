# SPDX-License-Identifier: BSD-3-Clause
"""Segments a point cloud into the support plane and clusters."""

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

VOXEL_SIZE_M = 0.002
"""Edge length of the downsampling voxels; grasps need the surface at twice this resolution."""
PLANE_TRIALS, PLANE_SAMPLES = 200, 3000
"""Number of tested planes, and number of points that score each plane."""
PLANE_TOLERANCE_M = 0.006
MIN_VERTICAL_COSINE = math.cos(math.radians(10.0))
"""Minimum cosine between the support's normal and the vertical."""
NEIGHBOUR_SPACINGS, MIN_NEIGHBOURS = 3.0, 4
"""Search radius in spacings, and minimum number of neighbours of a surface point."""


@dataclass(frozen=True, slots=True)
class SupportPlane:
    """The plane on which objects stand.

    Attributes:
        normal: Upward unit vector, shape (3,).
        offset: Scalar product of the normal with a point of the plane [m].
    """

    normal: Array
    offset: float

    def heights(self, points: Array) -> Array:
        """Returns the heights (n,) of points (n, 3) above the plane [m]."""
        return points @ self.normal - self.offset

    def z_at(self, x: float, y: float) -> float:
        """Returns the z coordinate of the plane at (x, y) [m]."""
        return float((self.offset - self.normal[0] * x - self.normal[1] * y) / self.normal[2])


def downsample_points(points: Array) -> Array:
    """Returns the mean of the points (n, 3) in each voxel of 2 mm."""
    if not len(points):
        return points
    cubes = np.floor((points - points.min(axis=0)) / VOXEL_SIZE_M).astype(np.int64)
    sizes = cubes.max(axis=0) + 1
    keys = (cubes[:, 0] * sizes[1] + cubes[:, 1]) * sizes[2] + cubes[:, 2]  # faster to sort than three columns
    _, which, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, which, points)
    return sums / counts[:, None]


def find_support(points: Array, generator: np.random.Generator) -> SupportPlane | None:
    """Fits the level plane with most points: RANSAC followed by a least-squares fit.

    Args:
        points: Points on and around the plane, shape (n, 3) [m].
        generator: Random number generator.

    Returns:
        The plane; None if there are too few points.
    """
    if len(points) < 3:
        return None
    corners = points[generator.integers(len(points), size=(PLANE_TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals[lengths > 0] /= lengths[lengths > 0, None]
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    level = normals[:, 2] >= MIN_VERTICAL_COSINE
    if not level.any():
        return None
    normals, origins = normals[level], corners[level, 0]
    scoring_points = points[generator.permutation(len(points))[:PLANE_SAMPLES]]
    offsets = (normals * origins).sum(axis=1)
    best = int(np.argmax((np.abs(scoring_points @ normals.T - offsets) <= PLANE_TOLERANCE_M).sum(axis=0)))
    inliers = points[np.abs(points @ normals[best] - offsets[best]) <= PLANE_TOLERANCE_M]
    middle = inliers.mean(axis=0)
    normal = np.linalg.svd(inliers - middle, full_matrices=False)[2][2] if len(inliers) > 3 else normals[best]
    normal = normal if normal[2] > 0.0 else -normal
    return SupportPlane(normal, float(normal @ middle)) if normal[2] >= MIN_VERTICAL_COSINE else None


def point_spacing(points: Array) -> float:
    """Returns the median distance between a point (n, 3) and its nearest neighbour [m], at least 2 mm."""
    if len(points) < 2:
        return VOXEL_SIZE_M
    distances, _ = cKDTree(points).query(points, k=2)
    return max(VOXEL_SIZE_M, float(np.median(distances[:, 1])))


def has_neighbours(points: Array, spacing: float) -> Mask:
    """Returns whether each point (n, 3) has enough neighbours for a surface with a point spacing [m]."""
    tree = cKDTree(points)
    counts = tree.query_ball_point(points, NEIGHBOUR_SPACINGS * spacing, return_length=True)
    return np.asarray(counts > MIN_NEIGHBOURS)


def cluster_labels(points: Array, distance: float) -> npt.NDArray[np.int64]:
    """Returns the cluster index (n,) of points (n, 2) or (n, 3) for a maximum gap inside a cluster [m]."""
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.int64)
