# SPDX-License-Identifier: BSD-3-Clause
"""Checks whole paths of a robot in a world, compiled: a known clearance certifies a stretch of the path at once.

Around a state with clearance c between two bodies, every other state is free of that pair as long as the bodies move
by less than c. How far they can move is bounded by each joint's change times the body's reach from the joint's axis.
"""
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.compiled_distance import (
    CLEAR,
    ROUNDING,
    SURFACE,
    TOO_CLOSE,
    TOUCHING,
    solid_distance,
    surface_to_solid,
    surface_to_surface,
    surfaces_stay_apart,
)
from modular_framework_planning.compiled_kinematics import Tree, joint_placements
from modular_framework_planning.compiled_triangles import encloses
from modular_framework_planning.spatial import Array

MOST_UNDECIDED = 256
CELLS = 128  # of a table along each joint, over a whole turn
MOST_CELLS = 12  # looked up for one stretch of a path
UNKNOWN, APART, NEAR = range(3)


class Surfaces(NamedTuple):
    """Trees over triangles, see build_sphere_tree; roots are told by the bodies."""

    spheres: Array
    boxes: Array
    links: NDArray[np.int32]
    triangles: Array


class World(NamedTuple):
    """Bodies on the joints of a robot and around it, and the pairs of them to watch.

    Attributes:
        tree: joints of the robot.
        joints: joint each body hangs on, -1 for the world; shape (b,).
        poses: of each body in its joint's frame; shape (b, 3, 4).
        roots: node of each body's surface; scenic: whether that is in `scene` instead of `robot`.
        kinds, sizes: closed form of each body (SURFACE for none) and its three numbers.
        spheres: centre (in the body's frame) and radius around each body; shape (b, 4).
        closed: whether each body's surface has an inside.
        robot, scene: the surfaces of links, and those of the world and of held objects.
        pairs: two bodies each, the first one has a surface, shape (p, 2); margins: distance they must keep [m].
        exact: whether the pair touches where these stand-ins of its bodies do; shape (p,).
        tables: what is known about cells of pairs of links that two joints move against each other: UNKNOWN, APART
            (all through the cell) or NEAR; filled while checking, shape (t, CELLS, CELLS).
        table_joints: the two joints of each table, the one nearer to the base first, -1 for none; shape (t, 2).
        table_of: table of each pair, -1 for none; shape (p,).
    """

    tree: Tree
    joints: NDArray[np.int64]
    poses: Array
    roots: NDArray[np.int64]
    scenic: NDArray[np.bool_]
    kinds: NDArray[np.int64]
    sizes: Array
    spheres: Array
    closed: NDArray[np.bool_]
    robot: Surfaces
    scene: Surfaces
    pairs: NDArray[np.int64]
    margins: Array
    exact: NDArray[np.bool_]
    tables: NDArray[np.int8]
    table_joints: NDArray[np.int64]
    table_of: NDArray[np.int64]


@njit(cache=True, nogil=True)
def place_bodies(world, placements, out, centres):  # type: ignore[no-untyped-def]
    """Writes the pose (b, 3, 4) of every body and the centre (b, 3) of its sphere in the planning frame."""
    for body in range(len(world.joints)):
        pose, target = world.poses[body], out[body]
        joint = world.joints[body]
        for row in range(3):
            for column in range(4):
                if joint < 0:
                    target[row, column] = pose[row, column]
                    continue
                place = placements[joint]
                value = place[row, 3] if column == 3 else 0.0
                for inner in range(3):
                    value += place[row, inner] * pose[inner, column]
                target[row, column] = value
            sphere = world.spheres[body]
            centres[body, row] = (target[row, 0] * sphere[0] + target[row, 1] * sphere[1] + target[row, 2] * sphere[2]
                                  + target[row, 3])


@njit(cache=True, nogil=True)
def _relative_pose(one, two, relative):  # type: ignore[no-untyped-def]
    """Writes the first pose in the frame of the second; all of shape (3, 4)."""
    for row in range(3):
        for column in range(4):
            value = 0.0
            for inner in range(3):
                part = one[inner, column] - (two[inner, 3] if column == 3 else 0.0)
                value += two[inner, row] * part
            relative[row, column] = value


