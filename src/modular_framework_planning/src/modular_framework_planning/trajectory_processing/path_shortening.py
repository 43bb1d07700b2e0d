# SPDX-License-Identifier: BSD-3-Clause
"""Path shortening: drops vertices, takes shortcuts and pulls vertices while all edges stay free."""

from __future__ import annotations

import time
from bisect import bisect_right
from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_polylines import needed_vertices

MAX_SHORTCUTS = 60  # attempted shortcuts per path
MAX_FAILURES = 20  # consecutive failures that end the shortcuts
MIN_SHORTCUT_GAIN = 0.01  # minimum gain of a shortcut, as a fraction of the path length
MIN_PULL_GAIN = 0.003  # minimum gain of a pulled vertex, as a fraction of the path length
MAX_PULL_ROUNDS = 2
VERTEX_TOLERANCE = 1e-9  # minimum length of an edge [rad or m], and minimum change of the unit direction at a vertex
EdgeTest = Callable[[Array, Array], bool]
Join = Callable[[Array, Array, float], Array | None]


def path_length(path: Array) -> float:
    """Returns the length of a polyline of shape (n, joints)."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def shorten(path: Array, edge_is_free: EdgeTest, deadline: float, rng: np.random.Generator | None) -> Array:
    """Returns a path with the same ends that is not longer.

    - Dropping: vertices between two vertices with a free direct edge are removed; long edges are tried first.
    - Shortcutting: random pairs of points on the path are connected by an edge if the edge is free and shorter.
    - Pulling: each inner vertex moves halfway towards the line between its neighbours if both new edges are free.

    Args:
        path: Polyline, shape (n, joints).
        edge_is_free: Checks an edge.
        deadline: Monotonic time at which to stop [s].
        rng: Random generator; None to only drop vertices.
    """

    def is_free(first: Array, second: Array) -> bool:
        return time.monotonic() <= deadline and edge_is_free(first, second)

    def edge(first: Array, second: Array, max_length: float) -> Array | None:
        is_shorter = float(np.linalg.norm(second - first)) <= max_length
        return np.array([first, second]) if is_shorter and is_free(first, second) else None

    path = without_repeats(path)
    if len(path) < 3:
        return path
    path = _without_vertices(path, is_free)
    if rng is None:
        return path
    return _pulled(without_repeats(shortcut_pieces(path, edge, deadline, rng)), is_free)


def _without_vertices(path: Array, is_free: EdgeTest) -> Array:
    """Returns the path without the vertices between two vertices with a free direct edge."""
    kept, last = [0], len(path) - 1
    while kept[-1] < last:
        base = kept[-1]
        candidates = range(last, base + 1, -1)
        kept.append(next((vertex for vertex in candidates if is_free(path[base], path[vertex])), base + 1))
    return path[kept]


def _pulled(path: Array, is_free: EdgeTest) -> Array:
    """Returns the path with inner vertices moved towards the lines between their neighbours."""
    min_gain = MIN_PULL_GAIN * path_length(path)
    for _ in range(MAX_PULL_ROUNDS):
        has_moved = False
        for index in range(1, len(path) - 1):
            before, vertex, after = path[index - 1 : index + 2].copy()
            offset = after - before
            fraction = min(max(float((vertex - before) @ offset) / (float(offset @ offset) + 1e-30), 0.0), 1.0)
            pulled = 0.5 * (vertex + before + fraction * offset)
            gain = path_length(path[index - 1 : index + 2]) - path_length(np.array([before, pulled, after]))
            if gain >= min_gain and is_free(before, pulled) and is_free(pulled, after):
                path[index], has_moved = pulled, True
        if not has_moved:
            break
    return path


def _lengths(path: Array) -> list[float]:
    """Returns the path length up to each vertex."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]).tolist()


def _point_on_path(path: Array, lengths: list[float], path_position: float) -> tuple[int, Array]:
    index = min(max(bisect_right(lengths, path_position) - 1, 0), len(path) - 2)
    span = lengths[index + 1] - lengths[index]
    fraction = 0.0 if span <= 0.0 else (path_position - lengths[index]) / span
    return index, path[index] + fraction * (path[index + 1] - path[index])


def shortcut_pieces(path: Array, join: Join, deadline: float, rng: np.random.Generator) -> Array:
    """Returns the path with shorter pieces between random pairs of points.

    Args:
        path: Polyline, shape (n, joints).
        join: Returns a valid polyline between two points, including both, with at most the given length, or None.
        deadline: Monotonic time at which to stop [s].
        rng: Random generator.
    """
    failures, lengths = 0, _lengths(path)
    for fractions in rng.random((MAX_SHORTCUTS, 2)):
        if len(path) < 3 or failures >= MAX_FAILURES or time.monotonic() > deadline:
            break
        low, high = sorted((lengths[-1] * fractions).tolist())
        first, start = _point_on_path(path, lengths, low)
        last, end = _point_on_path(path, lengths, high)
        piece = None if first == last else join(start, end, high - low - MIN_SHORTCUT_GAIN * lengths[-1])
        if piece is None:
            failures += 1
            continue
        path = np.vstack([path[: first + 1], piece, path[last + 1 :]])
        failures, lengths = 0, _lengths(path)
    return path


def without_repeats(path: Array, tolerance: float = VERTEX_TOLERANCE) -> Array:
    """Returns the path without repeated vertices and vertices inside a straight line.

    A path that does not move keeps its first vertex only.

    Args:
        path: Polyline, shape (n, joints).
        tolerance: Minimum length of an edge [rad or m], and minimum change of the unit direction at a vertex.
    """
    return path[needed_vertices(np.ascontiguousarray(path), tolerance)]
