# SPDX-License-Identifier: BSD-3-Clause
"""Upper bounds of the reach of each joint: summed link lengths, as if the arm could be stretched straight."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.collision_detection.body_arrays import BodyArrays
from modular_framework_planning.collision_detection.kernels.compiled_collision import World
from modular_framework_planning.collision_detection.kernels.compiled_reaches import body_reaches, joint_lengths
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import Tree


def reaches(world: World) -> Array:
    """Returns the maximum motion of a body point per joint motion, shape (joints,) [m/rad]; 1 for prismatic joints."""
    return np.where(world.tree.prismatic, 1.0, _body_reaches(world.tree, world))


def max_reach(tree: Tree, bodies: BodyArrays | World) -> float:
    """Returns the maximum distance of a moving body from the planning frame's origin [m]; 0 without moving bodies."""
    lengths = joint_lengths(tree.placements) + _body_reaches(tree, bodies)
    return float(lengths[tree.parents < 0].max(initial=0.0))


def _body_reaches(tree: Tree, bodies: BodyArrays | World) -> Array:
    result = body_reaches(tree.parents, tree.placements, bodies.joints, bodies.poses, bodies.spheres)
    return np.asarray(result)
