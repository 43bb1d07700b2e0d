# SPDX-License-Identifier: BSD-3-Clause
"""Shortens a path on constraints: straight cuts would leave them, so the path is cut along them."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.path_shortening import path_length

LEAST_GAIN = 0.01  # of a cut, as a share of the path's length


def cut_along(
    path: Array,
    way: Callable[[Array, Array], Array | None],
    is_valid: Callable[[Array], bool],
    deadline: float,
    rng: np.random.Generator,
    attempts: int = 60,
    patience: int = 20,
) -> Array:
    """Joins random pairs of points of the path by a way along the constraints where that is shorter and free.

    Args:
        path: polyline of shape (n, joints) whose straight pieces satisfy the constraints.
        way: gives a polyline along the constraints between two points, both included, or None.
        is_valid: whether a polyline is free and satisfies the constraints.
        deadline: monotonic time [s] at which to stop.
        rng: source of the random choices.
        attempts: most tries.
        patience: tries without success in a row after which it stops.
    """
    failures = 0
    for _ in range(attempts):
        if len(path) < 3 or failures >= patience or time.monotonic() > deadline:
            break
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        ends = np.sort(rng.uniform(0.0, lengths[-1], 2))
        first, last = np.clip(np.searchsorted(lengths, ends, side="right") - 1, 0, len(path) - 2).tolist()
        start, end = (np.array([np.interp(at, lengths, column) for column in path.T]) for at in ends)
        found = way(start, end) if first < last else None
        if (
            found is None
            or path_length(found) > float(ends[1] - ends[0]) - LEAST_GAIN * lengths[-1]
            or not is_valid(found)
        ):
            failures += 1
            continue
        path, failures = np.vstack([path[: first + 1], found, path[last + 1 :]]), 0
    return path