@njit(cache=True, nogil=True)
def pair_bound(world, pair, poses, centres, limit, relative):  # type: ignore[no-untyped-def]
    """Returns (status, lower bound of the pair's distance less its margin, at most `limit`)."""
    first, second = world.pairs[pair, 0], world.pairs[pair, 1]
    margin = world.margins[pair]
    gap = np.sqrt((centres[first, 0] - centres[second, 0]) ** 2 + (centres[first, 1] - centres[second, 1]) ** 2
                  + (centres[first, 2] - centres[second, 2]) ** 2)
    if gap - world.spheres[first, 3] - world.spheres[second, 3] - margin >= limit:
        return CLEAR, limit
    _relative_pose(poses[first], poses[second], relative)
    surface = world.scene if world.scenic[first] else world.robot
    if world.kinds[second] != SURFACE:
        size = world.sizes[second]
        status, bound = surface_to_solid(surface.spheres, surface.boxes, surface.links, surface.triangles,
                                         world.roots[first], relative, world.kinds[second], size[0], size[1], size[2],
                                         margin, limit)
    else:
        other = world.scene if world.scenic[second] else world.robot
        status, bound = surface_to_surface(
            surface.spheres, surface.boxes, surface.links, surface.triangles, world.roots[first],
            other.spheres, other.boxes, other.links, other.triangles, world.roots[second], relative, margin, limit)
    if status == TOUCHING and not world.exact[pair]:
        status = TOO_CLOSE
    return status, bound


@njit(cache=True, nogil=True)
def _goes_round(world, outer, inner, poses):  # type: ignore[no-untyped-def]
    """Whether a body without touching it surrounds a point of another body."""
    if not np.isfinite(world.spheres[inner, 3]) or (world.kinds[outer] == SURFACE and not world.closed[outer]):
        return False
    corner = np.zeros(3)  # of a body in closed form: its centre
    if world.roots[inner] >= 0:
        surface = world.scene if world.scenic[inner] else world.robot
        node = world.roots[inner]
        while surface.links[node, 0] >= 0:
            node = surface.links[node, 0]
        corner = surface.triangles[surface.links[node, 1]][:3]
    one, two = poses[inner], poses[outer]
    local = np.empty(3)
    for row in range(3):
        local[row] = 0.0
        for axis in range(3):
            value = (one[axis, 0] * corner[0] + one[axis, 1] * corner[1] + one[axis, 2] * corner[2] + one[axis, 3]
                     - two[axis, 3])
            local[row] += two[axis, row] * value
    if world.kinds[outer] != SURFACE:
        size = world.sizes[outer]
        return solid_distance(world.kinds[outer], size[0], size[1], size[2], local[0], local[1], local[2]) < -ROUNDING
    sphere = world.spheres[outer]
    if ((local[0] - sphere[0]) ** 2 + (local[1] - sphere[1]) ** 2 + (local[2] - sphere[2]) ** 2
            > sphere[3] * sphere[3]):
        return False
    surface = world.scene if world.scenic[outer] else world.robot
    return encloses(surface.spheres, surface.links, surface.triangles, world.roots[outer],
                    local[0], local[1], local[2])


@njit(cache=True, nogil=True)
def surrounded_pair(world, poses):  # type: ignore[no-untyped-def]
    """Returns the first pair of which one body lies wholly inside the other, or -1; they must not touch."""
    for pair in range(len(world.pairs)):
        if world.exact[pair]:
            first, second = world.pairs[pair, 0], world.pairs[pair, 1]
            if _goes_round(world, first, second, poses) or _goes_round(world, second, first, poses):
                return pair
    return -1


