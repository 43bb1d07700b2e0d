# SPDX-License-Identifier: BSD-3-Clause
"""RRT-Connect as one compiled loop that samples, grows trees and checks edges without calling Python.

Kuffner, LaValle: RRT-Connect: An efficient approach to single-query path planning, ICRA 2000. The smaller tree extends
to the next sample and the other tree connects to it, as in the same authors' "An efficient approach to path planning
using balanced bidirectional RRT search", CMU-RI-TR-05-34: balanced trees explore the narrower end as densely as the
other. A state whose extension was blocked accepts only nearby samples, as in Yershova, Jaillet, Simeon, LaValle:
Dynamic-domain RRTs, ICRA 2005. Otherwise an enclosed tree keeps extending into the same obstacle.

With a length bound the search accepts only shorter paths, as in Hauser, Zhou: Asymptotically optimal planning by
feasible kinodynamic planning in a state-cost space, IEEE T-RO 2016: each sample gets a random maximum path length, and
only states that respect this length can be its parent.

The loop returns to the interpreter for new samples, for larger trees, for an edge that the compiled check leaves
undecided, and regularly to read the clock.
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

# Return values of `grow`
FOUND, NEEDS_SAMPLES, NEEDS_CAPACITY, UNDECIDED, PAUSED, LIMIT_REACHED = range(6)
EXTEND, CONNECT = 0, 1
NEAREST_UNKNOWN = -1  # the state nearest to the target is not known yet
EDGES_PER_CALL = 200  # the caller checks the time and cancellation after this number of edge checks


class Trees(NamedTuple):
    """The trees from the start (0) and from the goals (1), and the progress of the search between two calls.

    Attributes:
        states: Joint vectors of the group, shape (2, capacity, joints) [rad or m].
        parents: Parent index of each state, -1 for a root, shape (2, capacity).
        blocked: Whether an extension from each state was blocked, shape (2, capacity).
        lengths: Weighted path length from the root to each state, shape (2, capacity).
        sizes: Number of states per tree, shape (2,).
        cursor: Index of the next sample, index of the growing tree, phase (EXTEND or CONNECT), and index of the state
            that grows (or NEAREST_UNKNOWN), shape (4,).
        target: State that the tree grows towards, shape (joints,).
        counts: Number of edge checks, number of extensions, extension limit, and number of edge checks at the next
            pause, shape (4,).
    """

    states: Array
    parents: NDArray[np.int64]
    blocked: NDArray[np.bool_]
    lengths: Array
    sizes: NDArray[np.int64]
    cursor: NDArray[np.int64]
    target: Array
    counts: NDArray[np.int64]


class Space(NamedTuple):
    """The joint space of a group with a weighted metric; all lengths below are weighted.

    Attributes:
        weights: Joint weights of the metric, shape (joints,).
        max_extension: Maximum length of an extension.
        domain_radius: Maximum distance at which a blocked state is extended to a sample.
        length_bound: Upper bound of the path length; infinite to accept any path.
        edges: Mapping and step of the edge checks.
    """

    weights: Array
    max_extension: float
    domain_radius: float
    length_bound: float
    edges: GroupEdges


@njit(cache=True, nogil=True)
def _squared_distance(first: Array, second: Array, weights: Array) -> float:
    length = 0.0
    for joint in range(len(first)):
        gap = weights[joint] * (second[joint] - first[joint])
        length += gap * gap
    return length


@njit(cache=True, nogil=True)
def _nearest(
    states: Array, lengths: Array, tree: int, size: int, target: Array, weights: Array, max_length: float
) -> int:
    """Returns the index of the tree's state nearest to a joint vector.

    Only states whose path from the root to the joint vector is no longer than `max_length` qualify; -1 if none does.
    """
    best, nearest, joints = np.inf, -1, len(target)
    for index in range(size):
        length = 0.0
        for joint in range(joints):
            gap = weights[joint] * (target[joint] - states[tree, index, joint])
            length += gap * gap
        if length < best and (max_length == np.inf or lengths[tree, index] + np.sqrt(length) <= max_length):
            best, nearest = length, index
    return nearest


@njit(cache=True, nogil=True)
def _distance_to_root(
    states: Array, parents: NDArray[np.int64], tree: int, size: int, target: Array, weights: Array
) -> float:
    """Returns the weighted distance from a joint vector to the nearest root of a tree."""
    best = np.inf
    for index in range(size):
        if parents[tree, index] >= 0:
            break
        best = min(best, _squared_distance(states[tree, index], target, weights))
    return np.sqrt(best)


@njit(cache=True, nogil=True)
def _max_length_to_sample(trees: Trees, space: Space, tree: int, sample: Array) -> float:
    """Returns the maximum path length from the root of a tree to a sample; -1 if every path through it is too long.

    The sample's last value, from 0 to 1, interpolates between the straight distance and the length the bound leaves.
    """
    if space.length_bound == np.inf:
        return np.inf
    target, distances = sample[:-1], np.empty(2)
    for side in range(2):
        distances[side] = _distance_to_root(trees.states, trees.parents, side, trees.sizes[side], target, space.weights)
    slack = space.length_bound - distances[0] - distances[1]
    return distances[tree] + sample[-1] * slack if slack > 0.0 else -1.0


@njit(cache=True, nogil=True)
def write_step(start: Array, target: Array, space: Space, out: Array) -> bool:
    """Writes the end of an extension towards a target, at most `max_extension` away from the start.

    Args:
        start: Joint vector of the group.
        target: Joint vector to extend towards.
        space: Joint space of the search.
        out: Output joint vector, shape (joints,).

    Returns:
        Whether the extension reaches the target.
    """
    length = np.sqrt(_squared_distance(start, target, space.weights))
    fraction = space.max_extension / length if length > space.max_extension else 1.0
    for joint in range(len(out)):
        out[joint] = target[joint] if fraction == 1.0 else start[joint] + fraction * (target[joint] - start[joint])
    return fraction == 1.0


@njit(cache=True, nogil=True)
def grow(trees: Trees, space: Space, samples: Array, verdict: int, *world: NDArray[Any]) -> int:
    """Grows the trees until they meet.

    Args:
        trees: State of the search; changed in place.
        space: Joint space of the search.
        samples: Random states, shape (n, joints); with a length bound, shape (n, joints + 1), where the last column
            holds random numbers from 0 to 1.
        verdict: FREE or BLOCKED for the edge on which the last call returned UNDECIDED; otherwise UNKNOWN.
        world: Result of `arguments`.

    Returns:
        FOUND: the last states of both trees are equal. NEEDS_SAMPLES: all samples are used. NEEDS_CAPACITY: a tree is
        full. LIMIT_REACHED: the extension limit is used up. UNDECIDED: the next extension towards `target` needs an
        exact check. PAUSED: the caller checks the clock and calls again.
    """
    bodies = world_of(world)
    workspace, edge = new_workspace(bodies), new_edge(space.edges)
    status = _grow(borrowed(trees), borrowed(space), samples, verdict, bodies, borrowed(edge), borrowed(workspace))
    release(workspace, edge)
    return status


@njit(cache=True, nogil=True)
def _grow(
    trees: Trees, space: Space, samples: Array, verdict: int, world: World, edge: Samples, workspace: Workspace
) -> int:
    """Implements `grow` with preallocated working memory; arrays are passed without owner (see `borrowed`)."""
    states, parents, blocked, lengths, sizes, cursor, target, counts = trees
    state, no_rows = np.empty(len(target)), np.empty((0, 2), np.int64)
    while True:
        if counts[0] >= counts[3] and verdict == UNKNOWN:
            return PAUSED
        if cursor[3] == NEAREST_UNKNOWN:
            if cursor[2] == EXTEND:
                if counts[1] == counts[2]:
                    return LIMIT_REACHED
                if cursor[0] == len(samples):
                    return NEEDS_SAMPLES
                cursor[1] = 0 if sizes[0] <= sizes[1] else 1
                target[:] = samples[cursor[0], : len(target)]
                max_length = _max_length_to_sample(trees, space, cursor[1], samples[cursor[0]])
                cursor[0] += 1
            else:  # connect to the last state of the other tree
                other = 1 - cursor[1]
                max_length = space.length_bound - lengths[other, sizes[other] - 1]
            tree = cursor[1]
            cursor[3] = _nearest(states, lengths, tree, sizes[tree], target, space.weights, max_length)
            if cursor[3] < 0:  # no state qualifies; cursor[3] is NEAREST_UNKNOWN again
                counts[1] += cursor[2] == EXTEND
                cursor[2] = EXTEND
                continue
            if cursor[2] == EXTEND:
                nearest = states[tree, cursor[3]]
                if (
                    blocked[tree, cursor[3]]
                    and _squared_distance(nearest, target, space.weights) > space.domain_radius**2
                ):
                    cursor[3] = NEAREST_UNKNOWN
                    continue
                counts[1] += 1
        tree = cursor[1]
        if sizes[tree] == parents.shape[1]:
            return NEEDS_CAPACITY
        start = states[tree, cursor[3]]
        reached = write_step(start, target, space, state)
        if verdict == UNKNOWN:
            counts[0] += 1
            verdict = check_edge(space.edges, world, start, state, edge, no_rows, workspace)
            if verdict == UNKNOWN:
                return UNDECIDED
        is_free, verdict = verdict == FREE, UNKNOWN
        if is_free:
            states[tree, sizes[tree]], parents[tree, sizes[tree]] = state, cursor[3]
            step = np.sqrt(_squared_distance(start, state, space.weights))
            lengths[tree, sizes[tree]] = lengths[tree, cursor[3]] + step
            sizes[tree] += 1
        elif cursor[2] == EXTEND:
            blocked[tree, cursor[3]] = True
        if cursor[2] == EXTEND:
            cursor[3] = NEAREST_UNKNOWN
            if is_free:
                cursor[1], cursor[2], target[:] = 1 - tree, CONNECT, state
        elif not is_free:
            cursor[2], cursor[3] = EXTEND, NEAREST_UNKNOWN
        elif reached:
            return FOUND
        else:
            cursor[3] = sizes[tree] - 1
