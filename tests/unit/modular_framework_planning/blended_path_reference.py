# SPDX-License-Identifier: BSD-3-Clause
"""A polyline with parabolic corners in plain NumPy: what compiled timing is compared with."""

from __future__ import annotations

import numpy as np


class BlendedPath:
    """Straight pieces and parabolic corners, by arc length along the straight pieces.

    With d the distance from a corner at which the parabola leaves the line, u and v the unit directions before and
    after it, the derivative along the parabola goes linearly from u to v over a length 2 d. It misses the corner by
    d |u - v| / 4.
    """

    def __init__(self, vertices: np.ndarray, blends: np.ndarray) -> None:
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

    @property
    def length(self) -> float:
        """Largest path position."""
        return float(self.breaks[-1])

    def evaluate(self, positions: np.ndarray, order: int = 0) -> np.ndarray:
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