@njit(cache=True, nogil=True)
def _reach_of(world, body, until, placements, centres, change):  # type: ignore[no-untyped-def]
    """Bounds how far a point of a body moves [m], seen from the joint `until`, when every joint changes by `change`.

    Going from the body to the base, the distance of the body from each axis can grow by what the joints already
    passed can move it.
    """
    moved = 0.0
    radius = world.spheres[body, 3]
    joint = world.joints[body]
    while joint != until:
        if change[joint] > 0.0:
            if world.tree.prismatic[joint]:
                moved += change[joint]
            else:
                place, axis = placements[joint], world.tree.axes[joint]
                ax = place[0, 0] * axis[0] + place[0, 1] * axis[1] + place[0, 2] * axis[2]
                ay = place[1, 0] * axis[0] + place[1, 1] * axis[1] + place[1, 2] * axis[2]
                az = place[2, 0] * axis[0] + place[2, 1] * axis[1] + place[2, 2] * axis[2]
                x, y, z = (centres[body, 0] - place[0, 3], centres[body, 1] - place[1, 3],
                           centres[body, 2] - place[2, 3])
                reach = np.sqrt((ay * z - az * y) ** 2 + (az * x - ax * z) ** 2 + (ax * y - ay * x) ** 2)
                moved += change[joint] * (reach + radius + moved)
        joint = world.tree.parents[joint]
    return moved


@njit(cache=True, nogil=True)
def _common_joint(tree, first, second):  # type: ignore[no-untyped-def]
    """Returns the last joint both bodies' joints depend on, -1 for none."""
    while first != second:  # parents come before children
        if first > second:
            first = tree.parents[first]
        else:
            second = tree.parents[second]
    return first


@njit(cache=True, nogil=True)
def _pair_motion(world, pair, placements, centres, change):  # type: ignore[no-untyped-def]
    first, second = world.pairs[pair, 0], world.pairs[pair, 1]
    common = _common_joint(world.tree, world.joints[first], world.joints[second])
    return (_reach_of(world, first, common, placements, centres, change)
            + _reach_of(world, second, common, placements, centres, change))


@njit(cache=True, nogil=True)
def _fill_cell(world, table, pair, row, column):  # type: ignore[no-untyped-def]
    """Finds out whether two links stay apart all through a cell of their table."""
    first, second = world.pairs[pair, 0], world.pairs[pair, 1]
    if world.joints[first] < world.joints[second]:
        first, second = second, first  # the first one is the one that moves, seen from the other
    count = len(world.tree.parents)
    positions, placements = np.zeros(count), np.empty((count, 3, 4))
    near, far = world.table_joints[table, 0], world.table_joints[table, 1]
    width = 2.0 * np.pi / CELLS
    positions[near] = (row + 0.5) * width
    turns = 1
    if far >= 0:
        positions[far] = (column + 0.5) * width
        turns = 2
    joint_placements(world.tree, positions, placements)
    bodies = len(world.joints)
    poses, centres = np.empty((bodies, 3, 4)), np.empty((bodies, 3))
    place_bodies(world, placements, poses, centres)
    relative, origins, axes = np.empty((3, 4)), np.empty((turns, 3)), np.empty((turns, 3))
    _relative_pose(poses[first], poses[second], relative)
    for turn in range(turns):
        joint = far if turns == 2 and turn == 0 else near
        place, axis, base = placements[joint], world.tree.axes[joint], poses[second]
        for line in range(3):
            origins[turn, line], axes[turn, line] = 0.0, 0.0
            for inner in range(3):
                origins[turn, line] += base[inner, line] * (place[inner, 3] - base[inner, 3])
                axes[turn, line] += base[inner, line] * (
                    place[inner, 0] * axis[0] + place[inner, 1] * axis[1] + place[inner, 2] * axis[2])
    surfaces = world.robot
    apart = surfaces_stay_apart(
        surfaces.spheres, surfaces.boxes, surfaces.links, surfaces.triangles, world.roots[first],
        surfaces.spheres, surfaces.boxes, surfaces.links, surfaces.triangles, world.roots[second],
        relative, origins, axes, np.full(turns, 0.5 * width * (1.0 + 1e-9)))
    world.tables[table, row, column] = APART if apart else NEAR


