# SPDX-License-Identifier: BSD-3-Clause
"""Makes a planner's path short and straight: leaves out vertices, cuts corners, while the motion stays free."""

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
    EdgeMemory,
    GroupEdges,
    new_memory,
    recall,
    remember,
)
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_polylines import needed_vertices
from modular_framework_planning.trajectory_processing.compiled_shortening import (
    FINISHED,
    LEAST_GAIN,
    PATIENCE,
    SAME,
    SIZE,
    UNDECIDED,
    Shortening,
    answer,
    ask,
    begin,
    shorten_in,
)

CUTS = 60  # that are tried
EdgeTest = Callable[[Array, Array], bool]
Join = Callable[[Array, Array, float], Array | None]


class CompiledTest(NamedTuple):
    """The same test as an EdgeTest on the arrays of a collision checker, which may leave an edge undecided.

    Attributes:
        edges: how they are checked.
        memory: of edges that were checked, those by the EdgeTest among them.
        world: where.
    """

    edges: GroupEdges
    memory: EdgeMemory
    world: World


def path_length(path: Array) -> float:
    """Returns the length of a polyline of shape (n, joints)."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def shorten(
    path: Array,
    edge_is_free: EdgeTest,
    deadline: float,
    rng: np.random.Generator | None,
    compiled: CompiledTest | None = None,
) -> Array:
    """Returns a path with the same ends, not longer than the given one.

    Args:
        path: polyline of shape (n, joints).
        edge_is_free: whether a straight motion may be part of the path.
        deadline: monotonic time [s] at which to stop.
        rng: source of the random choices; None: vertices are left out, and nothing else is done.
        compiled: decides on most edges in place of `edge_is_free`.
    """
    path = without_repeats(path)
    if len(path) < 3:
        return path
    draws = np.empty((0, 2)) if rng is None else rng.random((CUTS, 2))
    room = np.empty((len(path) + 2 * len(draws), path.shape[1]))
    room[: len(path)] = path
    work = Shortening(room, np.empty((2, path.shape[1])), np.zeros(6, np.int64), draws, np.zeros(1))
    work.at[SIZE] = len(path)
    begin(work)

    def is_free() -> bool:
        return time.monotonic() <= deadline and edge_is_free(work.edge[0].copy(), work.edge[1].copy())

    if compiled is not None:
        _shorten_compiled(work, is_free, deadline, compiled)
    while ask(work):
        answer(work, is_free())
    return room[: work.at[SIZE]].copy()


def _shorten_compiled(work: Shortening, is_free: Callable[[], bool], deadline: float, compiled: CompiledTest) -> None:
    """Shortens a path as far as the time goes."""
    world, verdict = arguments(compiled.world), UNKNOWN
    while time.monotonic() <= deadline:
        status = shorten_in(work, compiled.edges, compiled.memory, verdict, *world)
        if status == FINISHED:
            return
        verdict = UNKNOWN
        if status == UNDECIDED:
            verdict = FREE if is_free() else BLOCKED
    if verdict != UNKNOWN:
        answer(work, verdict == FREE)


def _lengths(path: Array) -> list[float]:
    """Returns how long the path is up to each vertex."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]).tolist()


def _point_at(path: Array, lengths: list[float], position: float) -> tuple[int, Array]:
    number = min(max(bisect_right(lengths, position) - 1, 0), len(path) - 2)
    span = lengths[number + 1] - lengths[number]
    share = 0.0 if span <= 0.0 else (position - lengths[number]) / span
    return number, path[number] + share * (path[number + 1] - path[number])


def cut_pieces(path: Array, join: Join, deadline: float, rng: np.random.Generator) -> Array:
    """Joins random pairs of points of the path by shorter pieces.

    Args:
        path: polyline of shape (n, joints).
        join: gives a valid polyline between two points, both included, that is no longer than a length; or None.
        deadline: monotonic time [s] at which to stop.
        rng: source of the random choices.
    """
    failures, lengths = 0, _lengths(path)
    for _ in range(CUTS):
        if len(path) < 3 or failures >= PATIENCE or time.monotonic() > deadline:
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


def without_repeats(path: Array, tolerance: float = SAME) -> Array:
    """Drops vertices equal to their predecessor and those in the middle of a straight line; keeps both ends.

    Of a path that stays where it is, the first vertex is left.

    Args:
        path: polyline of shape (n, joints).
        tolerance: shortest edge [rad or m], and most change of the unit direction of an edge at a dropped vertex.
    """
    return path[needed_vertices(np.ascontiguousarray(path), tolerance)]


def warm_up(world: World, positions: Array) -> None:
    """Compiles the loop, or loads it from the cache.

    Args:
        world: of a scene.
        positions: of the whole robot.
    """
    state, memory = np.zeros(1), new_memory(1)
    remember(memory, state, state, 0.1, recall(memory, state, state, 0.1))
    compiled = CompiledTest(GroupEdges(positions, np.zeros((len(positions), 1)), 0.1), memory, world)
    shorten(np.array([[0.0], [1.0], [0.0]]), lambda first, second: False, np.inf, np.random.default_rng(), compiled)
