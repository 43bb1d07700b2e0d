# SPDX-License-Identifier: BSD-3-Clause
"""Measures a kinematic tree: distances from joints to what they carry, and joints that two bodies share, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from modular_framework_planning.collision_detection.kernels.compiled_collision import FIELD


@njit(cache=True, nogil=True)
def joint_lengths(placements):  # type: ignore[no-untyped-def]
    """Returns how far each joint at zero is from the one it hangs on [m], shape (joints,)."""
    return np.sqrt((placements[:, :, 3] ** 2).sum(axis=1))


@njit(cache=True, nogil=True)
def ways_to_ends(parents, placements, joints, poses, spheres):  # type: ignore[no-untyped-def]
    """Returns the way from each joint to the far end of the bodies it carries, shape (joints,) [m].

    Sliding joints stand at zero. Bodies without an end, as a plane, do not count.

    Args:
        parents: of the joints, see Tree.
        placements: of the joints, see Tree.
        joints: of the bodies, see World.
        poses: of the bodies, see World.
        spheres: of the bodies, see World.
    """
    result, lengths = np.zeros(len(parents)), joint_lengths(placements)
    for body in range(len(joints)):
        joint, x, y, z = joints[body], spheres[body, 0], spheres[body, 1], spheres[body, 2]
        if joint < 0 or not np.isfinite(x + y + z + spheres[body, 3]):
            continue
        square = 0.0
        for row in range(3):
            pose = poses[body, row]
            square += (pose[0] * x + pose[1] * y + pose[2] * z + pose[3]) ** 2
        result[joint] = max(result[joint], np.sqrt(square) + spheres[body, 3])
    for joint in range(len(parents) - 1, -1, -1):
        if parents[joint] >= 0:
            result[parents[joint]] = max(result[parents[joint]], lengths[joint] + result[joint])
    return result


@njit(cache=True, nogil=True)
def _common_joint(parents, first, second):  # type: ignore[no-untyped-def]
    """Returns the last joint that both joints depend on, -1 for none."""
    while first != second:  # parents come before children
        if first > second:
            first = parents[first]
        else:
            second = parents[second]
    return first


@njit(cache=True, nogil=True)
def meeting_joints(pairs, joints, parents):  # type: ignore[no-untyped-def]
    """Returns the last joint that moves both bodies of each pair, see World.meets.

    Args:
        pairs: Body numbers, shape (p, 2); the second one is FIELD for solids of the world.
        joints: Joint that moves each body, -1 for the world; shape (b,).
        parents: Parent of each joint, see Tree.
    """
    meets = np.full(len(pairs), -1)
    for pair in range(len(pairs)):
        if pairs[pair, 1] != FIELD:
            meets[pair] = _common_joint(parents, joints[pairs[pair, 0]], joints[pairs[pair, 1]])
    return meets
