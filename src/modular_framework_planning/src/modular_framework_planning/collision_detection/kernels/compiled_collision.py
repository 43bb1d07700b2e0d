# SPDX-License-Identifier: BSD-3-Clause
"""Body poses of a robot and its environment, and distances of body pairs, compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_arrays import borrowed
from modular_framework_planning.collision_detection.kernels.compiled_distance import (
    CLEAR,
    ROUNDING,
    SURFACE,
    Memory,
    relative_pose,
    solid_distance,
    solid_of,
    surface_to_solid,
    surface_to_surface,
)
from modular_framework_planning.collision_detection.kernels.compiled_triangles import Surfaces, encloses
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import Tree, joint_placements

TABLE_CELLS = 128  # table cells along each joint, over one revolution
# Indices into World.counts: requested checks, checks found free or touching, evaluated states, and checks that Coal
# found touching
CHECK_COUNTS = 5
REQUESTED, FOUND_FREE, FOUND_TOUCHING, EVALUATED_STATES, EXACTLY_TOUCHING = range(CHECK_COUNTS)
UNKNOWN, APART, NEAR = range(3)  # verdicts of table cells


class World(NamedTuple):
    """Bodies of a robot and its environment, and the pairs to check.

    Attributes:
        tree: Joints of the robot.
        joints: Joint that moves each body, -1 for the world; shape (b,).
        poses: Pose of each body in its joint's frame, shape (b, 3, 4).
        roots: Root node of each body's surface, -1 for none; shape (b,).
        is_environment: Whether the body's surface belongs to `scene` instead of `robot`, shape (b,).
        kinds: Closed form of each body, SURFACE for none; shape (b,).
        sizes: Three parameters of each closed form, shape (b, 3).
        spheres: Bounding sphere of each body, centre (in the body's frame) and radius; shape (b, 4).
        closed: Whether each body's surface is closed, shape (b,).
        robot: Surfaces of the links.
        scene: Surfaces of the world, of held objects and of links in closed form.
        pairs: Two bodies of each pair, the first with a surface; shape (p, 2).
        margins: Minimum distance of each pair, shape (p,) [m].
        excess: Maximum distance by which the bounding geometries of each pair lie outside the bodies, inf if unknown;
            shape (p,) [m].
        tables: Verdicts UNKNOWN, APART (in the whole cell) or NEAR for pairs of links separated by one or two revolute
            joints; filled on first use, shape (t, TABLE_CELLS, TABLE_CELLS).
        table_joints: Joints of each table, the joint nearer to the base first, -1 for none; shape (t, 2).
        table_of: Table of each pair, -1 for none; shape (p,).
        counts: Counters, see CHECK_COUNTS; a check that an exact check repeats is counted once.
        refusals: Number of checks in which each pair touched, shape (p,).
        common_joints: Last joint that moves both bodies of each pair, -1 for none; shape (p,).
    """

    tree: Tree
    joints: NDArray[np.int64]
    poses: Array
    roots: NDArray[np.int64]
    is_environment: NDArray[np.bool_]
    kinds: NDArray[np.int64]
    sizes: Array
    spheres: Array
    closed: NDArray[np.bool_]
    robot: Surfaces
    scene: Surfaces
    pairs: NDArray[np.int64]
    margins: Array
    excess: Array
    tables: NDArray[np.int8]
    table_joints: NDArray[np.int64]
    table_of: NDArray[np.int64]
    counts: NDArray[np.int64]
    refusals: NDArray[np.int64]
    common_joints: NDArray[np.int64]


@njit(cache=True, nogil=True)
def place_bodies(world: World, placements: Array, out: Array, centres: Array, with_world: bool = True) -> None:
    """Writes body poses and sphere centres in the planning frame.

    Args:
        world: Bodies to place.
        placements: Pose of each joint, shape (joints, 3, 4).
        out: Written pose of each body, shape (b, 3, 4).
        centres: Written centre of each body's bounding sphere, shape (b, 3) [m].
        with_world: Whether the bodies of the world are also placed.
    """
    local, spheres = world.poses, world.spheres
    for body in range(len(world.joints)):
        joint = world.joints[body]
        if joint < 0 and not with_world:
            continue
        for row in range(3):
            if joint < 0:
                for column in range(4):
                    out[body, row, column] = local[body, row, column]
            else:
                a, b, c = placements[joint, row, 0], placements[joint, row, 1], placements[joint, row, 2]
                for column in range(4):
                    out[body, row, column] = (
                        a * local[body, 0, column] + b * local[body, 1, column] + c * local[body, 2, column]
                    )
                out[body, row, 3] += placements[joint, row, 3]
            centres[body, row] = (
                out[body, row, 0] * spheres[body, 0]
                + out[body, row, 1] * spheres[body, 1]
                + out[body, row, 2] * spheres[body, 2]
                + out[body, row, 3]
            )


@njit(cache=True, nogil=True)
def centre_distance(centres: Array, first: int, second: int) -> float:
    """Returns the distance between the centres of two bodies [m].

    Args:
        centres: Centre of each body's bounding sphere, shape (b, 3) [m].
        first: Index of the first body.
        second: Index of the second body.
    """
    x, y = centres[first, 0] - centres[second, 0], centres[first, 1] - centres[second, 1]
    z = centres[first, 2] - centres[second, 2]
    return np.sqrt(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def pair_bound(
    world: World, pair: int, poses: Array, centres: Array, limit: float, memory: Memory
) -> tuple[int, float]:
    """Returns a lower bound of a pair's distance minus its margin.

    Args:
        world: Bodies and pairs.
        pair: Index of the pair.
        poses: Pose of each body, shape (b, 3, 4).
        centres: Centre of each bounding sphere, shape (b, 3) [m].
        limit: Maximum of the bound [m].
        memory: Working memory.

    Returns:
        The status and a lower bound [m].
    """
    first, second = world.pairs[pair, 0], world.pairs[pair, 1]
    margin, excess = world.margins[pair], world.excess[pair]
    if centre_distance(centres, first, second) - world.spheres[first, 3] - world.spheres[second, 3] - margin >= limit:
        return CLEAR, limit
    relative = memory.relative
    relative_pose(poses[first], poses[second], relative)
    surface, root = world.scene if world.is_environment[first] else world.robot, world.roots[first]
    if world.kinds[second] != SURFACE:
        solid = solid_of(world.kinds, world.sizes, second)
        return surface_to_solid(surface, root, relative, solid, margin, excess, limit, memory)
    other = world.scene if world.is_environment[second] else world.robot
    return surface_to_surface(surface, root, other, world.roots[second], relative, margin, excess, limit, memory)


@njit(cache=True, nogil=True)
def _contains(world: World, outer: int, inner: int, poses: Array) -> bool:
    """Returns whether a point of the inner body lies inside the outer body; valid if their surfaces do not touch."""
    if not np.isfinite(world.spheres[inner, 3]) or (world.kinds[outer] == SURFACE and not world.closed[outer]):
        return False
    point = np.zeros(3)  # centre of a closed form, because a surface may be larger than the body
    if world.kinds[inner] == SURFACE:
        surface = world.scene if world.is_environment[inner] else world.robot
        node = world.roots[inner]
        while surface.children[node, 0] >= 0:
            node = surface.children[node, 0]
        point = surface.triangles[surface.children[node, 1]][:3]
    inner_pose, outer_pose = poses[inner], poses[outer]
    local = np.empty(3)
    for row in range(3):
        local[row] = 0.0
        for axis in range(3):
            pose = inner_pose[axis]
            value = pose[0] * point[0] + pose[1] * point[1] + pose[2] * point[2] + pose[3] - outer_pose[axis, 3]
            local[row] += outer_pose[axis, row] * value
    if world.kinds[outer] != SURFACE:
        solid = solid_of(world.kinds, world.sizes, outer)
        return solid_distance(solid, local[0], local[1], local[2]) < -ROUNDING
    sphere = world.spheres[outer]
    if (local[0] - sphere[0]) ** 2 + (local[1] - sphere[1]) ** 2 + (local[2] - sphere[2]) ** 2 > sphere[3] * sphere[3]:
        return False
    surface = world.scene if world.is_environment[outer] else world.robot
    return encloses(surface, world.roots[outer], local[0], local[1], local[2])


@njit(cache=True, nogil=True)
def surrounded_pair(world: World, poses: Array, centres: Array) -> int:
    """Returns the first pair with one body inside the other, or -1; valid if no pair touches.

    Args:
        world: Bodies and pairs.
        poses: Pose of each body, shape (b, 3, 4).
        centres: Centre of each bounding sphere, shape (b, 3) [m].
    """
    pairs, excess, spheres = world.pairs, world.excess, world.spheres
    for pair in range(len(pairs)):
        first, second = pairs[pair, 0], pairs[pair, 1]
        if (
            np.isfinite(excess[pair])
            and centre_distance(centres, first, second) < spheres[first, 3] + spheres[second, 3]
            and (_contains(world, first, second, poses) or _contains(world, second, first, poses))
        ):
            return pair
    return -1


def arguments(world: World) -> tuple[NDArray[Any], ...]:
    """Returns the arrays of a world as separate arguments, which numba dispatches in 4 us instead of 70 us."""
    return (*world.tree, *world[1:9], *world.robot, *world.scene, *world[11:])


@njit(cache=True, nogil=True)
def world_of(arrays: tuple[NDArray[Any], ...]) -> World:
    """Rebuilds a World of borrowed arrays from the result of `arguments`."""
    a = borrowed(arrays)
    # numba supports only one starred argument per call
    tree, robot, scene = Tree(a[0], a[1], a[2], a[3]), Surfaces(*a[12:16]), Surfaces(*a[16:20])
    bodies = (tree, a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], robot, scene)
    pairs = (a[20], a[21], a[22], a[23], a[24], a[25], a[26], a[27], a[28])
    return World(*bodies, *pairs)


@njit(cache=True, nogil=True)
def surrounded_pair_at(positions: Array, *world: NDArray[Any]) -> int:
    """Returns the `surrounded_pair` at joint positions of the whole robot, shape (joints,) [rad or m]."""
    return _surrounded_at(world_of(world), positions)


@njit(cache=True, nogil=True)
def _surrounded_at(world: World, positions: Array) -> int:
    placements = np.empty((len(positions), 3, 4))
    poses, centres = np.empty((len(world.joints), 3, 4)), np.empty((len(world.joints), 3))
    joint_placements(world.tree, positions, placements)
    place_bodies(world, placements, poses, centres)
    return surrounded_pair(world, poses, centres)
