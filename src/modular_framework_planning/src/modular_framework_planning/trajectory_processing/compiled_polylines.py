# SPDX-License-Identifier: BSD-3-Clause
"""Removal of redundant vertices from polylines of joint vectors.

The function is compiled, because the overhead of NumPy calls dominates for a few vertices.
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


def warm_up() -> None:
    """Compiles the kernel of this module, or loads it from the cache."""
    needed_vertices(np.array([[0.0, 0.0], [1.0, 0.0]]), 0.0)
