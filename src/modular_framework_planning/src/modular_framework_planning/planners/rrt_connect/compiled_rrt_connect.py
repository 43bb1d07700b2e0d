# SPDX-License-Identifier: BSD-3-Clause
"""RRT-Connect as one compiled loop that samples, grows trees and checks edges without calling Python.

Kuffner, LaValle: RRT-Connect: An efficient approach to single-query path planning, ICRA 2000. The smaller tree extends
to the next sample and the other tree connects to it, as in the same authors' "An efficient approach to path planning
using balanced bidirectional RRT search", CMU-RI-TR-05-34: balanced trees explore the narrower end as densely as the
other. A state whose extension was blocked accepts only nearby samples, as in Yershova, Jaillet, Simeon, LaValle:
Dynamic-domain RRTs, ICRA 2005. Without this rule, an enclosed tree keeps extending into the same obstacle.

With a length bound, the search accepts only shorter paths, as in Hauser, Zhou: Asymptotically optimal planning by
feasible kinodynamic planning in a state-cost space, IEEE T-RO 2016. Each sample gets a random maximum path length; only
states that respect this length can become the sample's parent.

The loop returns to the interpreter for new samples, for larger trees, for an edge that the compiled check leaves
undecided, and regularly for a check of the clock.
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
# Indices into Trees.cursor: next sample, growing tree, phase, and state to extend
SAMPLE, TREE, PHASE, NEAREST = range(4)
EXTEND, CONNECT = range(2)  # phases
NEAREST_UNKNOWN = -1  # the state nearest to the target is not known yet
# Indices into Trees.counts: edge checks, extensions, maximum number of extensions, and edge checks at the next pause
EDGE_CHECKS, EXTENSIONS, EXTENSION_LIMIT, NEXT_PAUSE = range(4)
EDGES_PER_CALL = 200  # the caller checks the time and cancellation after this number of edge checks


class Trees(NamedTuple):
    """The trees from the start (0) and from the goals (1), and the progress of the search between two calls.

    Attributes:
        states: Joint vectors of the group, shape (2, capacity, joints) [rad or m].
        parents: Parent index of each state, -1 for a root, shape (2, capacity).
        blocked: Whether an extension from each state was blocked, shape (2, capacity).
        lengths: Weighted path length from the root to each state, shape (2, capacity).
        sizes: Number of states per tree, shape (2,).
        cursor: Position of the search, at the indices SAMPLE to NEAREST, shape (4,).
        target: State that the tree grows towards, shape (joints,).
        counts: Counters and limits, at the indices EDGE_CHECKS to NEXT_PAUSE, shape (4,).
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
    """The joint space of a group with a weighted metric; all lengths are weighted [rad or m].

    Attributes:
        weights: Joint weights of the metric, shape (joints,).
        max_extension: Maximum length of an extension.
        domain_radius: Maximum distance at which a blocked state is extended to a sample.
        length_bound: Upper bound of the path length; infinite to accept any path.
        edges: Step of the edge checks, and map from the group to the robot.
    """

    weights: Array
    max_extension: float
    domain_radius: float
    length_bound: float
    edges: GroupEdges


@njit(cache=True, nogil=True)
def _squared_distance(first: Array, second: Array, weights: Array) -> float:
    square = 0.0
    for joint in range(len(first)):
        gap = weights[joint] * (second[joint] - first[joint])
        square += gap * gap
    return square


@njit(cache=True, nogil=True)
def _nearest(
    states: Array, lengths: Array, tree: int, size: int, target: Array, weights: Array, max_length: float
) -> int:
    """Returns the index of the tree's state nearest to a target, -1 if no state qualifies.

    A state qualifies if the path from the root through the state to the target is not longer than `max_length`.
    """
    min_square, nearest, joints = np.inf, -1, len(target)
    for index in range(size):
        square = 0.0
        for joint in range(joints):
            gap = weights[joint] * (target[joint] - states[tree, index, joint])
            square += gap * gap
        if square < min_square and (max_length == np.inf or lengths[tree, index] + np.sqrt(square) <= max_length):
            min_square, nearest = square, index
    return nearest


@njit(cache=True, nogil=True)
def _distance_to_root(
    states: Array, parents: NDArray[np.int64], tree: int, size: int, target: Array, weights: Array
) -> float:
    """Returns the weighted distance from a joint vector to the nearest root of a tree; the roots are stored first."""
    min_square = np.inf
    for index in range(size):
        if parents[tree, index] >= 0:
            break
        min_square = min(min_square, _squared_distance(states[tree, index], target, weights))
    return np.sqrt(min_square)


