# SPDX-License-Identifier: BSD-3-Clause
"""Makes a planner's path short and straight: leaves out vertices, cuts corners, while the motion stays free."""

from __future__ import annotations

import time
from bisect import bisect_right
from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_polylines import needed_vertices

LEAST_GAIN = 0.01  # of a cut, as a share of the path's length
LEAST_PULL = 0.003  # gain of a vertex that is moved, as a share of the path's length
PULLS = 2  # of each vertex at most
EdgeTest = Callable[[Array, Array], bool]
Join = Callable[[Array, Array, float], Array | None]


def path_length(path: Array) -> float:
    """Returns the length of a polyline of shape (n, joints)."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def drop_vertices(path: Array, edge_is_free: EdgeTest, deadline: float) -> Array:
    """Leaves out every vertex whose neighbours can be joined directly, longest jumps first."""
    kept = [0]
    while kept[-1] < len(path) - 1:
        here = kept[-1]
        following = here + 1
        for candidate in range(len(path) - 1, here + 1, -1):
            if time.monotonic() > deadline:
                break
            if edge_is_free(path[here], path[candidate]):
                following = candidate
                break
        kept.append(following)
    return path[kept]


def _lengths(path: Array) -> list[float]:
    """Returns how long the path is up to each vertex."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]).tolist()


def _point_at(path: Array, lengths: list[float], position: float) -> tuple[int, Array]:
    number = min(max(bisect_right(lengths, position) - 1, 0), len(path) - 2)
    span = lengths[number + 1] - lengths[number]
    share = 0.0 if span <= 0.0 else (position - lengths[number]) / span
    return number, path[number] + share * (path[number + 1] - path[number])


def cut_pieces(
    path: Array,
    join: Join,
    deadline: float,
    rng: np.random.Generator,
    attempts: int = 60,
    patience: int = 20,
) -> Array:
    """Joins random pairs of points of the path by shorter pieces.

    Args:
        path: polyline of shape (n, joints).
        join: gives a valid polyline between two points, both included, that is no longer than a length; or None.
        deadline: monotonic time [s] at which to stop.
        rng: source of the random choices.
        attempts: most tries.
        patience: tries without success in a row after which it stops.
    """
    failures, lengths = 0, _lengths(path)
    for _ in range(attempts):
        if len(path) < 3 or failures >= patience or time.monotonic() > deadline:
            break
        low, high = sorted(rng.uniform(0.0, lengths[-1], 2).tolist())
        first, start = _point_at(path, lengths, low)
        last, end = _point_at(path, lengths, high)
        piece = None if first == last else join(start, end, high - low - LEAST_GAIN * lengths[-1])
        if piece is None:
            failures += 1
            continue
        path = np.vstack([path[: first + 1], piece, path[last + 1 :]])
        failures, lengths = 0, _lengths(path)
    return path


def cut_corners(path: Array, edge_is_free: EdgeTest, deadline: float, rng: np.random.Generator) -> Array:
    """Joins random pairs of points of the path directly where that is shorter and free; see cut_pieces."""

    def straight(start: Array, end: Array, longest: float) -> Array | None:
        is_short = float(np.linalg.norm(end - start)) <= longest
        return np.array([start, end]) if is_short and edge_is_free(start, end) else None

    return without_repeats(cut_pieces(path, straight, deadline, rng))


def pull_vertices(path: Array, edge_is_free: EdgeTest, deadline: float) -> Array:
    """Moves inner vertices half of the way to the line between their neighbours where both new edges are free."""
    path = path.copy()
    least = LEAST_PULL * path_length(path)
    for _ in range(PULLS):
        has_moved = False
        for number in range(1, len(path) - 1):
            before, vertex, after = path[number - 1 : number + 2].copy()
            way = after - before
            along = float((vertex - before) @ way) / max(float(way @ way), 1e-30)
            moved = 0.5 * (vertex + before + min(max(along, 0.0), 1.0) * way)
            ways = (np.array([before, vertex, after]), np.array([before, moved, after]))
            if path_length(ways[0]) - path_length(ways[1]) < least or time.monotonic() > deadline:
                continue
            if edge_is_free(before, moved) and edge_is_free(moved, after):
                path[number], has_moved = moved, True
        if not has_moved:
            break
    return path


def without_repeats(path: Array, tolerance: float = 1e-9) -> Array:
    """Drops vertices equal to their predecessor and those in the middle of a straight line; keeps both ends.

    Of a path that stays where it is, the first vertex is left.

    Args:
        path: polyline of shape (n, joints).
        tolerance: shortest edge [rad or m], and most change of the unit direction of an edge at a dropped vertex.
    """
    return path[needed_vertices(np.ascontiguousarray(path), tolerance)]


def shorten(path: Array, edge_is_free: EdgeTest, deadline: float, rng: np.random.Generator) -> Array:
    """Returns a path with the same ends, not longer than the given one."""
    path = without_repeats(path)
    if len(path) < 3:
        return path
    path = drop_vertices(path, edge_is_free, deadline)
    path = cut_corners(path, edge_is_free, deadline, rng)
    return pull_vertices(drop_vertices(path, edge_is_free, deadline), edge_is_free, deadline)
