# SPDX-License-Identifier: BSD-3-Clause
"""Path shortening: drops vertices, takes shortcuts and pulls vertices while all edges stay free."""

from __future__ import annotations

import time
from bisect import bisect_right
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_collision import World, arguments
from modular_framework_planning.collision_detection.kernels.compiled_edges import (
    BLOCKED,
    FREE,
    UNKNOWN,
    GroupEdges,
)
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_polylines import needed_vertices
from modular_framework_planning.trajectory_processing.compiled_shortening import (
    FINISHED,
    MAX_FAILURES,
    MIN_SHORTCUT_GAIN,
    SIZE,
    UNDECIDED,
    VERTEX_TOLERANCE,
    Shortening,
    apply_verdict,
    begin,
    next_edge,
    shorten_in,
)

MAX_SHORTCUTS = 60  # attempted shortcuts per path
EdgeTest = Callable[[Array, Array], bool]
Join = Callable[[Array, Array, float], Array | None]


class CompiledEdgeTest(NamedTuple):
    """A compiled equivalent of an EdgeTest, which can leave an edge undecided.

    Attributes:
        edges: Mapping and step of the edge checks.
        world: World of the compiled checks.
    """

    edges: GroupEdges
    world: World


def path_length(path: Array) -> float:
    """Returns the length of a polyline of shape (n, joints)."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def shorten(
    path: Array,
    edge_is_free: EdgeTest,
    deadline: float,
    rng: np.random.Generator | None,
    compiled: CompiledEdgeTest | None = None,
) -> Array:
    """Returns a path with the same ends that is not longer.

    Args:
        path: Polyline, shape (n, joints).
        edge_is_free: Checks an edge.
        deadline: Monotonic time at which to stop [s].
        rng: Random generator; None to only drop vertices.
        compiled: Compiled edge check, used before `edge_is_free`.
    """
    path = without_repeats(path)
    if len(path) < 3:
        return path
    random_numbers = np.empty((0, 2)) if rng is None else rng.random((MAX_SHORTCUTS, 2))
    buffer = np.empty((len(path) + 2 * len(random_numbers), path.shape[1]))
    buffer[: len(path)] = path
    shortening = Shortening(buffer, np.empty((2, path.shape[1])), np.zeros(6, np.int64), random_numbers, np.zeros(1))
    shortening.progress[SIZE] = len(path)
    begin(shortening)

    def is_free() -> bool:
        return time.monotonic() <= deadline and edge_is_free(shortening.edge[0].copy(), shortening.edge[1].copy())

    if compiled is not None:
        _shorten_compiled(shortening, is_free, deadline, compiled)
    while next_edge(shortening):
        apply_verdict(shortening, is_free())
    return buffer[: shortening.progress[SIZE]].copy()


def _shorten_compiled(
    shortening: Shortening, is_free: Callable[[], bool], deadline: float, compiled: CompiledEdgeTest
) -> None:
    """Shortens a path until it is done or the time is over."""
    world, verdict = arguments(compiled.world), UNKNOWN
    while time.monotonic() <= deadline:
        status = shorten_in(shortening, compiled.edges, verdict, *world)
        if status == FINISHED:
            return
        verdict = UNKNOWN
        if status == UNDECIDED:
            verdict = FREE if is_free() else BLOCKED
    if verdict != UNKNOWN:
        apply_verdict(shortening, verdict == FREE)


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
    for _ in range(MAX_SHORTCUTS):
        if len(path) < 3 or failures >= MAX_FAILURES or time.monotonic() > deadline:
            break
        low, high = sorted(rng.uniform(0.0, lengths[-1], 2).tolist())
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


def warm_up(world: World, positions: Array) -> None:
    """Compiles the loop or loads it from the cache.

    Args:
        world: World of any scene.
        positions: Positions of the whole robot [rad or m].
    """
    compiled = CompiledEdgeTest(GroupEdges(positions, np.zeros((len(positions), 1)), 0.1), world)
    shorten(np.array([[0.0], [1.0], [0.0]]), lambda first, second: False, np.inf, np.random.default_rng(), compiled)