@njit(cache=True, nogil=True)
def _cells(states, low, high, joint):  # type: ignore[no-untyped-def]
    """Returns the first cell that a joint passes between two states of a path, and how many."""
    if joint < 0:
        return 0, 1
    least, most = np.inf, -np.inf
    for number in range(low, high + 1):
        least, most = min(least, states[number, joint]), max(most, states[number, joint])
    width = 2.0 * np.pi / CELLS
    begin = int(np.floor(least / width))
    return begin, int(np.floor(most / width)) - begin + 1


@njit(cache=True, nogil=True)
def _apart_by_table(world, pair, states, low, high):  # type: ignore[no-untyped-def]
    """Whether the table of a pair says that its links are apart everywhere between two states of a path."""
    table = world.table_of[pair]
    row, rows = _cells(states, low, high, world.table_joints[table, 0])
    column, columns = _cells(states, low, high, world.table_joints[table, 1])
    if rows * columns > MOST_CELLS:
        return False
    for i in range(row, row + rows):
        for j in range(column, column + columns):
            if world.tables[table, i % CELLS, j % CELLS] == UNKNOWN:
                _fill_cell(world, table, pair, i % CELLS, j % CELLS)
            if world.tables[table, i % CELLS, j % CELLS] != APART:
                return False
    return True


@njit(cache=True, nogil=True)
def check_path(world, states, first, undecided):  # type: ignore[no-untyped-def]
    """Checks states along a path; those within the clearance of a looked-at state are not looked at.

    Args:
        world: what to check in.
        states: positions of the whole robot along the path, shape (n, joints); straight between neighbours.
        first: number of the first state that has to be free.
        undecided: filled with (state, pair) too close to tell, shape (MOST_UNDECIDED, 2).

    Returns:
        (status, number): TOUCHING with the number of a state that touches; TOO_CLOSE with the number of undecided
        entries, one more than fit when they do not fit; CLEAR with the number of states looked at.
    """
    count, joints = states.shape
    bodies = len(world.joints)
    travelled = np.zeros((count, joints))
    for number in range(1, count):
        for joint in range(joints):
            travelled[number, joint] = travelled[number - 1, joint] + abs(
                states[number, joint] - states[number - 1, joint])
    placements, poses, centres = np.empty((joints, 3, 4)), np.empty((bodies, 3, 4)), np.empty((bodies, 3))
    relative, change = np.empty((3, 4)), np.empty(joints)
    ranges = np.empty((2 * count + 4, 4), np.int64)  # first state, last state, and their pairs' place in `active`
    active = np.arange(4 * len(world.pairs) + 16)
    used = len(world.pairs)
    ranges[0] = count - 1, count - 1, 0, used
    ranges[1] = first, count - 2, 0, used
    head, tail, looked_at, open_questions = 0, 2, 0, 0
    while head < tail:
        low, high, begin, end = ranges[head]
        head += 1
        if low > high:
            continue
        middle = (low + high) // 2
        for joint in range(joints):
            change[joint] = max(travelled[middle, joint] - travelled[low, joint],
                                travelled[high, joint] - travelled[middle, joint])
        joint_placements(world.tree, states[middle], placements)
        place_bodies(world, placements, poses, centres)
        looked_at += 1
        if used + end - begin > len(active):
            larger = np.empty(2 * len(active), active.dtype)
            larger[:used] = active[:used]
            active = larger
        kept, share = used, 1.0
        for place in range(begin, end):
            pair = active[place]
            if world.table_of[pair] >= 0:
                if _apart_by_table(world, pair, states, low, high):
                    continue
                if low < high and _apart_by_table(world, pair, states, middle, middle):
                    active[kept] = pair
                    kept += 1
                    share = 0.0
                    continue
            needed = (_pair_motion(world, pair, placements, centres, change) if low < high else 0.0) + 2.0 * ROUNDING
            status, bound = pair_bound(world, pair, poses, centres, needed, relative)
            if status == TOUCHING:
                return TOUCHING, middle
            if status == TOO_CLOSE:
                if open_questions >= len(undecided):
                    return TOO_CLOSE, open_questions + 1
                undecided[open_questions, 0], undecided[open_questions, 1] = middle, pair
                open_questions += 1
            if bound < needed:
                active[kept] = pair
                kept += 1
                share = min(share, bound / needed)
        if count == 1 and surrounded_pair(world, poses) >= 0:  # a path from a free state would cross the surface
            return TOUCHING, middle
        if kept == used:
            continue
        below, above = middle - 1, middle + 1
        while below >= low and _within(travelled[middle], travelled[below], change, share):
            below -= 1
        while above <= high and _within(travelled[above], travelled[middle], change, share):
            above += 1
        ranges[tail] = low, below, used, kept
        ranges[tail + 1] = above, high, used, kept
        tail += 2
        used = kept
    return (TOO_CLOSE, open_questions) if open_questions else (CLEAR, looked_at)


