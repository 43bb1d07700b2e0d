# SPDX-License-Identifier: BSD-3-Clause
"""Blend sizes at the waypoints of a polyline, reduced until each parabolic blend is free."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_timing import MIN_BLEND, blend_samples

SAMPLE_STEP = 0.01  # distance between the samples of a blend [rad or m]


def free_blends(vertices: Array, max_sizes: Array, is_free: Callable[[Array], bool]) -> Array:
    """Returns free blend sizes at the inner vertices of a polyline, shape (n - 2,); 0 for a stop.

    Args:
        vertices: Polyline, shape (n, joints).
        max_sizes: Initial blend sizes, shape (n - 2,), see `max_blends`.
        is_free: Checks that samples of a blend are free and satisfy the path constraints.
    """
    result = np.zeros_like(max_sizes)
    for index, size in enumerate(max_sizes):
        start, waypoint, end = vertices[index : index + 3]
        for _ in range(4):
            if size < MIN_BLEND:
                break
            if is_free(blend_samples(start, waypoint, end, size, SAMPLE_STEP)):
                result[index] = size
                break
            size *= 0.5
    return result
