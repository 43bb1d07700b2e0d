# SPDX-License-Identifier: BSD-3-Clause
"""Upper bounds of the reach of each joint: summed link lengths, as if the arm could be stretched straight."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_collision import World
from modular_framework_planning.collision_detection.kernels.compiled_reaches import body_reaches
from modular_framework_planning.geometry.spatial import Array


def reaches(world: World) -> Array:
    """Returns the maximum motion of a body point per joint motion, shape (joints,) [m/rad]; 1 for prismatic joints."""
    tree = world.tree
    result = body_reaches(tree.parents, tree.placements, world.joints, world.poses, world.spheres)
    return np.where(tree.prismatic, 1.0, result)
