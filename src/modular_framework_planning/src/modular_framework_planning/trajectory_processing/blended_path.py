# SPDX-License-Identifier: BSD-3-Clause
"""Chooses the parabolas that round the corners of a polyline: smooth enough to pass without stopping, near the line."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_timing import corner_samples

NEARLY_REVERSED = -0.9  # cosine of the turn below which the motion stops instead of swinging round
SMALLEST_BLEND = 1.0e-3  # [rad or m]
SAMPLE_STEP = 0.01  # [rad or m] between samples of a parabola


def choose_blends(vertices: Array, deviation: float, is_free: Callable[[Array], bool]) -> Array:
    """Chooses the parabola of every inner corner; 0 means: stop there.

    Args:
        vertices: polyline of shape (n, joints).
        deviation: most distance from the corner [rad or m].
        is_free: whether a polyline (samples along a candidate corner) is free of collisions.
    """
    vertices = np.ascontiguousarray(vertices, dtype=float)
    lengths = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    result = np.zeros(max(0, len(vertices) - 2))
    for number in range(len(result)):
        start, corner, end = vertices[number : number + 3]
        before, after = (corner - start) / lengths[number], (end - corner) / lengths[number + 1]
        if float(before @ after) < NEARLY_REVERSED:
            continue
        turn = max(float(np.linalg.norm(before - after)), 1e-9)
        size = float(min(0.45 * lengths[number], 0.45 * lengths[number + 1], 4.0 * deviation / turn))
        for _ in range(4):
            if size < SMALLEST_BLEND:
                break
            if is_free(corner_samples(start, corner, end, size, SAMPLE_STEP)):
                result[number] = size
                break
            size *= 0.5
    return result
