# SPDX-License-Identifier: BSD-3-Clause
"""Compiled path shortening in three stages.

- Dropping: vertices between two vertices with a free direct edge are removed; long edges are tried first.
- Shortcutting: random pairs of points on the path are connected by an edge if the edge is free and shorter.
- Pulling: each inner vertex moves halfway towards the line between its neighbours if both new edges are free.

`next_edge` proposes the next edge of a stage; `apply_verdict` changes the path if this edge is free.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_arrays import borrowed
from modular_framework_planning.collision_detection.kernels.compiled_collision import World, world_of
from modular_framework_planning.collision_detection.kernels.compiled_edges import (
    FREE,
    UNKNOWN,
    GroupEdges,
    check_edge,
    new_edge,
)
from modular_framework_planning.collision_detection.kernels.compiled_paths import (
    Samples,
    Workspace,
    new_workspace,
    release,
)
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import joint_distance
from modular_framework_planning.trajectory_processing.compiled_polylines import needed_vertices

MIN_SHORTCUT_GAIN = 0.01  # minimum gain of a shortcut, as a fraction of the path length
MIN_PULL_GAIN = 0.003  # minimum gain of a pulled vertex, as a fraction of the path length
MAX_PULL_ROUNDS = 2
MAX_FAILURES = 20  # consecutive failures that end the shortcutting stage
VERTEX_TOLERANCE = 1e-9  # minimum length of an edge [rad or m], and minimum change of the unit direction at a vertex
EDGES_PER_CALL = 100  # the caller checks the time after this number of edge checks

# Stages
DROPS, SHORTCUTS, PULLS, DONE = range(4)
# Return values of `shorten_in`
FINISHED, UNDECIDED, PAUSED = range(3)
# Indices into Shortening.progress: stage and number of vertices, then the values of each stage
STAGE, SIZE = 0, 1
BASE, CANDIDATE, KEPT = 2, 3, 4  # start and end vertex of the proposed edge, index of the last kept vertex
ATTEMPT, FAILURES, FIRST, LAST = 2, 3, 4, 5  # attempts, consecutive failures, vertices before the ends of the shortcut
PULL_ROUND, VERTEX, HAS_MOVED, CHECKS_SECOND_EDGE = 2, 3, 4, 5  # round, pulled vertex, and two flags


class Shortening(NamedTuple):
    """A path and the progress of its shortening.

    Attributes:
        path: Vertices of the path, shape (capacity, joints) [rad or m].
        edge: Proposed edge, shape (2, joints) [rad or m].
        progress: Values at the indices above, shape (6,).
        random_numbers: Random numbers from 0 to 1, shape (shortcuts, 2).
        min_gain: Minimum gain of a pulled vertex, shape (1,) [rad or m].
    """

    path: Array
    edge: Array
    progress: NDArray[np.int64]
    random_numbers: Array
    min_gain: Array


@njit(cache=True, nogil=True)
def _lengths(path: Array, size: int) -> Array:
    """Returns the path length up to each vertex."""
    lengths = np.zeros(size)
    for index in range(1, size):
        lengths[index] = lengths[index - 1] + joint_distance(path[index - 1], path[index])
    return lengths


@njit(cache=True, nogil=True)
def _enter_stage(shortening: Shortening, stage: int) -> None:
    """Enters a stage, or DONE for a path of two vertices."""
    path, _, progress, _, min_gain = shortening
    if stage == PULLS:
        kept = needed_vertices(path[: progress[SIZE]], VERTEX_TOLERANCE)
        for index in range(len(kept)):
            path[index] = path[kept[index]]
        progress[SIZE] = len(kept)
    progress[STAGE] = stage if progress[SIZE] > 2 else DONE
    progress[2:] = 0
    if stage == DROPS:
        progress[CANDIDATE] = progress[SIZE]
    elif stage == PULLS:
        min_gain[0] = MIN_PULL_GAIN * _lengths(path, progress[SIZE])[-1]


@njit(cache=True, nogil=True)
def next_edge(shortening: Shortening) -> bool:
    """Proposes the next edge that would change the path; returns False if the shortening is done."""
    progress = shortening.progress
    while progress[STAGE] != DONE:
        stage = progress[STAGE]
        if stage == DROPS:
            is_found = _next_drop(shortening)
        elif stage == SHORTCUTS:
            is_found = _next_shortcut(shortening)
        else:
            is_found = _next_pull(shortening)
        if is_found:
            return True
        _enter_stage(shortening, DONE if len(shortening.random_numbers) == 0 else stage + 1)
    return False


@njit(cache=True, nogil=True)
def apply_verdict(shortening: Shortening, is_free: bool) -> None:
    """Changes the path if the proposed edge is free."""
    stage = shortening.progress[STAGE]
    if stage == DROPS:
        if is_free:
            _keep(shortening, shortening.progress[CANDIDATE])
    elif stage == SHORTCUTS:
        _apply_shortcut_verdict(shortening, is_free)
    else:
        _apply_pull_verdict(shortening, is_free)


@njit(cache=True, nogil=True)
def _keep(shortening: Shortening, vertex: int) -> None:
    """Appends a vertex to the kept vertices."""
    path, _, progress, _, _ = shortening
    progress[KEPT] += 1
    path[progress[KEPT]] = path[vertex]
    progress[BASE], progress[CANDIDATE] = vertex, progress[SIZE]


@njit(cache=True, nogil=True)
def _next_drop(shortening: Shortening) -> bool:
    """Proposes the edge from the last kept vertex to the farthest untested vertex; returns False at the path's end."""
    path, edge, progress, _, _ = shortening
    while progress[BASE] < progress[SIZE] - 1:
        progress[CANDIDATE] -= 1
        if progress[CANDIDATE] > progress[BASE] + 1:
            edge[0], edge[1] = path[progress[KEPT]], path[progress[CANDIDATE]]
            return True
        _keep(shortening, progress[BASE] + 1)
    progress[SIZE] = progress[KEPT] + 1
    return False


