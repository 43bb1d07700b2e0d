# SPDX-License-Identifier: BSD-3-Clause
"""Makes the parabolas that round the corners of a polyline smaller where something is in their way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_timing import SMALLEST_BLEND, corner_samples

SAMPLE_STEP = 0.01  # [rad or m] between samples of a parabola


def free_blends(vertices: Array, largest: Array, is_free: Callable[[Array], bool]) -> Array:
    """Makes the parabolas of the corners of a polyline smaller until they are free; 0 means: stop there.

    Args:
        vertices: polyline of shape (n, joints).
        largest: corner distances to begin with, shape (n - 2,) (see `largest_blends`).
        is_free: whether a polyline (samples along a candidate corner) is free and keeps the path constraints.
    """
    result = np.zeros_like(largest)
    for number, size in enumerate(largest):
        start, corner, end = vertices[number : number + 3]
        for _ in range(4):
            if size < SMALLEST_BLEND:
                break
            if is_free(corner_samples(start, corner, end, size, SAMPLE_STEP)):
                result[number] = size
                break
            size *= 0.5
    return result
