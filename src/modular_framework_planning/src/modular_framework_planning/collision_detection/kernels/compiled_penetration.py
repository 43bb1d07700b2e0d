# SPDX-License-Identifier: BSD-3-Clause
"""How deep a robot is in its surroundings, compiled: a smooth guide for optimisers, not a verdict on collisions.

Each body is covered by spheres taken from its sphere tree. Where the bounds of the collision check say that a pair of
bodies may touch, its penetration is that of the deepest sphere.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    FIELD,
    World,
    pair_bound,
    place_bodies,
    solid_of,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import (
    CLEAR,
    SURFACE,
    new_memory,
    placed_solid_distance,
)
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements

TOUCH_COST_M = 0.03  # added to the depth of a contact where contacts are costs: they begin with a step
WIDEST_SPHERE = 0.07  # [m]; of those that cover the bodies
NEAR = 1.0e-5  # [m]; bodies less apart count as touching


class Cover(NamedTuple):
    """Spheres of all bodies (centre in the body's frame, radius), shape (m, 4), and each body's first, shape (b + 1,).

    Bodies that have only a closed form have no spheres.
    """

    spheres: Array
    starts: NDArray[np.int64]


def cover_of(world: World) -> Cover:
    """Covers every body by the largest spheres of its tree that are at most WIDEST_SPHERE in radius."""
    rows: list[Array] = []
    starts = [0]
    for body, root in enumerate(world.roots.tolist()):
        surface = world.scene if world.is_environment[body] else world.robot
        open_nodes = [root] if root >= 0 else []
        while open_nodes:
            node = open_nodes.pop()
            left, right = surface.links[node].tolist()
            if left < 0 or surface.spheres[node, 3] <= WIDEST_SPHERE:
                rows.append(surface.spheres[node])
            else:
                open_nodes += [left, right]
        starts.append(len(rows))
    return Cover(np.array(rows).reshape(-1, 4), np.array(starts, dtype=np.int64))


@njit(cache=True, nogil=True)
def _place(pose, local, out):  # type: ignore[no-untyped-def]
    for row in range(3):
        out[row] = pose[row, 0] * local[0] + pose[row, 1] * local[1] + pose[row, 2] * local[2] + pose[row, 3]


@njit(cache=True, nogil=True)
def _pair_depth(world, cover, placed, poses, middle, first, second, reach):  # type: ignore[no-untyped-def]
    """Depth [m] of the deepest sphere of one body in the other body, `reach` away from it counting as 0."""
    deepest = 0.0
    around = world.spheres[second, 3]
    solid = solid_of(world.kinds, world.sizes, second)
    for i in range(cover.starts[first], cover.starts[first + 1]):
        x, y, z, radius = placed[i, 0], placed[i, 1], placed[i, 2], cover.spheres[i, 3]
        wide = reach + radius + around - deepest
        if (x - middle[0]) ** 2 + (y - middle[1]) ** 2 + (z - middle[2]) ** 2 >= wide * wide:
            continue
        if world.kinds[second] != SURFACE:
            distance = placed_solid_distance(solid, poses, second, x, y, z)
            deepest = max(deepest, reach + radius - distance)
            continue
        for j in range(cover.starts[second], cover.starts[second + 1]):
            dx, dy, dz = x - placed[j, 0], y - placed[j, 1], z - placed[j, 2]
            wide = reach + radius + cover.spheres[j, 3] - deepest
            square = dx * dx + dy * dy + dz * dz
            if wide > 0.0 and square < wide * wide:
                deepest += wide - np.sqrt(square)
    return deepest


@njit(cache=True, nogil=True)
def penetrations(world, cover, states):  # type: ignore[no-untyped-def]
    """Returns how deep some states are in collision, summed over the pairs [m]; 0 where no pair touches.

    Args:
        world: the bodies.
        cover: spheres of the bodies, see cover_of.
        states: positions of the whole robot, shape (n, joints).
    """
    bodies = len(world.joints)
    result = np.zeros(len(states))
    placements, poses = np.empty((states.shape[1], 3, 4)), np.empty((bodies, 3, 4))
    placed, middles, memory = np.empty((len(cover.spheres), 3)), np.empty((bodies, 3)), new_memory()
    for number in range(len(states)):
        joint_placements(world.tree, states[number], placements)
        place_bodies(world, placements, poses, middles)
        has_spheres = False
        for pair in range(len(world.pairs)):
            if world.pairs[pair, 1] == FIELD:
                break  # what follows stands for pairs that were looked at
            status, _ = pair_bound(world, pair, poses, middles, NEAR, memory)
            if status == CLEAR:
                continue
            if not has_spheres:
                has_spheres = True
                for body in range(bodies):
                    for i in range(cover.starts[body], cover.starts[body + 1]):
                        _place(poses[body], cover.spheres[i], placed[i])
            first, second = world.pairs[pair, 0], world.pairs[pair, 1]
            result[number] += TOUCH_COST_M + _pair_depth(
                world, cover, placed, poses, middles[second], first, second, world.margins[pair]
            )
    return result