@njit(cache=True, nogil=True)
def _write_point(path: Array, lengths: Array, path_position: float, out: Array) -> int:
    """Writes the point at a path position; returns the index of the vertex before this point."""
    index = min(max(int(np.searchsorted(lengths, path_position, side="right")) - 1, 0), len(lengths) - 2)
    span = lengths[index + 1] - lengths[index]
    fraction = 0.0 if span <= 0.0 else (path_position - lengths[index]) / span
    for joint in range(len(out)):
        out[joint] = path[index, joint] + fraction * (path[index + 1, joint] - path[index, joint])
    return index


@njit(cache=True, nogil=True)
def _next_shortcut(shortening: Shortening) -> bool:
    """Proposes the next random shortcut with sufficient gain; returns False after the last attempt."""
    path, edge, progress, random_numbers, _ = shortening
    if progress[SIZE] < 3:
        return False
    lengths = _lengths(path, progress[SIZE])
    while progress[ATTEMPT] < len(random_numbers) and progress[FAILURES] < MAX_FAILURES:
        first_position = random_numbers[progress[ATTEMPT], 0] * lengths[-1]
        second_position = random_numbers[progress[ATTEMPT], 1] * lengths[-1]
        low, high = min(first_position, second_position), max(first_position, second_position)
        progress[ATTEMPT] += 1
        progress[FIRST] = _write_point(path, lengths, low, edge[0])
        progress[LAST] = _write_point(path, lengths, high, edge[1])
        if (
            progress[FIRST] != progress[LAST]
            and joint_distance(edge[0], edge[1]) <= high - low - MIN_SHORTCUT_GAIN * lengths[-1]
        ):
            return True
        progress[FAILURES] += 1
    return False


@njit(cache=True, nogil=True)
def _apply_shortcut_verdict(shortening: Shortening, is_free: bool) -> None:
    """Replaces the vertices between the ends of a free shortcut by these ends."""
    path, edge, progress, _, _ = shortening
    if not is_free:
        progress[FAILURES] += 1
        return
    first, last = progress[FIRST], progress[LAST]
    index_shift = first + 2 - last  # index change of the vertices after the shortcut
    if index_shift > 0:
        for index in range(progress[SIZE] - 1, last, -1):
            path[index + index_shift] = path[index]
    else:
        for index in range(last + 1, progress[SIZE]):
            path[index + index_shift] = path[index]
    path[first + 1], path[first + 2] = edge[0], edge[1]
    progress[SIZE], progress[FAILURES] = progress[SIZE] + index_shift, 0