@njit(cache=True, nogil=True)
def _max_length_to_sample(trees: Trees, space: Space, tree: int, sample: Array) -> float:
    """Returns the maximum path length from the root of a tree to a sample; -1 if every path through it is too long.

    The last value r of the sample, from 0 to 1, gives d + r (bound - d - e), with d and e the distances of the sample
    from the roots of this tree and of the other tree.
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
        start: Joint vector of the group, shape (joints,) [rad or m].
        target: Joint vector to extend towards, shape (joints,) [rad or m].
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
        samples: Random states, shape (n, joints); with a length bound, shape (n, joints + 1) with random numbers from
            0 to 1 in the last column.
        verdict: FREE or BLOCKED for the edge on which the last call returned UNDECIDED; otherwise UNKNOWN.
        *world: Arrays from `compiled_collision.arguments`.

    Returns:
        FOUND: the last states of both trees are equal. NEEDS_SAMPLES: all samples are used. NEEDS_CAPACITY: a tree is
        full. LIMIT_REACHED: the maximum number of extensions is reached. UNDECIDED: the next extension towards `target`
        needs an exact check. PAUSED: the caller checks the clock and calls again.
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
    """Implements `grow` with given working memory and borrowed arrays."""
    states, parents, blocked, lengths, sizes, cursor, target, counts = trees
    state, no_rows = np.empty(len(target)), np.empty((0, 2), np.int64)
    while True:
        if counts[EDGE_CHECKS] >= counts[NEXT_PAUSE] and verdict == UNKNOWN:
            return PAUSED
        if cursor[NEAREST] == NEAREST_UNKNOWN:
            if cursor[PHASE] == EXTEND:
                if counts[EXTENSIONS] == counts[EXTENSION_LIMIT]:
                    return LIMIT_REACHED
                if cursor[SAMPLE] == len(samples):
                    return NEEDS_SAMPLES
                cursor[TREE] = 0 if sizes[0] <= sizes[1] else 1
                target[:] = samples[cursor[SAMPLE], : len(target)]
                max_length = _max_length_to_sample(trees, space, cursor[TREE], samples[cursor[SAMPLE]])
                cursor[SAMPLE] += 1
            else:  # connect to the last state of the other tree
                other = 1 - cursor[TREE]
                max_length = space.length_bound - lengths[other, sizes[other] - 1]
            tree = cursor[TREE]
            cursor[NEAREST] = _nearest(states, lengths, tree, sizes[tree], target, space.weights, max_length)
            if cursor[NEAREST] < 0:  # no state qualifies; cursor[NEAREST] is NEAREST_UNKNOWN again
                counts[EXTENSIONS] += cursor[PHASE] == EXTEND
                cursor[PHASE] = EXTEND
                continue
            if cursor[PHASE] == EXTEND:
                nearest = states[tree, cursor[NEAREST]]
                if (
                    blocked[tree, cursor[NEAREST]]
                    and _squared_distance(nearest, target, space.weights) > space.domain_radius**2
                ):
                    cursor[NEAREST] = NEAREST_UNKNOWN
                    continue
                counts[EXTENSIONS] += 1
        tree = cursor[TREE]
        if sizes[tree] == parents.shape[1]:
            return NEEDS_CAPACITY
        start = states[tree, cursor[NEAREST]]
        reached = write_step(start, target, space, state)
        if verdict == UNKNOWN:
            counts[EDGE_CHECKS] += 1
            verdict = check_edge(space.edges, world, start, state, edge, no_rows, workspace)
            if verdict == UNKNOWN:
                return UNDECIDED
        is_free, verdict = verdict == FREE, UNKNOWN
        if is_free:
            states[tree, sizes[tree]], parents[tree, sizes[tree]] = state, cursor[NEAREST]
            step = np.sqrt(_squared_distance(start, state, space.weights))
            lengths[tree, sizes[tree]] = lengths[tree, cursor[NEAREST]] + step
            sizes[tree] += 1
        elif cursor[PHASE] == EXTEND:
            blocked[tree, cursor[NEAREST]] = True
        if cursor[PHASE] == EXTEND:
            cursor[NEAREST] = NEAREST_UNKNOWN
            if is_free:
                cursor[TREE], cursor[PHASE], target[:] = 1 - tree, CONNECT, state
        elif not is_free:
            cursor[PHASE], cursor[NEAREST] = EXTEND, NEAREST_UNKNOWN
        elif reached:
            return FOUND
        else:
            cursor[NEAREST] = sizes[tree] - 1
