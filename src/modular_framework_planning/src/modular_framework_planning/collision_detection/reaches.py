# SPDX-License-Identifier: BSD-3-Clause
"""How far the joints of a robot can move what they carry: along the joints, as if the arm could be stretched out."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.collision_detection.body_arrays import BodyArrays
from modular_framework_planning.collision_detection.kernels.compiled_collision import World
from modular_framework_planning.collision_detection.kernels.compiled_reaches import joint_lengths, ways_to_ends
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import Tree


def reaches(world: World) -> Array:
    """Returns how far each joint can move a point that it carries, shape (joints,) [m/rad], 1 for a sliding joint."""
    return np.where(world.tree.prismatic, 1.0, _ways_to_ends(world.tree, world))


def farthest_end(tree: Tree, bodies: BodyArrays | World) -> float:
    """Returns how far from the origin of the planning frame a moving body can be [m]; 0 where none moves."""
    ways = joint_lengths(tree.placements) + _ways_to_ends(tree, bodies)
    return float(ways[tree.parents < 0].max(initial=0.0))


def _ways_to_ends(tree: Tree, bodies: BodyArrays | World) -> Array:
    ends = ways_to_ends(tree.parents, tree.placements, bodies.joints, bodies.poses, bodies.spheres)
    return np.asarray(ends)
