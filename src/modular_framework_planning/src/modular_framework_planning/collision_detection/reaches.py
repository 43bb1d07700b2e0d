# SPDX-License-Identifier: BSD-3-Clause
"""How far the joints of a robot can move what they carry: along the joints, as if the arm could be stretched out."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_collision import World
from modular_framework_planning.geometry.spatial import Array


def reaches(world: World) -> Array:
    """Returns how far each joint can move a point that it carries, shape (joints,) [m/rad], 1 for a sliding joint."""
    return np.where(world.tree.prismatic, 1.0, _ways_to_ends(world))


def farthest_end(world: World) -> float:
    """Returns how far from the origin of the planning frame a moving body can be [m]; 0 where none moves."""
    ways, lengths, roots = _ways_to_ends(world), _lengths(world), world.tree.parents < 0
    return float((lengths + ways)[roots].max(initial=0.0))


def _lengths(world: World) -> Array:
    return np.asarray(np.linalg.norm(world.tree.placements[:, :, 3], axis=1))


def _ways_to_ends(world: World) -> Array:
    """Returns the way from each joint to the far end of the bodies it carries, shape (joints,) [m].

    Sliding joints stand at zero. Bodies without an end, as a plane, do not count.
    """
    tree, result = world.tree, np.zeros(len(world.tree.parents))
    carried = (world.joints >= 0) & np.isfinite(world.spheres).all(axis=1)
    poses, spheres = world.poses[carried], world.spheres[carried]
    centres = np.einsum("bij,bj->bi", poses[:, :, :3], spheres[:, :3]) + poses[:, :, 3]
    np.maximum.at(result, world.joints[carried], np.linalg.norm(centres, axis=1) + spheres[:, 3])
    lengths = _lengths(world)
    for joint in reversed(range(len(result))):
        if tree.parents[joint] >= 0:
            result[tree.parents[joint]] = max(result[tree.parents[joint]], lengths[joint] + result[joint])
    return result
