# SPDX-License-Identifier: BSD-3-Clause
"""Distance field over many solids, compiled: each grid cell stores the solids nearest to its centre.

The field checks a link against all solids of the world at once. A solid's distance from a point is at least its stored
distance from the cell's centre minus the point's distance from that centre. This bound rules out distant solids; near
solids are checked exactly. Cells are filled on first use.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_distance import (
    CLEAR,
    ROUNDING,
    TOO_CLOSE,
    TOUCHING,
    Memory,
    placed_solid_distance,
    relative_pose,
    solid_of,
    surface_to_solid,
)
from modular_framework_planning.collision_detection.kernels.compiled_triangles import Surfaces
from modular_framework_planning.geometry.spatial import Array

NEAREST_SOLIDS = 6  # solids stored per cell


class DistanceField(NamedTuple):
    """Static solids in the planning frame, and the grid over them.

    Attributes:
        kinds: Closed form of each solid, shape (n,).
        sizes: Three parameters of each closed form, shape (n, 3).
        poses: Poses of the solids in the planning frame, shape (n, 3, 4).
        grid: Minimum corner of the grid and edge length of a cell, shape (4,) [m].
        is_filled: Whether each cell is filled, shape (x, y, z).
        nearest: Solids nearest to each cell's centre, nearest first; shape (x, y, z, min(n, NEAREST_SOLIDS)).
        distances: Signed distances of these solids from the centre, negative inside; same shape [m].
    """

    kinds: NDArray[np.int64]
    sizes: Array
    poses: Array
    grid: Array
    is_filled: NDArray[np.bool_]
    nearest: NDArray[np.int32]
    distances: Array


@njit(cache=True, nogil=True)
def _solid_gap(
    kinds: NDArray[np.int64], sizes: Array, poses: Array, solid_index: int, x: float, y: float, z: float
) -> float:
    """Returns the signed distance of the point (x, y, z) from a solid [m]."""
    return placed_solid_distance(solid_of(kinds, sizes, solid_index), poses, solid_index, x, y, z)


@njit(cache=True, nogil=True)
def _fill_cell(
    kinds: NDArray[np.int64],
    sizes: Array,
    poses: Array,
    nearest: NDArray[np.int32],
    distances: Array,
    x: float,
    y: float,
    z: float,
) -> None:
    """Writes the solids nearest to the point (x, y, z), and their signed distances, by insertion sort; shape (k,)."""
    capacity, count = len(nearest), 0
    for solid_index in range(len(kinds)):
        gap = _solid_gap(kinds, sizes, poses, solid_index, x, y, z)
        if count == capacity and gap >= distances[count - 1]:
            continue
        slot = min(count, capacity - 1)
        while slot > 0 and distances[slot - 1] > gap:
            distances[slot], nearest[slot] = distances[slot - 1], nearest[slot - 1]
            slot -= 1
        distances[slot], nearest[slot] = gap, solid_index
        count = min(count + 1, capacity)


@njit(cache=True, nogil=True)
def field_cell(field: DistanceField, x: float, y: float, z: float) -> tuple[int, int, int, float]:
    """Returns the cell that contains a point, after filling the cell if necessary.

    Args:
        field: Distance field.
        x: Coordinate of the point in the field's frame [m].
        y: Coordinate of the point in the field's frame [m].
        z: Coordinate of the point in the field's frame [m].

    Returns:
        The three indices of the cell, the first -1 outside the grid, and the distance of the point from the cell's
        centre [m].
    """
    grid, is_filled = field.grid, field.is_filled
    edge = grid[3]
    u, v, w = (x - grid[0]) / edge, (y - grid[1]) / edge, (z - grid[2]) / edge
    if not (
        0.0 <= u < is_filled.shape[0] and 0.0 <= v < is_filled.shape[1] and 0.0 <= w < is_filled.shape[2]
    ):  # NaN also takes this branch
        return -1, 0, 0, 0.0
    i, j, k = int(u), int(v), int(w)
    cx, cy, cz = grid[0] + (i + 0.5) * edge, grid[1] + (j + 0.5) * edge, grid[2] + (k + 0.5) * edge
    if not is_filled[i, j, k]:
        _fill_cell(field.kinds, field.sizes, field.poses, field.nearest[i, j, k], field.distances[i, j, k], cx, cy, cz)
        is_filled[i, j, k] = True
    return i, j, k, np.sqrt((x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2)


@njit(cache=True, nogil=True)
def field_distance(field: DistanceField, x: float, y: float, z: float, sufficient: float) -> float:
    """Returns a lower bound of a point's signed distance from the nearest solid, exact if below `sufficient` [m].

    Args:
        field: Distance field.
        x: Coordinate of the point in the planning frame [m].
        y: Coordinate of the point in the planning frame [m].
        z: Coordinate of the point in the planning frame [m].
        sufficient: Distance from which any lower bound suffices [m].
    """
    kinds, sizes, poses, nearest, distances = field.kinds, field.sizes, field.poses, field.nearest, field.distances
    i, j, k, offset = field_cell(field, x, y, z)
    best = np.inf
    if i >= 0:
        stored = nearest.shape[3]
        lower = distances[i, j, k, 0] - offset
        if lower >= sufficient:
            return lower
        for order in range(stored):
            if distances[i, j, k, order] - offset >= best:
                return best
            best = min(best, _solid_gap(kinds, sizes, poses, nearest[i, j, k, order], x, y, z))
        if stored == len(kinds) or distances[i, j, k, stored - 1] - offset >= best:
            return best
    for solid_index in range(len(kinds)):
        best = min(best, _solid_gap(kinds, sizes, poses, solid_index, x, y, z))
    return best


@njit(cache=True, nogil=True)
def surface_to_field(
    surface: Surfaces,
    root: int,
    pose: Array,
    field: DistanceField,
    margin: float,
    excess: float,
    limit: float,
    memory: Memory,
) -> tuple[int, float]:
    """Returns a lower bound of the distance of a surface from all solids of a field.

    Args:
        surface: Trees with the surface.
        root: Root node of the surface.
        pose: Pose of the surface in the planning frame, shape (3, 4).
        field: Distance field.
        margin: Distance subtracted from every distance [m].
        excess: Maximum distance by which the surface lies outside its body [m]; only a deeper point proves contact.
        limit: Maximum of the bound [m].
        memory: Working memory.

    Returns:
        The status and a lower bound of the distance minus the margin [m], or TOUCHING and the index of a touched solid.
    """
    kinds, sizes, poses, nearest, distances = field.kinds, field.sizes, field.poses, field.nearest, field.distances
    relative, result, reach = memory.relative, CLEAR, surface.spheres[root, 3] + margin
    x, y, z = _placed_centre(surface.spheres, root, pose)
    i, j, k, offset = field_cell(field, x, y, z)
    stored, count = nearest.shape[3], 0
    while i >= 0 and count < stored and distances[i, j, k, count] - offset - reach < limit:
        count += 1
    checks_all = i < 0 or (count == stored and stored < len(kinds))
    for order in range(len(kinds) if checks_all else count):
        solid_index = order if checks_all else nearest[i, j, k, order]
        if _solid_gap(kinds, sizes, poses, solid_index, x, y, z) - reach >= limit:
            continue
        relative_pose(pose, poses[solid_index], relative)
        solid = solid_of(kinds, sizes, solid_index)
        status, bound = surface_to_solid(surface, root, relative, solid, margin, excess, limit, memory)
        if status == TOUCHING:
            return TOUCHING, float(solid_index)
        if status == TOO_CLOSE:  # from here on, search for a touching solid only
            result, limit = TOO_CLOSE, -ROUNDING - excess
        limit = min(limit, bound)
    return result, max(limit, 0.0)


@njit(cache=True, nogil=True)
def _placed_centre(spheres: Array, node: int, pose: Array) -> tuple[float, float, float]:
    """Returns the centre of a node's sphere, transformed by the pose."""
    x, y, z = spheres[node, 0], spheres[node, 1], spheres[node, 2]
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3],
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3],
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3],
    )