@njit(cache=True, nogil=True)
def _within(later, earlier, change, share):  # type: ignore[no-untyped-def]
    for joint in range(len(change)):  # noqa: SIM110 - numba compiles no generator
        if later[joint] - earlier[joint] > share * change[joint]:
            return False
    return True


@njit(cache=True, nogil=True)
def _samples(vertices, step):  # type: ignore[no-untyped-def]
    """Returns states on the straight pieces between vertices (n, joints), at most `step` apart in every joint."""
    total = 1
    counts = np.empty(len(vertices), np.int64)
    for number in range(1, len(vertices)):
        widest = 0.0
        for joint in range(vertices.shape[1]):
            widest = max(widest, abs(vertices[number, joint] - vertices[number - 1, joint]))
        counts[number] = max(1, int(np.ceil(widest / step)))
        total += counts[number]
    states = np.empty((total, vertices.shape[1]))
    states[0] = vertices[0]
    row = 1
    for number in range(1, len(vertices)):
        for part in range(1, counts[number] + 1):
            share = part / counts[number]
            for joint in range(vertices.shape[1]):
                states[row, joint] = vertices[number - 1, joint] + share * (
                    vertices[number, joint] - vertices[number - 1, joint])
            row += 1
    return states


def arguments(world: World) -> tuple[NDArray[Any], ...]:
    """Returns the arrays of a world one by one: numba takes 70 microseconds to recognise a tuple, 4 for these."""
    return (*world.tree, *world[1:9], *world.robot, *world.scene, *world[11:])


@njit(cache=True, nogil=True)
def _world(parents, placements, axes, prismatic, joints, poses, roots, scenic,  # type: ignore[no-untyped-def]
           kinds, sizes, spheres, closed, robot_spheres, robot_boxes, robot_links, robot_triangles,
           scene_spheres, scene_boxes, scene_links, scene_triangles, pairs, margins, exact,
           tables, table_joints, table_of):
    return World(Tree(parents, placements, axes, prismatic), joints, poses, roots, scenic, kinds, sizes, spheres,
                 closed, Surfaces(robot_spheres, robot_boxes, robot_links, robot_triangles),
                 Surfaces(scene_spheres, scene_boxes, scene_links, scene_triangles), pairs, margins, exact, tables,
                 table_joints, table_of)


@njit(cache=True, nogil=True)
def check_polyline(vertices, step, first, undecided, *world):  # type: ignore[no-untyped-def]
    """Checks straight pieces between vertices (n, joints) at states at most `step` apart in every joint.

    `world` is what `arguments` returns; the others are as for check_path.

    Returns:
        What check_path does, and the states.
    """
    states = _samples(vertices, step)
    status, number = check_path(_world(*world), states, first, undecided)
    return status, number, states


@njit(cache=True, nogil=True)
def surrounded_pair_at(positions, *world):  # type: ignore[no-untyped-def]
    """Returns the first pair of which one body lies wholly inside the other at these positions, or -1."""
    return _surrounded_at(_world(*world), positions)


@njit(cache=True, nogil=True)
def _surrounded_at(world, positions):  # type: ignore[no-untyped-def]
    placements = np.empty((len(positions), 3, 4))
    poses, centres = np.empty((len(world.joints), 3, 4)), np.empty((len(world.joints), 3))
    joint_placements(world.tree, positions, placements)
    place_bodies(world, placements, poses, centres)
    return surrounded_pair(world, poses)
