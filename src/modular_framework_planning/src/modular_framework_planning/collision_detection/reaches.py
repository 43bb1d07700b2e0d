# SPDX-License-Identifier: BSD-3-Clause
"""Upper bounds of the reach of each joint: summed link lengths, as if the arm could be stretched straight."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_collision import World
from modular_framework_planning.geometry.spatial import Array


def reaches(world: World) -> Array:
    """Returns the maximum motion of a body point per joint motion, shape (joints,) [m/rad]; 1 for prismatic joints.

    The bound of a revolute joint is the maximum of |c| + r over its bodies, with bounding sphere c and r, and of
    length + bound over its child joints. It holds if the prismatic joints are at zero. Unbounded bodies, such as
    planes, are left out.
    """
    tree, spheres = world.tree, world.spheres
    centres = np.einsum("bij,bj->bi", world.poses[:, :, :3], spheres[:, :3]) + world.poses[:, :, 3]
    bounds = np.linalg.norm(centres, axis=1) + spheres[:, 3]
    is_bounded = (world.joints >= 0) & np.isfinite(bounds)
    result, lengths = np.zeros(len(tree.parents)), np.linalg.norm(tree.placements[:, :, 3], axis=1)
    np.maximum.at(result, world.joints[is_bounded], bounds[is_bounded])
    for joint in range(len(result) - 1, -1, -1):  # children have larger indices than their parents
        parent = tree.parents[joint]
        if parent >= 0:
            result[parent] = max(result[parent], lengths[joint] + result[joint])
    return np.where(tree.prismatic, 1.0, result)
