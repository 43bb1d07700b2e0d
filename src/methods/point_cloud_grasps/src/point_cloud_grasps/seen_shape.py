# SPDX-License-Identifier: BSD-3-Clause
"""Completes the part of an object that a camera sees from above to a surface with normals.

A camera above a table sees the tops of objects and little of their sides. Each visible point is taken as the top of a
column that extends down to the support. The columns fill a grid of cells; after smoothing with a Gaussian, the
occupancy falls from 1 inside to 0 outside. The surface is at 1/2, and its normal opposes the gradient. The result does
not depend on the order of the points or the view point, and averages noise over the width of the Gaussian.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from modular_framework_core.grasp_generation.surface_points import Surface

Array = npt.NDArray[np.float64]

CELL_M = 0.002
MAX_CELLS = 150
"""Number of cells along the longest side, above which the cells are larger."""
MARGIN = 4
"""Number of empty cells around the object and filled cells below the support, to avoid border effects."""
COLUMN_SPACINGS = 0.75
"""Column radius: half the diagonal of a square grid of points plus a margin, so that columns leave no holes."""
SMOOTH_SPACINGS = 1.6
"""Standard deviation of the Gaussian."""


@dataclass(frozen=True, slots=True)
class SeenShape:
    """The surface of an object completed from a point cloud.

    Attributes:
        surface: Surface points with normals.
        unseen_m: Depth of each point below the visible surface, shape (n,) [m].
    """

    surface: Surface
    unseen_m: Array


def completed_shape(points: Array, spacing: float, support_z: float) -> SeenShape:
    """Completes the points of an object down to its support.

    Args:
        points: Surface points in a frame with z upwards, none below the support, shape (n, 3) with n >= 1 [m].
        spacing: Distance between neighbouring points [m].
        support_z: Height of the support [m].
    """
    size = max(float(np.ptp(points, axis=0).max()), float(points[:, 2].max()) - support_z)
    cell = max(CELL_M, size / MAX_CELLS)
    tops, low = _column_tops(points, COLUMN_SPACINGS * spacing, cell, support_z)
    filled = _filled_cells(tops, cell, support_z)
    sigma = max(SMOOTH_SPACINGS * spacing / cell, 1.0)
    smooth = ndimage.gaussian_filter(filled, sigma, mode="nearest")
    inside = smooth >= 0.5
    border = np.argwhere(inside & ~ndimage.binary_erosion(inside, border_value=1))
    slopes = np.stack(
        [
            ndimage.gaussian_filter(
                filled, sigma, order=tuple(int(axis == derivative_axis) for derivative_axis in range(3)), mode="nearest"
            )[tuple(border.T)]
            for axis in range(3)
        ],
        axis=1,
    )
    steepness = np.linalg.norm(slopes, axis=1)
    clear = steepness > 1e-6
    border, slopes, steepness = border[clear], slopes[clear], steepness[clear]
    normals = -slopes / steepness[:, None]
    # a step smoothed with a Gaussian has the cumulative normal distribution of the distance from the step
    beyond = _standard_quantile(smooth[tuple(border.T)]) * sigma
    offsets = np.array([*low, support_z - MARGIN * cell]) + cell / 2
    positions = border * cell + offsets + normals * (beyond * cell)[:, None]
    is_above_support = positions[:, 2] >= support_z
    edges = np.where(tops > support_z, tops, ndimage.maximum_filter(tops, 3))
    unseen = np.maximum(0.0, edges[border[:, 0], border[:, 1]] - positions[:, 2])
    volume, centroid = _solid(filled, cell, offsets, support_z)
    return SeenShape(
        Surface(positions[is_above_support], normals[is_above_support], volume, centroid, np.zeros((0, 3))),
        unseen[is_above_support],
    )


def _column_tops(points: Array, radius: float, cell: float, support_z: float) -> tuple[Array, Array]:
    """Returns the top (i, j) of each column [m], the support where it is empty, and the grid origin (2,) [m]."""
    reach = math.ceil(radius / cell)
    low = points[:, :2].min(axis=0) - (MARGIN + reach) * cell
    shape = np.ceil((points[:, :2].max(axis=0) - low) / cell).astype(int) + MARGIN + reach + 1
    tops = np.full(shape, support_z)
    point_cells = np.floor((points[:, :2] - low) / cell).astype(int)
    for shift in np.ndindex(2 * reach + 1, 2 * reach + 1):
        cells = point_cells + shift - reach
        near = np.linalg.norm((cells + 0.5) * cell + low - points[:, :2], axis=1) <= radius
        near |= (cells == point_cells).all(axis=1)
        np.maximum.at(tops, tuple(cells[near].T), points[near, 2])
    return tops, low


def _filled_cells(tops: Array, cell: float, support_z: float) -> Array:
    """Returns the occupancy of each cell (i, j, k) from 0 to 1; columns extend below the support."""
    levels = math.ceil((float(tops.max()) - support_z) / cell) + 2 * MARGIN
    bottoms = support_z + (np.arange(levels) - MARGIN) * cell
    filled = np.clip((tops[:, :, None] - bottoms) / cell, 0.0, 1.0)
    filled[tops <= support_z] = 0.0
    return np.asarray(filled)


def _standard_quantile(probability: Array) -> Array:
    from scipy.special import ndtri  # inverse of the standard normal distribution

    return np.asarray(ndtri(np.clip(probability, 1e-3, 1.0 - 1e-3)))


def _solid(filled: Array, cell: float, offsets: Array, support_z: float) -> tuple[float, Array]:
    """Returns the volume [m^3] and the centroid (3,) [m] of the cells above the support."""
    above = filled.copy()
    above[:, :, (np.arange(filled.shape[2]) * cell + offsets[2]) < support_z] = 0.0
    weight = float(above.sum())
    centroid = np.array([above.sum(axis=tuple({0, 1, 2} - {axis})) @ np.arange(above.shape[axis]) for axis in range(3)])
    return weight * cell**3, centroid / weight * cell + offsets
