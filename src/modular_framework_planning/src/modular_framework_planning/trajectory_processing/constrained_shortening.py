# SPDX-License-Identifier: BSD-3-Clause
"""Path shortening under path constraints, which straight shortcuts would violate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.path_shortening import path_length, shortcut_pieces


def cut_along(
    path: Array,
    connect: Callable[[Array, Array], Array | None],
    is_valid: Callable[[Array], bool],
    deadline: float,
    rng: np.random.Generator,
) -> Array:
    """Returns the path with shortcuts along the constraints between random pairs of points.

    Args:
        path: Polyline whose edges satisfy the constraints, shape (n, joints).
        connect: Returns a polyline along the constraints between two points, including both, or None.
        is_valid: Checks that a polyline is free and satisfies the constraints.
        deadline: Monotonic time at which to stop [s].
        rng: Random generator.
    """

    def connect_shorter(start: Array, end: Array, max_length: float) -> Array | None:
        piece = connect(start, end)
        return piece if piece is not None and path_length(piece) <= max_length and is_valid(piece) else None

    return shortcut_pieces(path, connect_shorter, deadline, rng)
