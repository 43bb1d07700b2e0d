# SPDX-License-Identifier: BSD-3-Clause
"""The distance of points from the nearest of many solids, compiled: a grid keeps which solids are nearest to a cell.

A link is checked against all solids of the world at once. Where the link is far from all of them, the distance at the
centre of a cell says so; where it is near, only the few solids nearest to the cell are asked. Cells are filled on
first use and never change.
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
    Solid,
    placed_solid_distance,
    surface_to_solid,
)
from modular_framework_planning.geometry.spatial import Array

KEPT = 6  # nearest solids of a cell


class DistanceField(NamedTuple):
    """Solids that stand still in the planning frame, and the grid over them.

    Attributes:
        kinds, sizes: closed form of each solid and its three numbers, shapes (n,) and (n, 3).
        poses: of the solids in the planning frame, shape (n, 3, 4).
        corner: of the grid, and the edge of its cells [m]; shape (4,).
        known: whether a cell is filled; shape (x, y, z).
        nearest: the solids nearest to a cell's centre, the nearest first; shape (x, y, z, min(n, KEPT)).
        distances: of these solids from the centre [m], below 0 inside; same shape.
    """

    kinds: NDArray[np.int64]
    sizes: Array
    poses: Array
    corner: Array
    known: NDArray[np.bool_]
    nearest: NDArray[np.int32]
    distances: Array


@njit(cache=True, nogil=True)
def _solid_gap(kinds, sizes, poses, number, x, y, z):  # type: ignore[no-untyped-def]
    solid = Solid(kinds[number], sizes[number, 0], sizes[number, 1], sizes[number, 2])
    return placed_solid_distance(solid, poses, number, x, y, z)


@njit(cache=True, nogil=True)
def _fill_cell(kinds, sizes, poses, nearest, distances, x, y, z):  # type: ignore[no-untyped-def]
    """Writes the solids nearest to a point, and their distances; both of shape (k,)."""
    kept, used = len(nearest), 0
    for number in range(len(kinds)):
        gap = _solid_gap(kinds, sizes, poses, number, x, y, z)
        if used == kept and gap >= distances[used - 1]:
            continue
        at = min(used, kept - 1)
        while at > 0 and distances[at - 1] > gap:
            distances[at], nearest[at] = distances[at - 1], nearest[at - 1]
            at -= 1
        distances[at], nearest[at] = gap, number
        used = min(used + 1, kept)


@njit(cache=True, nogil=True)
def field_cell(field, x, y, z):  # type: ignore[no-untyped-def]
    """Returns the cell of a point, filled (three numbers, -1 outside of the grid), and how far its centre is [m]."""
    corner, known = field.corner, field.known
    edge = corner[3]
    u, v, w = (x - corner[0]) / edge, (y - corner[1]) / edge, (z - corner[2]) / edge
    if not (0.0 <= u < known.shape[0] and 0.0 <= v < known.shape[1] and 0.0 <= w < known.shape[2]):  # or not a number
        return -1, 0, 0, 0.0
    i, j, k = int(u), int(v), int(w)
    u, v, w = corner[0] + (i + 0.5) * edge, corner[1] + (j + 0.5) * edge, corner[2] + (k + 0.5) * edge
    if not known[i, j, k]:
        _fill_cell(field.kinds, field.sizes, field.poses, field.nearest[i, j, k], field.distances[i, j, k], u, v, w)
        known[i, j, k] = True
    return i, j, k, np.sqrt((x - u) ** 2 + (y - v) ** 2 + (z - w) ** 2)


@njit(cache=True, nogil=True)
def field_distance(field, x, y, z, enough):  # type: ignore[no-untyped-def]
    """Returns a lower bound of a point's distance [m] from the nearest solid, exact where it is less than `enough`."""
    kinds, sizes, poses, nearest, distances = field.kinds, field.sizes, field.poses, field.nearest, field.distances
    i, j, k, away = field_cell(field, x, y, z)
    best = np.inf
    if i >= 0:
        kept = nearest.shape[3]
        lower = distances[i, j, k, 0] - away
        if lower >= enough:
            return lower
        for order in range(kept):
            if distances[i, j, k, order] - away >= best:
                return best
            best = min(best, _solid_gap(kinds, sizes, poses, nearest[i, j, k, order], x, y, z))
        if kept == len(kinds) or distances[i, j, k, kept - 1] - away >= best:
            return best
    for number in range(len(kinds)):
        best = min(best, _solid_gap(kinds, sizes, poses, number, x, y, z))
    return best


@njit(cache=True, nogil=True)
def _pose_in_solid(pose, poses, number, out):  # type: ignore[no-untyped-def]
    """Writes a pose (3, 4) in the frame of a solid."""
    for row in range(3):
        for column in range(4):
            value = 0.0
            for inner in range(3):
                part = pose[inner, column] - (poses[number, inner, 3] if column == 3 else 0.0)
                value += poses[number, inner, row] * part
            out[row, column] = value


@njit(cache=True, nogil=True)
def surface_to_field(surface, root, pose, field, margin, excess, limit, memory):  # type: ignore[no-untyped-def]
    """Bounds the distance of a surface from all solids; arguments and result are those of surface_to_solid.

    Where it touches, the number of the solid instead of the bound.
    `pose` (3, 4) is the surface's in the planning frame.
    """
    kinds, sizes, poses, nearest, distances = field.kinds, field.sizes, field.poses, field.nearest, field.distances
    relative, result, reach = memory.relative, CLEAR, surface.spheres[root, 3] + margin
    x, y, z = _placed_centre(surface.spheres, root, pose)
    i, j, k, away = field_cell(field, x, y, z)
    kept, count = nearest.shape[3], 0
    while i >= 0 and count < kept and distances[i, j, k, count] - away - reach < limit:
        count += 1
    asks_all = i < 0 or (count == kept and kept < len(kinds))
    for order in range(len(kinds) if asks_all else count):
        number = order if asks_all else nearest[i, j, k, order]
        if _solid_gap(kinds, sizes, poses, number, x, y, z) - reach >= limit:
            continue
        _pose_in_solid(pose, poses, number, relative)
        solid = Solid(kinds[number], sizes[number, 0], sizes[number, 1], sizes[number, 2])
        status, bound = surface_to_solid(surface, root, relative, solid, margin, excess, limit, memory)
        if status == TOUCHING:
            return TOUCHING, float(number)
        if status == TOO_CLOSE:  # what is left to find out is whether it touches elsewhere
            result, limit = TOO_CLOSE, -ROUNDING - excess
        limit = min(limit, bound)
    return result, max(limit, 0.0)


@njit(cache=True, nogil=True)
def _placed_centre(spheres, node, pose):  # type: ignore[no-untyped-def]
    x, y, z = spheres[node, 0], spheres[node, 1], spheres[node, 2]
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3],
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3],
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3],
    )
