# SPDX-License-Identifier: BSD-3-Clause
"""Penetration depths of a robot in its environment, compiled: a smooth cost for optimisers, not a collision check.

Each body is approximated by bounding spheres from its sphere tree. If the distance bounds cannot exclude contact of a
pair, the depth of its deepest sphere is the pair's penetration.
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

TOUCH_COST_M = 0.03  # added to the depth of every contact, so that touching without depth has a cost
MAX_SPHERE_RADIUS_M = 0.07
CONTACT_DISTANCE_M = 1.0e-5  # closer bodies are in contact


class BoundingSpheres(NamedTuple):
    """Bounding spheres of all bodies; a body with only a closed form has no spheres.

    Attributes:
        spheres: Centre (in the body's frame) and radius, shape (m, 4) [m].
        starts: Index of each body's first sphere, and the total; shape (b + 1,).
    """

    spheres: Array
    starts: NDArray[np.int64]


def bounding_spheres_of(world: World) -> BoundingSpheres:
    """Returns for every body the largest spheres of its tree with radii up to MAX_SPHERE_RADIUS_M."""
    rows: list[Array] = []
    starts = [0]
    for body, root in enumerate(world.roots.tolist()):
        surface = world.scene if world.is_environment[body] else world.robot
        open_nodes = [root] if root >= 0 else []
        while open_nodes:
            node = open_nodes.pop()
            left, right = surface.children[node].tolist()
            if left < 0 or surface.spheres[node, 3] <= MAX_SPHERE_RADIUS_M:
                rows.append(surface.spheres[node])
            else:
                open_nodes += [left, right]
        starts.append(len(rows))
    return BoundingSpheres(np.array(rows).reshape(-1, 4), np.array(starts, dtype=np.int64))


@njit(cache=True, nogil=True)
def _place(pose: Array, local: Array, out: Array) -> None:
    for row in range(3):
        out[row] = pose[row, 0] * local[0] + pose[row, 1] * local[1] + pose[row, 2] * local[2] + pose[row, 3]


@njit(cache=True, nogil=True)
def _pair_depth(
    world: World,
    bounding: BoundingSpheres,
    placed: Array,
    poses: Array,
    centre: Array,
    first: int,
    second: int,
    margin: float,
) -> float:
    """Returns the depth of the first body's deepest sphere in the second body inflated by `margin` [m]."""
    deepest = 0.0
    second_radius = world.spheres[second, 3]
    solid = solid_of(world.kinds, world.sizes, second)
    for i in range(bounding.starts[first], bounding.starts[first + 1]):
        x, y, z, radius = placed[i, 0], placed[i, 1], placed[i, 2], bounding.spheres[i, 3]
        max_distance = margin + radius + second_radius - deepest
        if (x - centre[0]) ** 2 + (y - centre[1]) ** 2 + (z - centre[2]) ** 2 >= max_distance * max_distance:
            continue
        if world.kinds[second] != SURFACE:
            distance = placed_solid_distance(solid, poses, second, x, y, z)
            deepest = max(deepest, margin + radius - distance)
            continue
        for j in range(bounding.starts[second], bounding.starts[second + 1]):
            dx, dy, dz = x - placed[j, 0], y - placed[j, 1], z - placed[j, 2]
            max_distance = margin + radius + bounding.spheres[j, 3] - deepest
            square = dx * dx + dy * dy + dz * dz
            if max_distance > 0.0 and square < max_distance * max_distance:
                deepest += max_distance - np.sqrt(square)
    return deepest


@njit(cache=True, nogil=True)
def penetrations(world: World, bounding: BoundingSpheres, states: Array) -> Array:
    """Returns the penetration cost of states, summed over the touching pairs; shape (n,) [m].

    Args:
        world: Bodies and pairs.
        bounding: Bounding spheres of the bodies.
        states: Joint positions of the whole robot, shape (n, joints) [rad or m].
    """
    bodies = len(world.joints)
    result = np.zeros(len(states))
    placements, poses = np.empty((states.shape[1], 3, 4)), np.empty((bodies, 3, 4))
    placed, centres, memory = np.empty((len(bounding.spheres), 3)), np.empty((bodies, 3)), new_memory()
    for state in range(len(states)):
        joint_placements(world.tree, states[state], placements)
        place_bodies(world, placements, poses, centres)
        has_spheres = False
        for pair in range(len(world.pairs)):
            if world.pairs[pair, 1] == FIELD:
                break  # the distance field contains only pairs that are already checked
            status, _ = pair_bound(world, pair, poses, centres, CONTACT_DISTANCE_M, memory)
            if status == CLEAR:
                continue
            if not has_spheres:
                has_spheres = True
                for body in range(bodies):
                    for i in range(bounding.starts[body], bounding.starts[body + 1]):
                        _place(poses[body], bounding.spheres[i], placed[i])
            first, second = world.pairs[pair, 0], world.pairs[pair, 1]
            result[state] += TOUCH_COST_M + _pair_depth(
                world, bounding, placed, poses, centres[second], first, second, world.margins[pair]
            )
    return result
