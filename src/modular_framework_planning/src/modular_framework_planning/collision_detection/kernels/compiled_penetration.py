# SPDX-License-Identifier: BSD-3-Clause
"""Penetration depths of body pairs, compiled: a smooth cost for optimisers, not a collision check.

Each body is approximated by bounding spheres from its sphere tree. The penetration of a pair is the depth of the
deepest sphere if the distance bounds cannot exclude contact, otherwise 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    World,
    pair_bound,
    place_bodies,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import (
    CLEAR,
    SURFACE,
    new_memory,
    placed_solid_distance,
    solid_of,
)
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements

TOUCH_COST_M = 0.03  # added to the depth of every contact, so that contact without depth has a cost
MAX_SPHERE_RADIUS_M = 0.07  # larger spheres are replaced by their children
CONTACT_DISTANCE_M = 1.0e-5  # closer bodies are in contact


class BoundingSpheres(NamedTuple):
    """Bounding spheres of all bodies; a body with only a closed form has no spheres.

    Attributes:
        spheres: Centre (in the body's frame) and radius of each sphere, shape (m, 4) [m].
        starts: Index of each body's first sphere, and the number of spheres; shape (b + 1,).
    """

    spheres: Array
    starts: NDArray[np.int64]


def bounding_spheres_of(world: World) -> BoundingSpheres:
    """Returns the largest spheres of each body's tree with radii up to MAX_SPHERE_RADIUS_M."""
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
def _write_point(pose: Array, local: Array, out: Array) -> None:
    """Writes a point of a body's frame, shape (3,), in the planning frame."""
    for row in range(3):
        out[row] = pose[row, 0] * local[0] + pose[row, 1] * local[1] + pose[row, 2] * local[2] + pose[row, 3]


@njit(cache=True, nogil=True)
def _pair_depth(
    world: World,
    bounding: BoundingSpheres,
    sphere_centres: Array,
    poses: Array,
    centre: Array,
    first: int,
    second: int,
    margin: float,
) -> float:
    """Returns the depth [m] of the first body's deepest sphere in the second body, around `centre`, plus `margin`."""
    deepest = 0.0
    second_radius = world.spheres[second, 3]
    solid = solid_of(world.kinds, world.sizes, second)
    for index in range(bounding.starts[first], bounding.starts[first + 1]):
        x, y, z = sphere_centres[index, 0], sphere_centres[index, 1], sphere_centres[index, 2]
        radius = bounding.spheres[index, 3]
        max_distance = margin + radius + second_radius - deepest
        if (x - centre[0]) ** 2 + (y - centre[1]) ** 2 + (z - centre[2]) ** 2 >= max_distance * max_distance:
            continue
        if world.kinds[second] != SURFACE:
            distance = placed_solid_distance(solid, poses, second, x, y, z)
            deepest = max(deepest, margin + radius - distance)
            continue
        for other in range(bounding.starts[second], bounding.starts[second + 1]):
            dx, dy, dz = x - sphere_centres[other, 0], y - sphere_centres[other, 1], z - sphere_centres[other, 2]
            max_distance = margin + radius + bounding.spheres[other, 3] - deepest
            squared_distance = dx * dx + dy * dy + dz * dz
            if max_distance > 0.0 and squared_distance < max_distance * max_distance:
                deepest += max_distance - np.sqrt(squared_distance)
    return deepest


@njit(cache=True, nogil=True)
def penetrations(world: World, bounding: BoundingSpheres, states: Array) -> Array:
    """Returns the penetration cost of each state, shape (n,) [m]: the sum of depth + TOUCH_COST_M over touching pairs.

    Args:
        world: Bodies and pairs.
        bounding: Bounding spheres of the bodies.
        states: Joint positions of the whole robot, shape (n, joints) [rad or m].
    """
    bodies = len(world.joints)
    result = np.zeros(len(states))
    placements, poses = np.empty((states.shape[1], 3, 4)), np.empty((bodies, 3, 4))
    sphere_centres, centres, memory = np.empty((len(bounding.spheres), 3)), np.empty((bodies, 3)), new_memory()
    for state in range(len(states)):
        joint_placements(world.tree, states[state], placements)
        place_bodies(world, placements, poses, centres)
        spheres_are_placed = False
        for pair in range(len(world.pairs)):
            status, _ = pair_bound(world, pair, poses, centres, CONTACT_DISTANCE_M, memory)
            if status == CLEAR:
                continue
            if not spheres_are_placed:
                spheres_are_placed = True
                for body in range(bodies):
                    for index in range(bounding.starts[body], bounding.starts[body + 1]):
                        _write_point(poses[body], bounding.spheres[index], sphere_centres[index])
            first, second = world.pairs[pair, 0], world.pairs[pair, 1]
            result[state] += TOUCH_COST_M + _pair_depth(
                world, bounding, sphere_centres, poses, centres[second], first, second, world.margins[pair]
            )
    return result