@njit(cache=True, nogil=True)
def _next_pull(shortening: Shortening) -> bool:
    """Proposes the edge to the next pulled vertex with sufficient gain; returns False after the last round."""
    path, edge, progress, _, min_gain = shortening
    if progress[CHECKS_SECOND_EDGE]:
        return True
    while progress[PULL_ROUND] < MAX_PULL_ROUNDS:
        progress[VERTEX] += 1
        if progress[VERTEX] < progress[SIZE] - 1:
            before, vertex, after = path[progress[VERTEX] - 1], path[progress[VERTEX]], path[progress[VERTEX] + 1]
            projection, squared_length = 0.0, 1e-30
            for joint in range(len(vertex)):
                offset = after[joint] - before[joint]
                projection += (vertex[joint] - before[joint]) * offset
                squared_length += offset * offset
            fraction = min(max(projection / squared_length, 0.0), 1.0)
            for joint in range(len(vertex)):
                on_line = before[joint] + fraction * (after[joint] - before[joint])
                edge[0, joint], edge[1, joint] = before[joint], 0.5 * (vertex[joint] + on_line)
            length = joint_distance(before, vertex) + joint_distance(vertex, after)
            if length - joint_distance(before, edge[1]) - joint_distance(edge[1], after) >= min_gain[0]:
                return True
        elif progress[HAS_MOVED]:
            progress[PULL_ROUND], progress[VERTEX], progress[HAS_MOVED] = progress[PULL_ROUND] + 1, 0, 0
        else:
            break
    return False


@njit(cache=True, nogil=True)
def _apply_pull_verdict(shortening: Shortening, is_free: bool) -> None:
    """Proposes the second edge of a pulled vertex if the first edge is free; moves the vertex if both are free."""
    path, edge, progress, _, _ = shortening
    if is_free and not progress[CHECKS_SECOND_EDGE]:
        edge[0], edge[1], progress[CHECKS_SECOND_EDGE] = edge[1], path[progress[VERTEX] + 1], 1
        return
    if is_free:
        path[progress[VERTEX]], progress[HAS_MOVED] = edge[0], 1
    progress[CHECKS_SECOND_EDGE] = 0


@njit(cache=True, nogil=True)
def begin(shortening: Shortening) -> None:
    """Starts the shortening of a new path; without random numbers, only the dropping stage runs."""
    _enter_stage(shortening, DROPS)


@njit(cache=True, nogil=True)
def shorten_in(shortening: Shortening, edges: GroupEdges, verdict: int, *world: NDArray[Any]) -> int:
    """Shortens a path with compiled edge checks.

    Args:
        shortening: Path, initialised by `begin`; changed in place.
        edges: Step of the edge checks, and map from the group to the robot.
        verdict: FREE or BLOCKED for the edge on which the last call returned UNDECIDED; otherwise UNKNOWN.
        *world: Arrays from `compiled_collision.arguments`.

    Returns:
        FINISHED: no stage is left. UNDECIDED: the proposed edge needs an exact check. PAUSED: the caller checks the
        clock and calls again.
    """
    bodies = world_of(world)
    workspace, edge = new_workspace(bodies), new_edge(edges)
    status = _shorten_in(borrowed(shortening), borrowed(edges), verdict, bodies, borrowed(edge), borrowed(workspace))
    release(workspace, edge)
    return status


@njit(cache=True, nogil=True)
def _shorten_in(
    shortening: Shortening,
    edges: GroupEdges,
    verdict: int,
    world: World,
    samples: Samples,
    workspace: Workspace,
) -> int:
    no_rows = np.empty((0, 2), np.int64)
    if verdict != UNKNOWN:
        apply_verdict(shortening, verdict == FREE)
    for _ in range(EDGES_PER_CALL):
        if not next_edge(shortening):
            return FINISHED
        start, end = shortening.edge[0], shortening.edge[1]
        verdict = check_edge(edges, world, start, end, samples, no_rows, workspace)
        if verdict == UNKNOWN:
            return UNDECIDED
        apply_verdict(shortening, verdict == FREE)
    return PAUSED
