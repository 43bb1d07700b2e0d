# SPDX-License-Identifier: BSD-3-Clause
"""Checks straight motions of a group of joints from within other compiled loops, and remembers the verdicts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_arrays import borrowed
from modular_framework_planning.collision_detection.kernels.compiled_collision import world_of
from modular_framework_planning.collision_detection.kernels.compiled_distance import CLEAR, TOO_CLOSE, TOUCHING
from modular_framework_planning.collision_detection.kernels.compiled_paths import (
    Samples,
    check_samples,
    count_verdict,
    new_workspace,
    number_samples,
    release,
)
from modular_framework_planning.geometry.spatial import Array

# What is known of an edge
UNKNOWN, FREE, BLOCKED = 0, 1, 2
REMEMBERED = 256  # edges; looking through them takes less than a hundredth of a check


class GroupEdges(NamedTuple):
    """How the straight motions of a group are checked.

    Attributes:
        rest: positions of the whole robot where the group's are 0; shape (all,).
        map: change of the robot's positions by the group's, mimic joints included; shape (all, joints).
        step: distance of the checks along an edge, of any joint [rad or m].
    """

    rest: Array
    map: Array
    step: float


class EdgeMemory(NamedTuple):
    """The edges that were checked last.

    Attributes:
        ends: joint vectors at the start and the end of each; shape (room, 2, joints).
        steps: at which each was checked [rad or m]; shape (room,).
        verdicts: FREE or BLOCKED; shape (room,).
        total: of all edges that were ever remembered; the latest take the places of the oldest; shape (1,).
    """

    ends: Array
    steps: Array
    verdicts: NDArray[np.int64]
    total: NDArray[np.int64]


def new_memory(joints: int) -> EdgeMemory:
    """Returns an empty memory of the edges of a group."""
    return EdgeMemory(
        np.empty((REMEMBERED, 2, joints)), np.empty(REMEMBERED), np.zeros(REMEMBERED, np.int64), np.zeros(1, np.int64)
    )


@njit(cache=True, nogil=True)
def recall(memory, start, end, step):  # type: ignore[no-untyped-def]
    """Returns the verdict about an edge at a step: FREE, BLOCKED, or UNKNOWN."""
    ends, steps, verdicts, total = memory
    for number in range(min(total[0], len(verdicts))):
        is_same = steps[number] == step
        for joint in range(len(start)):
            is_same = is_same and ends[number, 0, joint] == start[joint] and ends[number, 1, joint] == end[joint]
            if not is_same:
                break
        if is_same:
            return verdicts[number]
    return UNKNOWN


@njit(cache=True, nogil=True)
def remember(memory, start, end, step, verdict):  # type: ignore[no-untyped-def]
    """Remembers the verdict about an edge at a step."""
    ends, steps, verdicts, total = memory
    number = total[0] % len(verdicts)
    ends[number, 0], ends[number, 1], steps[number], verdicts[number] = start, end, step, verdict
    total[0] += 1


@njit(cache=True, nogil=True)
def new_edge(edges):  # type: ignore[no-untyped-def]
    """Returns working memory for one edge."""
    joints = len(edges.rest)
    return Samples(np.empty((2, joints)), np.empty(2, np.int64), np.empty((2, joints)))


@njit(cache=True, nogil=True)
def _write_positions(edges, state, out):  # type: ignore[no-untyped-def]
    """Writes the positions (all,) of the whole robot for a joint vector of the group."""
    for row in range(len(out)):
        out[row] = edges.rest[row]
        for joint in range(len(state)):
            out[row] += edges.map[row, joint] * state[joint]


@njit(cache=True, nogil=True)
def check_edge(edges, world, start, end, samples, undecided, workspace):  # type: ignore[no-untyped-def]
    """Returns FREE, BLOCKED, or UNKNOWN where the bounds do not decide; the start of the edge is not checked.

    Args:
        edges: how they are checked.
        world: what is checked.
        start: joint vector of the group.
        end: the same.
        samples: working memory, see `new_edge`.
        undecided: rows (n, 2) for what `check_samples` does not decide.
        workspace: working memory of `check_samples`.
    """
    _write_positions(edges, start, samples.vertices[0])
    _write_positions(edges, end, samples.vertices[1])
    number_samples(samples, edges.step)
    status, _ = check_samples(world, samples, 1, undecided, workspace)
    if status != TOO_CLOSE:  # else it is asked again elsewhere
        count_verdict(world.counts, status)
    return FREE if status == CLEAR else BLOCKED if status == TOUCHING else UNKNOWN


@njit(cache=True, nogil=True)
def check_edges(edges, motions, *world):  # type: ignore[no-untyped-def]
    """Returns what `check_edge` does for motions (n, 2, joints) in a world, which is what `arguments` returns."""
    bodies = world_of(world)
    workspace, samples = new_workspace(bodies), new_edge(edges)
    verdicts = np.empty(len(motions), np.int64)
    _check_all(borrowed(edges), bodies, motions, borrowed(samples), borrowed(workspace), verdicts)
    release(workspace)
    samples.numbers[0] = 0
    return verdicts


@njit(cache=True, nogil=True)
def _check_all(edges, world, motions, samples, workspace, verdicts):  # type: ignore[no-untyped-def]
    no_rows = np.empty((0, 2), np.int64)
    for number in range(len(motions)):
        start, end = motions[number, 0], motions[number, 1]
        verdicts[number] = check_edge(edges, world, start, end, samples, no_rows, workspace)
