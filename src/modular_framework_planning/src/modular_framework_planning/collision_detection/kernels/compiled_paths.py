# SPDX-License-Identifier: BSD-3-Clause
"""Checks whole paths of a robot in a world, compiled: a known clearance certifies a stretch of the path at once.

Around a state with clearance c between two bodies, every other state is free of that pair as long as the bodies move
by less than c. How far they can move is bounded by each joint's change times the body's reach from the joint's axis.
Samples along a path are numbers until one is looked at, so that a fine step costs no more than a coarse one where the
path is far from everything.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    APART,
    UNKNOWN,
    centre_gap,
    pair_bound,
    place_bodies,
    solid_of,
    surrounded_pair,
    world_of,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import (
    CLEAR,
    ROUNDING,
    SURFACE,
    TOO_CLOSE,
    TOUCHING,
    placed_solid_distance,
)
from modular_framework_planning.collision_detection.kernels.compiled_tables import fill_cells, table_answer
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements

UNDECIDED_ROWS = 256  # to begin with


class Samples(NamedTuple):
    """Numbered samples on the straight pieces of a polyline.

    Attributes:
        vertices: positions of the whole robot, shape (n, joints).
        numbers: of the samples at the vertices, from 0; shape (n,).
        travelled: how far each joint has gone at each vertex, forth and back added up; shape (n, joints).
    """

    vertices: Array
    numbers: NDArray[np.int64]
    travelled: Array


@njit(cache=True, nogil=True)
def sample(vertices, step):  # type: ignore[no-untyped-def]
    """Numbers samples at most `step` apart in every joint."""
    count, joints = vertices.shape
    numbers, travelled = np.zeros(count, np.int64), np.zeros((count, joints))
    for vertex in range(1, count):
        widest = 0.0
        for joint in range(joints):
            change = abs(vertices[vertex, joint] - vertices[vertex - 1, joint])
            travelled[vertex, joint] = travelled[vertex - 1, joint] + change
            widest = max(widest, change)
        numbers[vertex] = numbers[vertex - 1] + max(1, int(np.ceil(widest / step)))
    return Samples(vertices, numbers, travelled)


@njit(cache=True, nogil=True)
def _piece_of(numbers, number):  # type: ignore[no-untyped-def]
    """Returns the vertex before a sample and the share of the way from there to the next one."""
    low, high = 0, len(numbers) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if numbers[middle] <= number:
            low = middle
        else:
            high = middle
    return (low, (number - numbers[low]) / (numbers[high] - numbers[low])) if high > low else (0, 0.0)


@njit(cache=True, nogil=True)
def write_row(rows, numbers, number, out):  # type: ignore[no-untyped-def]
    """Writes the row (joints,) that belongs to a sample, between those (n, joints) of the vertices."""
    vertex, share = _piece_of(numbers, number)
    for joint in range(rows.shape[1]):
        out[joint] = rows[vertex, joint]
        if share > 0.0:
            out[joint] += share * (rows[vertex + 1, joint] - rows[vertex, joint])


@njit(cache=True, nogil=True)
def _write_reach(vertices, numbers, low, high, first, last, reach):  # type: ignore[no-untyped-def]
    """Writes least and largest positions (2, joints) between two samples, whose positions are first and last."""
    for joint in range(vertices.shape[1]):
        reach[0, joint], reach[1, joint] = min(first[joint], last[joint]), max(first[joint], last[joint])
    begin, end = _piece_of(numbers, low)[0] + 1, _piece_of(numbers, high)[0]
    for vertex in range(begin, end + 1):
        for joint in range(vertices.shape[1]):
            reach[0, joint] = min(reach[0, joint], vertices[vertex, joint])
            reach[1, joint] = max(reach[1, joint], vertices[vertex, joint])


@njit(cache=True, nogil=True)
def _motion_of(parents, prismatic, axes, placements, change, sphere, joint, until):  # type: ignore[no-untyped-def]
    """Bounds how far a point of a body moves [m], seen from the joint `until`, when every joint changes by `change`.

    Going from the body's joint to the base, the distance of the body (a sphere) from each axis can grow by what the
    joints already passed can move it.
    """
    centre_x, centre_y, centre_z, radius = sphere
    moved = 0.0
    while joint != until:
        if change[joint] > 0.0:
            if prismatic[joint]:
                moved += change[joint]
            else:
                a, b, c = axes[joint, 0], axes[joint, 1], axes[joint, 2]
                ax = placements[joint, 0, 0] * a + placements[joint, 0, 1] * b + placements[joint, 0, 2] * c
                ay = placements[joint, 1, 0] * a + placements[joint, 1, 1] * b + placements[joint, 1, 2] * c
                az = placements[joint, 2, 0] * a + placements[joint, 2, 1] * b + placements[joint, 2, 2] * c
                x, y, z = (
                    centre_x - placements[joint, 0, 3],
                    centre_y - placements[joint, 1, 3],
                    centre_z - placements[joint, 2, 3],
                )
                reach = np.sqrt((ay * z - az * y) ** 2 + (az * x - ax * z) ** 2 + (ax * y - ay * x) ** 2)
                moved += change[joint] * (reach + radius + moved)
        joint = parents[joint]
    return moved


@njit(cache=True, nogil=True)
def _common_joint(parents, first, second):  # type: ignore[no-untyped-def]
    """Returns the last joint both joints depend on, -1 for none."""
    while first != second:  # parents come before children
        if first > second:
            first = parents[first]
        else:
            second = parents[second]
    return first


@njit(cache=True, nogil=True)
def _first_within(travelled, numbers, near, far, reference, change, share, row):  # type: ignore[no-untyped-def]
    """Returns the sample farthest from `near`, towards `far`, where no joint has gone further than a share of `change`.

    Args:
        travelled: how far each joint has gone at the vertices, shape (n, joints).
        numbers: sample at each vertex.
        near: the sample that is certified.
        far: the sample where the search ends.
        reference: the travel at the certified sample.
        change: how far each joint may have gone where share is 1.
        share: of the change.
        row: working memory.
    """
    write_row(travelled, numbers, far, row)
    if _is_within(row, reference, change, share):
        return far
    while abs(far - near) > 1:
        middle = (near + far) // 2
        write_row(travelled, numbers, middle, row)
        if _is_within(row, reference, change, share):
            near = middle
        else:
            far = middle
    return near


@njit(cache=True, nogil=True)
def _is_within(one, other, change, share):  # type: ignore[no-untyped-def]
    for joint in range(len(change)):  # noqa: SIM110 - numba compiles no generator
        if abs(one[joint] - other[joint]) > share * change[joint]:
            return False
    return True


@njit(cache=True, nogil=True)
def _table_says(world, tables, table_joints, table_of, pair, reach):  # type: ignore[no-untyped-def]
    answer = table_answer(tables, table_of[pair], table_joints, reach)
    if answer == UNKNOWN:
        fill_cells(world, pair, reach)
        answer = table_answer(tables, table_of[pair], table_joints, reach)
    return answer


@njit(cache=True, nogil=True)
def check_path(world, samples, first, undecided):  # type: ignore[no-untyped-def]
    """Checks samples of a path; those within the clearance of a looked-at sample are not looked at.

    Args:
        world: what to check in.
        samples: of the path, positions of the whole robot.
        first: number of the first sample that has to be free.
        undecided: filled with (sample, pair) too close to tell, shape (n, 2).

    Returns:
        (status, number): TOUCHING with the number of a sample that touches; TOO_CLOSE with the number of undecided
        entries, one more than fit when they do not fit; CLEAR with the number of samples looked at.
    """
    vertices, numbers, travelled = samples.vertices, samples.numbers, samples.travelled
    last, joints, bodies = numbers[-1], vertices.shape[1], len(world.joints)
    # a call that is handed the whole world costs more than most of what is asked here: hence single arrays
    parents, prismatic, axes, hangs_on = world.tree.parents, world.tree.prismatic, world.tree.axes, world.joints
    pairs, margins, spheres, kinds, sizes = world.pairs, world.margins, world.spheres, world.kinds, world.sizes
    tables, table_joints, table_of = world.tables, world.table_joints, world.table_of
    placements, poses, centres = np.empty((joints, 3, 4)), np.empty((bodies, 3, 4)), np.empty((bodies, 3))
    relative, change, motions = np.empty((3, 4)), np.empty(joints), np.zeros(bodies)
    state, begun, ended, row = np.empty(joints), np.empty(joints), np.empty(joints), np.empty(joints)
    reach, still = np.empty((2, joints)), np.empty((2, joints))
    ranges = np.empty((64, 4), np.int64)  # first sample, last sample, and their pairs' indices in `active`
    active = np.arange(4 * len(pairs) + 16)
    used = len(pairs)
    ranges[0] = last, last, 0, used
    ranges[1] = first, last - 1, 0, used
    head, tail, looked_at, open_questions = 0, 2, 0, 0
    while head < tail:
        low, high, begin, end = ranges[head, 0], ranges[head, 1], ranges[head, 2], ranges[head, 3]
        head += 1
        if low > high:
            continue
        middle = (low + high) // 2
        write_row(vertices, numbers, middle, state)
        still[0], still[1] = state, state
        if low < high:
            write_row(vertices, numbers, low, begun)
            write_row(vertices, numbers, high, ended)
            _write_reach(vertices, numbers, low, high, begun, ended, reach)
            write_row(travelled, numbers, low, begun)
            write_row(travelled, numbers, high, ended)
            write_row(travelled, numbers, middle, row)
            for joint in range(joints):
                change[joint] = max(row[joint] - begun[joint], ended[joint] - row[joint])
        joint_placements(world.tree, state, placements)
        place_bodies(world, placements, poses, centres, looked_at == 0)
        for body in range(bodies):
            if low < high and hangs_on[body] >= 0:
                sphere = centres[body, 0], centres[body, 1], centres[body, 2], spheres[body, 3]
                motions[body] = _motion_of(parents, prismatic, axes, placements, change, sphere, hangs_on[body], -1)
        looked_at += 1
        if used + end - begin > len(active):
            larger = np.empty(2 * len(active), active.dtype)
            larger[:used] = active[:used]
            active = larger
        kept, share = used, 1.0
        for index in range(begin, end):
            pair = active[index]
            if table_of[pair] >= 0:
                if low < high and _table_says(world, tables, table_joints, table_of, pair, reach) == APART:
                    continue
                if _table_says(world, tables, table_joints, table_of, pair, still) == APART:
                    if low < high:
                        active[kept] = pair
                        kept += 1
                        share = 0.0
                    continue
            one, two = pairs[pair, 0], pairs[pair, 1]
            needed = 2.0 * ROUNDING
            if low < high:
                common = _common_joint(parents, hangs_on[one], hangs_on[two])
                if common < 0:
                    needed += motions[one] + motions[two]
                else:
                    for body in (one, two):
                        sphere = centres[body, 0], centres[body, 1], centres[body, 2], spheres[body, 3]
                        needed += _motion_of(
                            parents, prismatic, axes, placements, change, sphere, hangs_on[body], common
                        )
            if centre_gap(centres, one, two) - spheres[one, 3] - spheres[two, 3] - margins[pair] >= needed:
                continue
            if kinds[two] != SURFACE:
                x, y, z = centres[one, 0], centres[one, 1], centres[one, 2]
                gap = placed_solid_distance(solid_of(kinds, sizes, two), poses, two, x, y, z)
                if gap - spheres[one, 3] - margins[pair] >= needed:
                    continue
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
        if len(vertices) == 1 and surrounded_pair(world, poses, centres) >= 0:  # a path would cross the surface
            return TOUCHING, middle
        if kept == used or low == high:
            continue
        write_row(travelled, numbers, middle, begun)
        below = _first_within(travelled, numbers, middle, low, begun, change, share, row) - 1
        above = _first_within(travelled, numbers, middle, high, begun, change, share, row) + 1
        if tail + 2 > len(ranges):
            longer = np.empty((2 * len(ranges), 4), ranges.dtype)
            longer[:tail] = ranges[:tail]
            ranges = longer
        ranges[tail] = low, below, used, kept
        ranges[tail + 1] = above, high, used, kept
        tail += 2
        used = kept
    return (TOO_CLOSE, open_questions) if open_questions else (CLEAR, looked_at)


@njit(cache=True, nogil=True)
def check_polyline(vertices, step, first, undecided, *world):  # type: ignore[no-untyped-def]
    """Checks straight pieces between vertices (n, joints) at samples at most `step` apart in every joint.

    `world` is what `arguments` returns; the others are as for check_path.

    Returns:
        What check_path does, and the numbers of the samples at the vertices, shape (n,).
    """
    samples = sample(vertices, step)
    status, number = check_path(world_of(world), samples, first, undecided)
    return status, number, samples.numbers


@njit(cache=True, nogil=True)
def sample_at(vertices, numbers, number):  # type: ignore[no-untyped-def]
    """Returns the positions of a sample, shape (joints,)."""
    out = np.empty(vertices.shape[1])
    write_row(vertices, numbers, number, out)
    return out
