# SPDX-License-Identifier: BSD-3-Clause
"""Questions about polylines of joint vectors, compiled: which vertices are needed, and which pieces lie on known edges.

They are asked some times for each plan, of few vertices: NumPy's overhead would be most of the time.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array


@njit(cache=True, nogil=True)
def needed_vertices(path: Array, tolerance: float) -> NDArray[np.int64]:
    """Returns the numbers of the vertices without repetitions and those in the middle of a straight line.

    Args:
        path: polyline of shape (n, joints).
        tolerance: shortest edge [rad or m], and most change of the unit direction of an edge at a dropped vertex.
    """
    count, joints = path.shape
    kept, used = np.zeros(count, np.int64), 1
    before, after = np.empty(joints), np.empty(joints)
    end = 0  # of the last edge that moves
    for number in range(1, count):
        length = 0.0
        for joint in range(joints):
            after[joint] = path[number, joint] - path[number - 1, joint]
            length += after[joint] * after[joint]
        length = np.sqrt(length)
        if not length > tolerance:
            continue
        turn = 0.0
        for joint in range(joints):
            after[joint] /= length
            if end > 0:
                turn = max(turn, abs(after[joint] - before[joint]))
            before[joint] = after[joint]
        if turn > tolerance:
            kept[used] = end
            used += 1
        end = number
    if end > 0:
        kept[used] = count - 1
        used += 1
    return kept[:used]


@njit(cache=True, nogil=True)
def pieces_on_edges(
    path: Array, edges: Array, counts: NDArray[np.bool_], shortest: float, tolerance: float
) -> NDArray[np.int64]:
    """Returns the numbers of the pieces of a polyline that lie on an edge.

    Args:
        path: polyline of shape (n, joints).
        edges: both ends of each, shape (m, 2, joints).
        counts: whether an edge is one of those, shape (m,).
        shortest: of the pieces that are looked for, by the joint that moves farthest [rad or m].
        tolerance: distance of a point from an edge, of any joint, at which it lies on it [rad or m].
    """
    joints = path.shape[1]
    found, used = np.empty(max(len(path) - 1, 0), np.int64), 0
    for number in range(len(path) - 1):
        widest = 0.0
        for joint in range(joints):
            widest = max(widest, abs(path[number + 1, joint] - path[number, joint]))
        if widest <= shortest:
            continue
        for edge in range(len(edges)):
            if (
                counts[edge]
                and _is_on(path[number], edges[edge], tolerance)
                and _is_on(path[number + 1], edges[edge], tolerance)
            ):
                found[used] = number
                used += 1
                break
    return found[:used]


@njit(cache=True, nogil=True)
def _is_on(point: Array, edge: Array, tolerance: float) -> bool:
    square, along = 0.0, 0.0
    for joint in range(len(point)):
        way = edge[1, joint] - edge[0, joint]
        square += way * way
        along += way * (point[joint] - edge[0, joint])
    share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    for joint in range(len(point)):
        if not abs(edge[0, joint] + share * (edge[1, joint] - edge[0, joint]) - point[joint]) <= tolerance:
            return False
    return True


def warm_up() -> None:
    """Compiles the loops of this module, or loads them."""
    path = np.array([[0.0, 0.0], [1.0, 0.0]])
    needed_vertices(path, 0.0)
    pieces_on_edges(path, path[None], np.ones(1, dtype=bool), 0.0, 0.0)
