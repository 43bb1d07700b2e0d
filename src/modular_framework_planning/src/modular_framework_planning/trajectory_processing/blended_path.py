# SPDX-License-Identifier: BSD-3-Clause
"""A polyline whose corners are replaced by parabolas: smooth enough to pass without stopping, near the line."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_timing import PathPieces

NEARLY_REVERSED = -0.9  # cosine of the turn below which the motion stops instead of swinging round
SMALLEST_BLEND = 1.0e-3  # [rad or m]


class BlendedPath:
    """Straight pieces and parabolic corners, by arc length along the straight pieces.

    With d the distance from a corner at which the parabola leaves the line, u and v the unit directions before and
    after it, the derivative along the parabola goes linearly from u to v over a length 2 d. It misses the corner by
    d |u - v| / 4.
    """

    def __init__(self, vertices: Array, blends: Array) -> None:
        """Computes the pieces.

        Args:
            vertices: of the polyline, shape (n, joints), n >= 2 [rad or m].
            blends: distance d of each inner corner, shape (n - 2,), above 0 [rad or m].
        """
        self.start, self.end = vertices[0], vertices[-1]
        spans = np.diff(vertices, axis=0)
        lengths = np.linalg.norm(spans, axis=1)
        directions = spans / lengths[:, None]
        trim = np.concatenate([[0.0], blends, [0.0]])
        starts, points, tangents, curvatures = [0.0], [], [], []
        position = 0.0
        for number, length in enumerate(lengths):
            straight = length - trim[number] - trim[number + 1]
            if straight > 1e-12:
                points.append(vertices[number] + trim[number] * directions[number])
                tangents.append(directions[number])
                curvatures.append(np.zeros_like(directions[number]))
                position += straight
                starts.append(position)
            if number + 1 < len(lengths):
                corner = trim[number + 1]
                points.append(vertices[number + 1] - corner * directions[number])
                tangents.append(directions[number])
                curvatures.append((directions[number + 1] - directions[number]) / (2.0 * corner))
                position += 2.0 * corner
                starts.append(position)
        self.breaks = np.array(starts)
        self._points, self._tangents, self._curvatures = (np.array(x) for x in (points, tangents, curvatures))

    def pieces(self) -> PathPieces:
        """Returns the arrays of all pieces, for compiled code."""
        return PathPieces(self.breaks, self._points, self._tangents, self._curvatures)

    @property
    def length(self) -> float:
        """Largest path position."""
        return float(self.breaks[-1])

    def evaluate(self, positions: Array, order: int = 0) -> Array:
        """Returns points (order 0) or derivatives by path position (1, 2), shape (n, joints)."""
        inner = np.clip(positions, 0.0, self.length)
        piece = np.clip(np.searchsorted(self.breaks, inner, side="right") - 1, 0, len(self._points) - 1)
        offset = (inner - self.breaks[piece])[:, None]
        curvature = self._curvatures[piece]
        if order == 2:
            return curvature
        if order == 1:
            return self._tangents[piece] + offset * curvature
        return self._points[piece] + offset * self._tangents[piece] + 0.5 * offset * offset * curvature


def choose_blends(vertices: Array, deviation: float, is_free: Callable[[Array], bool]) -> Array:
    """Chooses the parabola of every inner corner; 0 means: stop there.

    Args:
        vertices: polyline of shape (n, joints).
        deviation: most distance from the corner [rad or m].
        is_free: whether a polyline (samples along a candidate corner) is free of collisions.
    """
    lengths = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    result = np.zeros(max(0, len(vertices) - 2))
    for number in range(len(result)):
        before = (vertices[number + 1] - vertices[number]) / lengths[number]
        after = (vertices[number + 2] - vertices[number + 1]) / lengths[number + 1]
        if float(before @ after) < NEARLY_REVERSED:
            continue
        turn = max(float(np.linalg.norm(before - after)), 1e-9)
        size = min(0.45 * lengths[number], 0.45 * lengths[number + 1], 4.0 * deviation / turn)
        for _ in range(4):
            if size < SMALLEST_BLEND:
                break
            share = np.linspace(0.0, 2.0 * size, max(8, int(2.0 * size / 0.01)))[:, None]
            curve = (
                (vertices[number + 1] - size * before)
                + share * before
                + (share * share * (after - before) / (4.0 * size))
            )
            if is_free(curve):
                result[number] = size
                break
            size *= 0.5
    return result
