# SPDX-License-Identifier: BSD-3-Clause
"""Polylines of joint vectors: removal of redundant vertices, and pieces that lie on known edges.

The functions are compiled, because the overhead of NumPy calls dominates for a few vertices.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array


@njit(cache=True, nogil=True)
def needed_vertices(path: Array, tolerance: float) -> NDArray[np.int64]:
    """Returns the indices of the vertices that are neither repeated nor inside a straight line.

    Args:
        path: Polyline, shape (n, joints) [rad or m].
        tolerance: Minimum length of an edge [rad or m], and minimum change of the unit direction at a vertex.
    """
    count, joints = path.shape
    kept, kept_count = np.zeros(count, np.int64), 1
    before, after = np.empty(joints), np.empty(joints)
    edge_end = 0  # end of the last edge that is longer than the tolerance
    for index in range(1, count):
        length = 0.0
        for joint in range(joints):
            after[joint] = path[index, joint] - path[index - 1, joint]
            length += after[joint] * after[joint]
        length = np.sqrt(length)
        if not length > tolerance:
            continue
        direction_change = 0.0
        for joint in range(joints):
            after[joint] /= length
            if edge_end > 0:
                direction_change = max(direction_change, abs(after[joint] - before[joint]))
            before[joint] = after[joint]
        if direction_change > tolerance:
            kept[kept_count] = edge_end
            kept_count += 1
        edge_end = index
    if edge_end > 0:
        kept[kept_count] = count - 1
        kept_count += 1
    return kept[:kept_count]


@njit(cache=True, nogil=True)
def pieces_on_edges(
    path: Array, edges: Array, is_selected: NDArray[np.bool_], min_change: float, tolerance: float
) -> NDArray[np.int64]:
    """Returns the indices of the pieces of a polyline that lie on a selected edge.

    Args:
        path: Polyline, shape (n, joints) [rad or m].
        edges: Start and end of each edge, shape (m, 2, joints) [rad or m].
        is_selected: Whether each edge is selected, shape (m,).
        min_change: Joint displacement up to which a piece is left out [rad or m].
        tolerance: Maximum joint distance of the ends of a piece from an edge [rad or m].
    """
    joints = path.shape[1]
    pieces, kept_count = np.empty(max(len(path) - 1, 0), np.int64), 0
    for index in range(len(path) - 1):
        max_change = 0.0
        for joint in range(joints):
            max_change = max(max_change, abs(path[index + 1, joint] - path[index, joint]))
        if max_change <= min_change:
            continue
        for edge in range(len(edges)):
            if (
                is_selected[edge]
                and _is_on_edge(path[index], edges[edge], tolerance)
                and _is_on_edge(path[index + 1], edges[edge], tolerance)
            ):
                pieces[kept_count] = index
                kept_count += 1
                break
    return pieces[:kept_count]


@njit(cache=True, nogil=True)
def _is_on_edge(point: Array, edge: Array, tolerance: float) -> bool:
    """Returns whether no joint of a point is farther than `tolerance` from the nearest point of an edge."""
    squared_length, projection = 0.0, 0.0
    for joint in range(len(point)):
        offset = edge[1, joint] - edge[0, joint]
        squared_length += offset * offset
        projection += offset * (point[joint] - edge[0, joint])
    fraction = min(max(projection / squared_length, 0.0), 1.0) if squared_length > 0.0 else 0.0
    for joint in range(len(point)):
        if not abs(edge[0, joint] + fraction * (edge[1, joint] - edge[0, joint]) - point[joint]) <= tolerance:
            return False
    return True


def warm_up() -> None:
    """Compiles the kernels of this module, or loads them from the cache."""
    path = np.array([[0.0, 0.0], [1.0, 0.0]])
    needed_vertices(path, 0.0)
    pieces_on_edges(path, path[None], np.ones(1, dtype=bool), 0.0, 0.0)
