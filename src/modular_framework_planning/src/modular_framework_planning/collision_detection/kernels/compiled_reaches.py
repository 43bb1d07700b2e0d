# SPDX-License-Identifier: BSD-3-Clause
"""Reach of each joint, and the last common joint of each pair of bodies, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array


@njit(cache=True, nogil=True)
def joint_lengths(placements: Array) -> Array:
    """Returns the distance of each joint, at position zero, from its parent joint, shape (n,) [m]; see Tree."""
    return np.sqrt((placements[:, :, 3] ** 2).sum(axis=1))


@njit(cache=True, nogil=True)
def body_reaches(
    parents: NDArray[np.int64], placements: Array, joints: NDArray[np.int64], poses: Array, spheres: Array
) -> Array:
    """Returns an upper bound of the distance from each joint to the points that the joint moves, shape (n,) [m].

    The bound of a joint is the maximum of |c| + r over its bodies, with bounding sphere c and r, and of length + bound
    over its child joints. It holds for all positions of revolute joints if the prismatic joints are at zero. Unbounded
    bodies, such as planes, are left out.

    Args:
        parents: Index of each joint's parent, -1 for none; shape (n,).
        placements: Pose of each joint at position zero in its parent's frame, shape (n, 3, 4).
        joints: Joint that moves each body, -1 for the world; shape (b,).
        poses: Pose of each body in its joint's frame, shape (b, 3, 4).
        spheres: Bounding sphere of each body, shape (b, 4) [m].
    """
    result, lengths = np.zeros(len(parents)), joint_lengths(placements)
    for body in range(len(joints)):
        joint, x, y, z = joints[body], spheres[body, 0], spheres[body, 1], spheres[body, 2]
        if joint < 0 or not np.isfinite(x + y + z + spheres[body, 3]):
            continue
        squared_distance = 0.0
        for row in range(3):
            pose = poses[body, row]
            squared_distance += (pose[0] * x + pose[1] * y + pose[2] * z + pose[3]) ** 2
        result[joint] = max(result[joint], np.sqrt(squared_distance) + spheres[body, 3])
    for joint in range(len(parents) - 1, -1, -1):
        if parents[joint] >= 0:
            result[parents[joint]] = max(result[parents[joint]], lengths[joint] + result[joint])
    return result


@njit(cache=True, nogil=True)
def _common_joint(parents: NDArray[np.int64], first: int, second: int) -> int:
    """Returns the lowest common ancestor of two joints, -1 for none."""
    while first != second:  # parents have smaller indices than their children
        if first > second:
            first = parents[first]
        else:
            second = parents[second]
    return first


@njit(cache=True, nogil=True)
def common_joints(pairs: NDArray[np.int64], joints: NDArray[np.int64], parents: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the last joint that moves both bodies of each pair, -1 for none; shape (p,).

    Args:
        pairs: Body indices, shape (p, 2).
        joints: Joint that moves each body, -1 for the world; shape (b,).
        parents: Index of each joint's parent, -1 for none; shape (n,).
    """
    result = np.full(len(pairs), -1)
    for pair in range(len(pairs)):
        result[pair] = _common_joint(parents, joints[pairs[pair, 0]], joints[pairs[pair, 1]])
    return result
