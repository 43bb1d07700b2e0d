# SPDX-License-Identifier: BSD-3-Clause
"""Collision checks of edges (straight joint motions) for compiled planners."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_collision import World
from modular_framework_planning.collision_detection.kernels.compiled_distance import CLEAR, TOO_CLOSE, TOUCHING
from modular_framework_planning.collision_detection.kernels.compiled_paths import (
    Samples,
    Workspace,
    check_samples,
    count_verdict,
    index_samples,
)
from modular_framework_planning.geometry.spatial import Array

UNKNOWN, FREE, BLOCKED = 0, 1, 2  # results of an edge check


class GroupEdges(NamedTuple):
    """Step of edge checks, and the map from joint vectors of a group to the robot: rest + joint_map @ vector.

    Attributes:
        rest: Joint positions of the whole robot with the group's joints at 0, shape (all,) [rad or m].
        joint_map: Derivative of the robot's joint positions by the group's, mimic joints included; shape (all, joints).
        step: Maximum joint distance between samples of an edge [rad or m].
    """

    rest: Array
    joint_map: Array
    step: float


@njit(cache=True, nogil=True)
def new_edge(edges: GroupEdges) -> Samples:
    """Returns working memory for the samples of an edge."""
    joints = len(edges.rest)
    return Samples(np.empty((2, joints)), np.empty(2, np.int64), np.empty((2, joints)))


@njit(cache=True, nogil=True)
def _write_positions(edges: GroupEdges, state: Array, out: Array) -> None:
    """Writes the robot's joint positions, shape (all,), for a joint vector of the group."""
    for row in range(len(out)):
        out[row] = edges.rest[row]
        for joint in range(len(state)):
            out[row] += edges.joint_map[row, joint] * state[joint]


@njit(cache=True, nogil=True)
def check_edge(
    edges: GroupEdges,
    world: World,
    start: Array,
    end: Array,
    samples: Samples,
    undecided: NDArray[np.int64],
    workspace: Workspace,
) -> int:
    """Checks an edge except for its start; returns FREE, BLOCKED, or UNKNOWN if the distance bounds do not decide.

    Args:
        edges: Step, and map from the group to the robot.
        world: Bodies and pairs.
        start: Joint vector of the group at the start [rad or m].
        end: Joint vector of the group at the end [rad or m].
        samples: Working memory, see `new_edge`.
        undecided: Filled by `check_samples`, shape (n, 2).
        workspace: Working memory of `check_samples`.
    """
    _write_positions(edges, start, samples.vertices[0])
    _write_positions(edges, end, samples.vertices[1])
    index_samples(samples, edges.step)
    status, _ = check_samples(world, samples, 1, undecided, workspace)
    if status != TOO_CLOSE:  # undecided edges are counted by the exact check
        count_verdict(world.counts, status)
    return FREE if status == CLEAR else BLOCKED if status == TOUCHING else UNKNOWN
