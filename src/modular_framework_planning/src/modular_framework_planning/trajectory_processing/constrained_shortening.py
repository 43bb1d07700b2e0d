# SPDX-License-Identifier: BSD-3-Clause
"""Shortens a path on constraints: straight cuts would leave them, so the path is cut along them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.path_shortening import cut_pieces, path_length


def cut_along(
    path: Array,
    way: Callable[[Array, Array], Array | None],
    is_valid: Callable[[Array], bool],
    deadline: float,
    rng: np.random.Generator,
) -> Array:
    """Joins random pairs of points of the path by a way along the constraints where that is shorter and free.

    Args:
        path: polyline of shape (n, joints) whose straight pieces satisfy the constraints.
        way: gives a polyline along the constraints between two points, both included, or None.
        is_valid: whether a polyline is free and satisfies the constraints.
        deadline: monotonic time [s] at which to stop.
        rng: source of the random choices.
    """

    def along(start: Array, end: Array, longest: float) -> Array | None:
        found = way(start, end)
        return found if found is not None and path_length(found) <= longest and is_valid(found) else None

    return cut_pieces(path, along, deadline, rng)
