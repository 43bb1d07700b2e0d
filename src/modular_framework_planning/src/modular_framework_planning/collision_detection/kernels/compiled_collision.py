# SPDX-License-Identifier: BSD-3-Clause
"""The bodies of a robot and its environment in arrays for compiled loops: their poses and distances."""

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
    Solid,
    solid_distance,
    surface_to_solid,
    surface_to_surface,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance_field import (
    DistanceField,
    surface_to_field,
)
from modular_framework_planning.collision_detection.kernels.compiled_triangles import Surfaces, encloses
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import Tree, joint_placements

CELLS = 128  # of a table along each joint, over a whole turn
# checks asked for, found free, found touching; states looked at; checks that Coal found touching
CHECK_COUNTS = 5
ASKED, FOUND_FREE, FOUND_TOUCHING, LOOKED_AT, TOUCHING_EXACTLY = range(CHECK_COUNTS)
FIELD = -1  # in place of a pair's second body: all solids of the field
UNKNOWN, APART, NEAR = range(3)


class World(NamedTuple):
    """Bodies on the joints of a robot and around it, and the pairs of them to watch.

    Attributes:
        tree: joints of the robot.
        joints: joint that moves each body, -1 for the world; shape (b,).
        poses: of each body in its joint's frame; shape (b, 3, 4).
        roots: node of each body's surface; is_environment: whether that is in `scene` and not in `robot`.
        kinds, sizes: closed form of each body (SURFACE for none) and its three numbers.
        spheres: centre (in the body's frame) and radius around each body; shape (b, 4).
        closed: whether each body's surface has an inside.
        robot, scene: the surfaces of links, and those of the world and of held objects.
        pairs: two bodies each, the first one has a surface, shape (p, 2); margins: distance they must keep [m].
            Pairs with FIELD come last; they stand for other pairs.
        excess: how far the bounding geometries of a pair's bodies may lie outside of these [m], infinite where that is
            not known; shape (p,).
        tables: what is known about cells of pairs of links that two joints move against each other: UNKNOWN, APART
            (all through the cell) or NEAR; filled while checking, shape (t, CELLS, CELLS).
        table_joints: the two joints of each table, the one nearer to the base first, -1 for none; shape (t, 2).
        table_of: table of each pair, -1 for none; shape (p,).
        watched: the pairs to check, those left out for which one with FIELD stands.
        represented: the pairs for which each pair with FIELD stands, in the order of the field's solids; shape (f, n).
        counts: of checks, see CHECK_COUNTS; those of undecided checks that are asked again elsewhere are left out.
        refusals: in how many checks each pair touched, 0 for pairs with FIELD: those they stand for count; shape (p,).
        meets: last joint that moves both bodies of each pair, -1 for none; shape (p,).
        field: the solids of the world that all bodies with such a pair are checked against.
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
    watched: NDArray[np.int64]
    represented: NDArray[np.int64]
    counts: NDArray[np.int64]
    refusals: NDArray[np.int64]
    meets: NDArray[np.int64]
    field: DistanceField


@njit(cache=True, nogil=True)
def place_bodies(world, placements, out, centres, still=True):  # type: ignore[no-untyped-def]
    """Writes the pose (b, 3, 4) of every body and the centre (b, 3) of its sphere in the planning frame.

    Bodies of the world are left out without `still`.
    """
    at, spheres = world.poses, world.spheres
    for body in range(len(world.joints)):
        joint = world.joints[body]
        if joint < 0 and not still:
            continue
        for row in range(3):
            if joint < 0:
                for column in range(4):
                    out[body, row, column] = at[body, row, column]
            else:
                a, b, c = placements[joint, row, 0], placements[joint, row, 1], placements[joint, row, 2]
                for column in range(4):
                    out[body, row, column] = a * at[body, 0, column] + b * at[body, 1, column] + c * at[body, 2, column]
                out[body, row, 3] += placements[joint, row, 3]
            centres[body, row] = (
                out[body, row, 0] * spheres[body, 0]
                + out[body, row, 1] * spheres[body, 1]
                + out[body, row, 2] * spheres[body, 2]
                + out[body, row, 3]
            )


@njit(cache=True, nogil=True)
def relative_pose(one, two, relative):  # type: ignore[no-untyped-def]
    """Writes the first pose in the frame of the second; all of shape (3, 4)."""
    for row in range(3):
        for column in range(4):
            value = 0.0
            for inner in range(3):
                part = one[inner, column] - (two[inner, 3] if column == 3 else 0.0)
                value += two[inner, row] * part
            relative[row, column] = value


@njit(cache=True, nogil=True)
def solid_of(kinds, sizes, body):  # type: ignore[no-untyped-def]
    """Returns the closed form of a body, see World."""
    return Solid(kinds[body], sizes[body, 0], sizes[body, 1], sizes[body, 2])


@njit(cache=True, nogil=True)
def centre_gap(centres, first, second):  # type: ignore[no-untyped-def]
    """Returns the distance of the centres (b, 3) of two bodies' spheres."""
    x, y, z = (
        centres[first, 0] - centres[second, 0],
        centres[first, 1] - centres[second, 1],
        centres[first, 2] - centres[second, 2],
    )
    return np.sqrt(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def pair_bound(world, pair, poses, centres, limit, memory):  # type: ignore[no-untyped-def]
    """Returns (status, lower bound of the pair's distance less its margin, at most `limit`).

    Where a pair with FIELD touches, the number of a solid that is touched instead of the bound.
    """
    first, second = world.pairs[pair, 0], world.pairs[pair, 1]
    margin, excess = world.margins[pair], world.excess[pair]
    if second == FIELD:
        surface = world.scene if world.is_environment[first] else world.robot
        return surface_to_field(surface, world.roots[first], poses[first], world.field, margin, excess, limit, memory)
    if centre_gap(centres, first, second) - world.spheres[first, 3] - world.spheres[second, 3] - margin >= limit:
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
def _contains(world, outer, inner, poses):  # type: ignore[no-untyped-def]
    """Whether a body without touching it surrounds a point of another body."""
    if not np.isfinite(world.spheres[inner, 3]) or (world.kinds[outer] == SURFACE and not world.closed[outer]):
        return False
    corner = np.zeros(3)  # of a body in closed form: its centre, since its surface may be larger than the body
    if world.kinds[inner] == SURFACE:
        surface = world.scene if world.is_environment[inner] else world.robot
        node = world.roots[inner]
        while surface.links[node, 0] >= 0:
            node = surface.links[node, 0]
        corner = surface.triangles[surface.links[node, 1]][:3]
    one, two = poses[inner], poses[outer]
    local = np.empty(3)
    for row in range(3):
        local[row] = 0.0
        for axis in range(3):
            value = (
                one[axis, 0] * corner[0]
                + one[axis, 1] * corner[1]
                + one[axis, 2] * corner[2]
                + one[axis, 3]
                - two[axis, 3]
            )
            local[row] += two[axis, row] * value
    if world.kinds[outer] != SURFACE:
        solid = solid_of(world.kinds, world.sizes, outer)
        return solid_distance(solid, local[0], local[1], local[2]) < -ROUNDING
    sphere = world.spheres[outer]
    if (local[0] - sphere[0]) ** 2 + (local[1] - sphere[1]) ** 2 + (local[2] - sphere[2]) ** 2 > sphere[3] * sphere[3]:
        return False
    surface = world.scene if world.is_environment[outer] else world.robot
    return encloses(surface, world.roots[outer], local[0], local[1], local[2])


@njit(cache=True, nogil=True)
def surrounded_pair(world, poses, centres):  # type: ignore[no-untyped-def]
    """Returns the first pair of which one body lies wholly inside the other, or -1; they must not touch."""
    pairs, excess, spheres = world.pairs, world.excess, world.spheres
    for pair in range(len(pairs)):
        first, second = pairs[pair, 0], pairs[pair, 1]
        if (
            second != FIELD
            and np.isfinite(excess[pair])
            and centre_gap(centres, first, second) < spheres[first, 3] + spheres[second, 3]
            and (_contains(world, first, second, poses) or _contains(world, second, first, poses))
        ):
            return pair
    return -1


def arguments(world: World) -> tuple[NDArray[Any], ...]:
    """Returns the arrays of a world one by one: numba takes 70 microseconds to recognise a tuple, 4 for these."""
    return (*world.tree, *world[1:9], *world.robot, *world.scene, *world[11:-1], *world.field)


@njit(cache=True, nogil=True)
def world_of(arrays):  # type: ignore[no-untyped-def]
    """Puts the arrays that `arguments` gives together again, without owners.

    Numba calls no class with more than one starred tuple.
    """
    a = borrowed(arrays)
    tree, robot, scene = Tree(a[0], a[1], a[2], a[3]), Surfaces(*a[12:16]), Surfaces(*a[16:20])
    bodies = (tree, a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], robot, scene)
    pairs = (a[20], a[21], a[22], a[23], a[24], a[25], a[26], a[27], a[28], a[29], a[30])
    return World(*bodies, *pairs, DistanceField(*a[31:]))


@njit(cache=True, nogil=True)
def surrounded_pair_at(positions, *world):  # type: ignore[no-untyped-def]
    """Returns the first pair of which one body lies wholly inside the other at these positions, or -1."""
    return _surrounded_at(world_of(world), positions)


@njit(cache=True, nogil=True)
def _surrounded_at(world, positions):  # type: ignore[no-untyped-def]
    placements = np.empty((len(positions), 3, 4))
    poses, centres = np.empty((len(world.joints), 3, 4)), np.empty((len(world.joints), 3))
    joint_placements(world.tree, positions, placements)
    place_bodies(world, placements, poses, centres)
    return surrounded_pair(world, poses, centres)
