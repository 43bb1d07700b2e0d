# SPDX-License-Identifier: BSD-3-Clause
"""RRT-Connect as one compiled loop: samples, trees and checks of edges without a call of Python between them.

Kuffner, LaValle: RRT-Connect: An efficient approach to single-query path planning, ICRA 2000. The smaller tree extends
to the next sample and the other one connects to it, as in the same authors' "An efficient approach to path planning
using balanced bidirectional RRT search", CMU-RI-TR-05-34: the tree in the narrower place grows as large as the other
one. A state whose extension met an obstacle is extended to samples near to it alone, as in Yershova, Jaillet, Simeon,
LaValle: Dynamic-domain RRTs, ICRA 2005: else trees that cannot grow meet the same obstacle again and again.

With a bound it looks for paths that are shorter than that, as in Hauser, Zhou: Asymptotically optimal planning by
feasible kinodynamic planning in a state-cost space, IEEE T-RO 2016: each sample has a length that the way to it may
have, and is reached only from states that allow for that.

The loop returns where it needs the interpreter: for more samples, for larger trees, for an edge that the bounds leave
undecided, and every few edges for the clock.
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
    GroupEdges,
    check_edge,
    new_edge,
)
from modular_framework_planning.collision_detection.kernels.compiled_paths import new_workspace, release
from modular_framework_planning.geometry.spatial import Array

# What `grow` returns
FOUND, NEEDS_SAMPLES, NEEDS_ROOM, UNDECIDED, PAUSED, AT_LIMIT = range(6)
EXTENDS, CONNECTS = 0, 1
NEW = -1  # target, for which the nearest state is not known yet
EDGES = 200  # that are checked before a pause, so that the clock and a cancellation are looked at in between


class Trees(NamedTuple):
    """The trees from the start (0) and from the goals (1), and where the search stands between two calls.

    Attributes:
        states: joint vectors of the group [rad or m]; shape (2, room, joints).
        parents: of each state, -1 for a root; shape (2, room).
        blocked: whether an extension of each state met an obstacle; shape (2, room).
        lengths: weighted length of the way to each state from the root of its tree; shape (2, room).
        sizes: how many states each tree has; shape (2,).
        position: next sample; tree that grows; EXTENDS or CONNECTS; state at which it grows, or NEW; shape (4,).
        target: state that it grows to; shape (joints,).
        counts: edges that were checked, extensions that were tried, how many may be, and edges at which the search
            pauses; shape (4,).
    """

    states: Array
    parents: NDArray[np.int64]
    blocked: NDArray[np.bool_]
    lengths: Array
    sizes: NDArray[np.int64]
    position: NDArray[np.int64]
    target: Array
    counts: NDArray[np.int64]


class Space(NamedTuple):
    """The joint space of a group, in which lengths are weighted.

    Attributes:
        weights: of each joint in a length; shape (joints,).
        longest: most a tree grows by at once, in weighted length.
        domain: how far a sample may be from a blocked state that is extended to it, in weighted length.
        bound: the path has to be shorter than that, in weighted length; infinite for any path.
        edges: how the edges of the trees are checked.
    """

    weights: Array
    longest: float
    domain: float
    bound: float
    edges: GroupEdges


@njit(cache=True, nogil=True)
def _squared_length(one, other, weights):  # type: ignore[no-untyped-def]
    length = 0.0
    for joint in range(len(one)):
        gap = weights[joint] * (other[joint] - one[joint])
        length += gap * gap
    return length


@njit(cache=True, nogil=True)
def _nearest(states, lengths, tree, size, target, weights, most):  # type: ignore[no-untyped-def]
    """Returns the number of the state of a tree that is nearest to a joint vector.

    The way from the root over that state is no longer than `most`; -1 where there is none.
    """
    best, found, joints = np.inf, -1, len(target)
    for number in range(size):
        length = 0.0
        for joint in range(joints):
            gap = weights[joint] * (target[joint] - states[tree, number, joint])
            length += gap * gap
        if length < best and (most == np.inf or lengths[tree, number] + np.sqrt(length) <= most):
            best, found = length, number
    return found


@njit(cache=True, nogil=True)
def _length_to_root(states, parents, tree, size, target, weights):  # type: ignore[no-untyped-def]
    """Returns the weighted length of the straight way from a joint vector to the nearest root of a tree."""
    best = np.inf
    for number in range(size):
        if parents[tree, number] >= 0:
            break
        best = min(best, _squared_length(states[tree, number], target, weights))
    return np.sqrt(best)


@njit(cache=True, nogil=True)
def _most_to_sample(trees, space, tree, sample):  # type: ignore[no-untyped-def]
    """Returns how long the way from the root of a tree to a sample may be; -1 where no path over it is short enough.

    The sample's last value, in 0 to 1, chooses a length between the straight way's and what the bound leaves.
    """
    if space.bound == np.inf:
        return np.inf
    target, ways = sample[:-1], np.empty(2)
    for one in range(2):
        ways[one] = _length_to_root(trees.states, trees.parents, one, trees.sizes[one], target, space.weights)
    left = space.bound - ways[0] - ways[1]
    return ways[tree] + sample[-1] * left if left > 0.0 else -1.0


@njit(cache=True, nogil=True)
def write_step(here, target, space, out):  # type: ignore[no-untyped-def]
    """Writes the state (joints,) on the way from one state to another, `longest` away from the first at most.

    Returns:
        Whether it is the other state.
    """
    length = np.sqrt(_squared_length(here, target, space.weights))
    share = space.longest / length if length > space.longest else 1.0
    for joint in range(len(out)):
        out[joint] = target[joint] if share == 1.0 else here[joint] + share * (target[joint] - here[joint])
    return share == 1.0


@njit(cache=True, nogil=True)
def grow(trees, space, samples, verdict, *world):  # type: ignore[no-untyped-def]
    """Grows the trees until they meet.

    Args:
        trees: the search; changed.
        space: in which it runs.
        samples: random states, shape (n, joints); with a bound they have a number in 0 to 1 each behind the joints.
        verdict: FREE or BLOCKED about the edge for which the last call returned UNDECIDED; else UNKNOWN.
        world: what `arguments` returns.

    Returns:
        FOUND: the last states of both trees are the same. NEEDS_SAMPLES: all samples are used. NEEDS_ROOM: a tree is
        full. AT_LIMIT: the last extension that may be was tried. UNDECIDED: the edge from the state at which a tree
        grows to `target`, `longest` of it at most. PAUSED: to be called again.
    """
    bodies = world_of(world)
    workspace, edge = new_workspace(bodies), new_edge(space.edges)
    status = _grow(borrowed(trees), borrowed(space), samples, verdict, bodies, borrowed(edge), borrowed(workspace))
    release(workspace)
    edge.numbers[0] = 0
    return status


@njit(cache=True, nogil=True)
def _grow(trees, space, samples, verdict, world, edge, workspace):  # type: ignore[no-untyped-def]
    """Does what `grow` does, in given working memory; none of the arrays should have an owner (see `borrowed`)."""
    states, parents, blocked, lengths, sizes, position, target, counts = trees
    state, no_rows = np.empty(len(target)), np.empty((0, 2), np.int64)
    while True:
        if counts[0] >= counts[3] and verdict == UNKNOWN:
            return PAUSED
        if position[3] == NEW:
            if position[2] == EXTENDS:
                if counts[1] == counts[2]:
                    return AT_LIMIT
                if position[0] == len(samples):
                    return NEEDS_SAMPLES
                position[1] = 0 if sizes[0] <= sizes[1] else 1
                target[:] = samples[position[0], : len(target)]
                most = _most_to_sample(trees, space, position[1], samples[position[0]])
                position[0] += 1
            else:  # to the last state of the other tree
                other = 1 - position[1]
                most = space.bound - lengths[other, sizes[other] - 1]
            tree = position[1]
            position[3] = _nearest(states, lengths, tree, sizes[tree], target, space.weights, most)
            if position[3] < 0:  # none may be on the way, and position[3] is NEW
                counts[1] += position[2] == EXTENDS
                position[2] = EXTENDS
                continue
            if position[2] == EXTENDS:
                nearest = states[tree, position[3]]
                if blocked[tree, position[3]] and _squared_length(nearest, target, space.weights) > space.domain**2:
                    position[3] = NEW
                    continue
                counts[1] += 1
        tree = position[1]
        if sizes[tree] == parents.shape[1]:
            return NEEDS_ROOM
        here = states[tree, position[3]]
        reached = write_step(here, target, space, state)
        if verdict == UNKNOWN:
            counts[0] += 1
            verdict = check_edge(space.edges, world, here, state, edge, no_rows, workspace)
            if verdict == UNKNOWN:
                return UNDECIDED
        is_free, verdict = verdict == FREE, UNKNOWN
        if is_free:
            states[tree, sizes[tree]], parents[tree, sizes[tree]] = state, position[3]
            step = np.sqrt(_squared_length(here, state, space.weights))
            lengths[tree, sizes[tree]] = lengths[tree, position[3]] + step
            sizes[tree] += 1
        elif position[2] == EXTENDS:
            blocked[tree, position[3]] = True
        if position[2] == EXTENDS:
            position[3] = NEW
            if is_free:
                position[1], position[2], target[:] = 1 - tree, CONNECTS, state
        elif not is_free:
            position[2], position[3] = EXTENDS, NEW
        elif reached:
            return FOUND
        else:
            position[3] = sizes[tree] - 1
