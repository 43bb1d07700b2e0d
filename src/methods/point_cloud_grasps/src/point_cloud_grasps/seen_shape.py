# SPDX-License-Identifier: BSD-3-Clause
"""Completes what a camera sees of an object from above to a surface with normals.

A camera above a table sees the tops of things and little of their sides. What it sees is taken as the upper end of a
column that reaches down to the support. The columns fill a grid of cells; smoothed with a Gaussian, how full a cell is
falls from 1 inside to 0 outside. The surface is where it is 1/2, and its normal is against the gradient. This holds
for any order of the points, needs no view point, and averages noise over the width of the Gaussian.
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
"""Cells along the longest side; larger things have larger cells."""
MARGIN = 4
"""Empty cells around the object, and filled ones below the support, so that the Gaussian sees no border."""
COLUMN_SPACINGS = 0.75
"""Half the diagonal between points of a square grid, and a little more: columns of this radius leave no holes."""
SMOOTH_SPACINGS = 1.6
"""Width of the Gaussian in spacings of the points."""


@dataclass(frozen=True, slots=True)
class SeenShape:
    """The surface of an object, as far as it follows from what was seen.

    Attributes:
        surface: Its points with normals.
        unseen_m: (n,) how far each point is below what was seen above it [m].
    """

    surface: Surface
    unseen_m: Array


def completed_shape(points: Array, spacing: float, support_z: float) -> SeenShape:
    """Completes the points of an object down to its support.

    Args:
        points: (n, 3) on its surface in a frame with z upwards, none below the support [m]; n >= 1.
        spacing: How far neighbouring points are apart [m].
        support_z: Height of what it stands on [m].
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
                filled, sigma, order=tuple(int(axis == other) for other in range(3)), mode="nearest"
            )[tuple(border.T)]
            for axis in range(3)
        ],
        axis=1,
    )
    steepness = np.linalg.norm(slopes, axis=1)
    clear = steepness > 1e-6
    border, slopes, steepness = border[clear], slopes[clear], steepness[clear]
    normals = -slopes / steepness[:, None]
    # of a step smoothed with a Gaussian, so far from the step the value is that of the normal distribution
    beyond = _standard_quantile(smooth[tuple(border.T)]) * sigma
    offsets = np.array([*low, support_z - MARGIN * cell]) + cell / 2
    places = border * cell + offsets + normals * (beyond * cell)[:, None]
    kept = places[:, 2] >= support_z
    edges = np.where(tops > support_z, tops, ndimage.maximum_filter(tops, 3))
    unseen = np.maximum(0.0, edges[border[:, 0], border[:, 1]] - places[:, 2])
    return SeenShape(_surface(places[kept], normals[kept], filled, cell, offsets, support_z), unseen[kept])


def _column_tops(points: Array, radius: float, cell: float, support_z: float) -> tuple[Array, Array]:
    """Returns the top of each column (i, j) [m], that of the support where nothing was seen, and its origin (2,)."""
    reach = math.ceil(radius / cell)
    low = points[:, :2].min(axis=0) - (MARGIN + reach) * cell
    shape = np.ceil((points[:, :2].max(axis=0) - low) / cell).astype(int) + MARGIN + reach + 1
    tops = np.full(shape, support_z)
    own = np.floor((points[:, :2] - low) / cell).astype(int)
    for shift in np.ndindex(2 * reach + 1, 2 * reach + 1):
        at = own + shift - reach
        near = np.linalg.norm((at + 0.5) * cell + low - points[:, :2], axis=1) <= radius
        near |= (at == own).all(axis=1)
        np.maximum.at(tops, tuple(at[near].T), points[near, 2])
    return tops, low


def _filled_cells(tops: Array, cell: float, support_z: float) -> Array:
    """Returns how full each cell (i, j, k) is, from 0 to 1; the columns go on below the support."""
    levels = math.ceil((float(tops.max()) - support_z) / cell) + 2 * MARGIN
    bottoms = support_z + (np.arange(levels) - MARGIN) * cell
    filled = np.clip((tops[:, :, None] - bottoms) / cell, 0.0, 1.0)
    filled[tops <= support_z] = 0.0
    return np.asarray(filled)


def _standard_quantile(share: Array) -> Array:
    from scipy.special import ndtri  # by SciPy's own name: the inverse of the standard normal distribution

    return np.asarray(ndtri(np.clip(share, 1e-3, 1.0 - 1e-3)))


def _surface(points: Array, normals: Array, filled: Array, cell: float, offsets: Array, support_z: float) -> Surface:
    above = filled.copy()
    above[:, :, (np.arange(filled.shape[2]) * cell + offsets[2]) < support_z] = 0.0
    weight = float(above.sum())
    centroid = np.array([above.sum(axis=tuple({0, 1, 2} - {axis})) @ np.arange(above.shape[axis]) for axis in range(3)])
    return Surface(points, normals, weight * cell**3, centroid / weight * cell + offsets, np.zeros((0, 3)))
