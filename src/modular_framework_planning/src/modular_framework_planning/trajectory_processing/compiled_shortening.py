# SPDX-License-Identifier: BSD-3-Clause
"""Makes a path short and straight, compiled: leaves out vertices, cuts corners, while the motion stays free.

Three things are done to a path, one after the other:

- Vertices whose neighbours can be joined directly are left out, longest jumps first.
- Random pairs of points of the path are joined directly where that is shorter.
- Each inner vertex is moved half of the way to the line between its neighbours.

`ask` goes on to the next edge that would change the path, and `answer` takes whether that one is free.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_arrays import borrowed
from modular_framework_planning.collision_detection.kernels.compiled_collision import world_of
from modular_framework_planning.collision_detection.kernels.compiled_edges import (
    FREE,
    UNKNOWN,
    check_edge,
    new_edge,
    recall,
    remember,
)
from modular_framework_planning.collision_detection.kernels.compiled_paths import new_workspace, release
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_polylines import needed_vertices

LEAST_GAIN = 0.01  # of a cut, as a share of the path's length
LEAST_PULL = 0.003  # gain of a vertex that is moved, as a share of the path's length
MOST_PULLS = 2  # of each vertex
PATIENCE = 20  # cuts without success in a row after which no more are tried
SAME = 1e-9  # [rad or m]; shortest edge, and least turn of a unit vector at a vertex
EDGES = 100  # that are checked in one call, so that the time is checked in between

# What is being done to the path
DROPS, CUTS, PULLS, DONE = range(4)
# What `shorten_in` returns
FINISHED, UNDECIDED, PAUSED = range(3)
# Places in Shortening.at: the stage and the number of vertices, and what the stages need
STAGE, SIZE = 0, 1
HERE, CANDIDATE, KEPT = 2, 3, 4  # vertex that is joined to others, the other one, vertices that stay before
ATTEMPT, FAILURES, FIRST, LAST = 2, 3, 4, 5  # cuts that were tried, without success in a row; vertices before its ends
ROUND, VERTEX, HAS_MOVED, IS_SECOND = 2, 3, 4, 5  # vertex that is moved; whether the edge behind it is asked for


class Shortening(NamedTuple):
    """A path and what is being done to it.

    Attributes:
        path: vertices of the path, and room for more; shape (room, joints).
        edge: the edge that is asked for; shape (2, joints).
        at: see the places above; shape (6,).
        draws: random numbers from 0 to 1, two for each cut; shape (cuts, 2).
        least: gain in length of a vertex that is moved [rad or m]; shape (1,).
    """

    path: Array
    edge: Array
    at: NDArray[np.int64]
    draws: Array
    least: Array


@njit(cache=True, nogil=True)
def _gap(one, other):  # type: ignore[no-untyped-def]
    squares = 0.0
    for joint in range(len(one)):
        squares += (other[joint] - one[joint]) ** 2
    return np.sqrt(squares)


@njit(cache=True, nogil=True)
def _lengths(path, size):  # type: ignore[no-untyped-def]
    """Returns how long a path is up to each vertex."""
    lengths = np.zeros(size)
    for number in range(1, size):
        lengths[number] = lengths[number - 1] + _gap(path[number - 1], path[number])
    return lengths


@njit(cache=True, nogil=True)
def _begin(work, stage):  # type: ignore[no-untyped-def]
    """Goes to a stage; one that a path of two vertices does not need is left out."""
    path, _, at, _, least = work
    if stage == PULLS:
        kept = needed_vertices(path[: at[SIZE]], SAME)
        for number in range(len(kept)):
            path[number] = path[kept[number]]
        at[SIZE] = len(kept)
    at[STAGE] = stage if at[SIZE] > 2 else DONE
    at[2:] = 0
    if stage == DROPS:
        at[CANDIDATE] = at[SIZE]
    elif stage == PULLS:
        least[0] = LEAST_PULL * _lengths(path, at[SIZE])[-1]


@njit(cache=True, nogil=True)
def ask(work):  # type: ignore[no-untyped-def]
    """Writes the next edge that would change the path; returns False where there is none left."""
    at = work.at
    while at[STAGE] != DONE:
        stage = at[STAGE]
        if stage == DROPS:
            is_found = _next_drop(work)
        elif stage == CUTS:
            is_found = _next_cut(work)
        else:
            is_found = _next_pull(work)
        if is_found:
            return True
        _begin(work, DONE if len(work.draws) == 0 else stage + 1)
    return False


@njit(cache=True, nogil=True)
def answer(work, is_free):  # type: ignore[no-untyped-def]
    """Changes the path where the edge that was asked for is free."""
    stage = work.at[STAGE]
    if stage == DROPS:
        if is_free:
            _keep(work, work.at[CANDIDATE])
    elif stage == CUTS:
        _answer_cut(work, is_free)
    else:
        _answer_pull(work, is_free)


@njit(cache=True, nogil=True)
def _keep(work, vertex):  # type: ignore[no-untyped-def]
    """Lets a vertex follow the last one that stays."""
    path, _, at, _, _ = work
    at[KEPT] += 1
    path[at[KEPT]] = path[vertex]
    at[HERE], at[CANDIDATE] = vertex, at[SIZE]


@njit(cache=True, nogil=True)
def _next_drop(work):  # type: ignore[no-untyped-def]
    path, edge, at, _, _ = work
    while at[HERE] < at[SIZE] - 1:
        at[CANDIDATE] -= 1
        if at[CANDIDATE] > at[HERE] + 1:
            edge[0], edge[1] = path[at[KEPT]], path[at[CANDIDATE]]
            return True
        _keep(work, at[HERE] + 1)
    at[SIZE] = at[KEPT] + 1
    return False


@njit(cache=True, nogil=True)
def _write_point(path, lengths, position, out):  # type: ignore[no-untyped-def]
    """Writes the point of a path at a length, and returns the number of the vertex before it."""
    number = min(max(np.searchsorted(lengths, position, side="right") - 1, 0), len(lengths) - 2)
    span = lengths[number + 1] - lengths[number]
    share = 0.0 if span <= 0.0 else (position - lengths[number]) / span
    for joint in range(len(out)):
        out[joint] = path[number, joint] + share * (path[number + 1, joint] - path[number, joint])
    return number


@njit(cache=True, nogil=True)
def _next_cut(work):  # type: ignore[no-untyped-def]
    path, edge, at, draws, _ = work
    if at[SIZE] < 3:
        return False
    lengths = _lengths(path, at[SIZE])
    while at[ATTEMPT] < len(draws) and at[FAILURES] < PATIENCE:
        one, other = draws[at[ATTEMPT], 0] * lengths[-1], draws[at[ATTEMPT], 1] * lengths[-1]
        low, high = min(one, other), max(one, other)
        at[ATTEMPT] += 1
        at[FIRST] = _write_point(path, lengths, low, edge[0])
        at[LAST] = _write_point(path, lengths, high, edge[1])
        if at[FIRST] != at[LAST] and _gap(edge[0], edge[1]) <= high - low - LEAST_GAIN * lengths[-1]:
            return True
        at[FAILURES] += 1
    return False


@njit(cache=True, nogil=True)
def _answer_cut(work, is_free):  # type: ignore[no-untyped-def]
    path, edge, at, _, _ = work
    if not is_free:
        at[FAILURES] += 1
        return
    first, last = at[FIRST], at[LAST]
    shift = first + 2 - last  # of what follows: two points take the place of the vertices between
    if shift > 0:
        for number in range(at[SIZE] - 1, last, -1):
            path[number + shift] = path[number]
    else:
        for number in range(last + 1, at[SIZE]):
            path[number + shift] = path[number]
    path[first + 1], path[first + 2] = edge[0], edge[1]
    at[SIZE], at[FAILURES] = at[SIZE] + shift, 0


@njit(cache=True, nogil=True)
def _next_pull(work):  # type: ignore[no-untyped-def]
    path, edge, at, _, least = work
    if at[IS_SECOND]:
        return True
    while at[ROUND] < MOST_PULLS:
        at[VERTEX] += 1
        if at[VERTEX] < at[SIZE] - 1:
            before, vertex, after = path[at[VERTEX] - 1], path[at[VERTEX]], path[at[VERTEX] + 1]
            along, squares = 0.0, 1e-30
            for joint in range(len(vertex)):
                way = after[joint] - before[joint]
                along += (vertex[joint] - before[joint]) * way
                squares += way * way
            share = min(max(along / squares, 0.0), 1.0)
            for joint in range(len(vertex)):
                on_line = before[joint] + share * (after[joint] - before[joint])
                edge[0, joint], edge[1, joint] = before[joint], 0.5 * (vertex[joint] + on_line)
            gain = _gap(before, vertex) + _gap(vertex, after) - _gap(before, edge[1]) - _gap(edge[1], after)
            if gain >= least[0]:
                return True
        elif at[HAS_MOVED]:
            at[ROUND], at[VERTEX], at[HAS_MOVED] = at[ROUND] + 1, 0, 0
        else:
            break
    return False


@njit(cache=True, nogil=True)
def _answer_pull(work, is_free):  # type: ignore[no-untyped-def]
    path, edge, at, _, _ = work
    if is_free and not at[IS_SECOND]:
        edge[0], edge[1], at[IS_SECOND] = edge[1], path[at[VERTEX] + 1], 1
        return
    if is_free:
        path[at[VERTEX]], at[HAS_MOVED] = edge[0], 1
    at[IS_SECOND] = 0


@njit(cache=True, nogil=True)
def begin(work):  # type: ignore[no-untyped-def]
    """Begins with a new path; without random numbers only vertices are left out."""
    _begin(work, DROPS)


@njit(cache=True, nogil=True)
def shorten_in(work, edges, memory, verdict, *world):  # type: ignore[no-untyped-def]
    """Shortens a path in a world of bodies.

    Args:
        work: what `begin` was called with; changed.
        edges: how they are checked.
        memory: of edges that were checked; changed.
        verdict: FREE or BLOCKED about the edge for which the last call returned UNDECIDED; else UNKNOWN.
        world: what `arguments` returns.

    Returns:
        FINISHED. UNDECIDED: the bounds do not decide on the edge. PAUSED: EDGES edges were checked; to be called again.
    """
    bodies = world_of(world)
    workspace, edge = new_workspace(bodies), new_edge(edges)
    known = borrowed(memory)
    status = _shorten_in(borrowed(work), borrowed(edges), known, verdict, bodies, borrowed(edge), borrowed(workspace))
    release(workspace)
    edge.numbers[0] = 0
    return status


@njit(cache=True, nogil=True)
def _shorten_in(work, edges, memory, verdict, world, samples, workspace):  # type: ignore[no-untyped-def]
    no_rows = np.empty((0, 2), np.int64)
    if verdict != UNKNOWN:
        answer(work, verdict == FREE)
    for _ in range(EDGES):
        if not ask(work):
            return FINISHED
        start, end = work.edge[0], work.edge[1]
        verdict = recall(memory, start, end, edges.step)
        if verdict == UNKNOWN:
            verdict = check_edge(edges, world, start, end, samples, no_rows, workspace)
            if verdict == UNKNOWN:
                return UNDECIDED
            remember(memory, start, end, edges.step, verdict)
        answer(work, verdict == FREE)
    return PAUSED
