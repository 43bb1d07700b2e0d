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

from modular_framework_planning.collision_detection.kernels.compiled_arrays import borrowed
from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    APART,
    ASKED,
    FIELD,
    FOUND_FREE,
    FOUND_TOUCHING,
    LOOKED_AT,
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
    Memory,
    new_memory,
    placed_solid_distance,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance_field import field_distance
from modular_framework_planning.collision_detection.kernels.compiled_tables import fill_cells, table_answer
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements

UNDECIDED_ROWS = 256  # to begin with
LONG_MOTION = 0.2  # [m]; a stretch on which a body can move farther is halved without asking for clearances


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
    samples = Samples(vertices, np.zeros(len(vertices), np.int64), np.zeros(vertices.shape))
    number_samples(samples, step)
    return samples


@njit(cache=True, nogil=True)
def number_samples(samples, step):  # type: ignore[no-untyped-def]
    """Writes the numbers of the samples at the vertices and how far the joints have gone there."""
    vertices, numbers, travelled = samples
    count, joints = vertices.shape
    numbers[0], travelled[0] = 0, 0.0
    for vertex in range(1, count):
        widest = 0.0
        for joint in range(joints):
            change = abs(vertices[vertex, joint] - vertices[vertex - 1, joint])
            travelled[vertex, joint] = travelled[vertex - 1, joint] + change
            widest = max(widest, change)
        numbers[vertex] = numbers[vertex - 1] + max(1, int(np.ceil(widest / step)))


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


class Stretch(NamedTuple):
    """What is known about a stretch of a path and the sample in its middle.

    Attributes:
        placements: poses of the joints at the sample, shape (joints, 3, 4).
        poses: of the bodies at the sample, shape (b, 3, 4).
        centres: of the spheres around the bodies at the sample, shape (b, 3).
        axes: point and direction of each joint's axis at the sample, shape (joints, 6).
        still: least and largest positions at the sample, shape (2, joints).
        reach: least and largest positions on the stretch, shape (2, joints).
        change: how far each joint moves at most from the sample to either end, shape (joints,).
        signs: in which direction each joint moves, 1 or -1, all 0 where the stretch is not straight; shape (joints,).
        motions: how far a point of each body moves at most meanwhile [m]; shape (b,).
        rows: working memory, shape (3, joints).
    """

    placements: Array
    poses: Array
    centres: Array
    axes: Array
    still: Array
    reach: Array
    change: Array
    signs: Array
    motions: Array
    rows: Array


@njit(cache=True, nogil=True)
def _new_stretch(joints, bodies):  # type: ignore[no-untyped-def]
    placements, poses, centres = np.empty((joints, 3, 4)), np.empty((bodies, 3, 4)), np.empty((bodies, 3))
    axes, still, reach = np.empty((joints, 6)), np.empty((2, joints)), np.empty((2, joints))
    change, signs, motions, rows = np.empty(joints), np.empty(joints), np.zeros(bodies), np.empty((3, joints))
    return Stretch(placements, poses, centres, axes, still, reach, change, signs, motions, rows)


class Workspace(NamedTuple):
    """Working memory of the check of a path."""

    stretch: Stretch
    memory: Memory
    order: NDArray[np.int64]


@njit(cache=True, nogil=True)
def new_workspace(world):  # type: ignore[no-untyped-def]
    """Returns working memory for path checks in a world."""
    joints, bodies = len(world.tree.parents), len(world.joints)
    return Workspace(_new_stretch(joints, bodies), new_memory(), world.watched.copy())


@njit(cache=True, nogil=True)
def release(workspace):  # type: ignore[no-untyped-def]
    """Marks where working memory was used last: until here it has an owner."""
    workspace.stretch.motions[:], workspace.memory.bounds[0] = 0.0, 0.0


@njit(cache=True, nogil=True)
def look_at(world, samples, low, high, begins, stretch):  # type: ignore[no-untyped-def]
    """Places the bodies at the sample in the middle of two others, and bounds their motion to these.

    Args:
        world: what is checked.
        samples: of the path.
        low: the first of the two samples.
        high: the last of them.
        begins: whether this is the first sample looked at; only then are bodies of the world placed.
        stretch: filled; what bounds the motion only where low and high differ.

    Returns:
        How far a body moves at most [m], bodies without an end left out.
    """
    numbers, middle, still, hangs_on = samples.numbers, (low + high) // 2, stretch.still, world.joints
    write_row(samples.vertices, numbers, middle, still[0])
    still[1] = still[0]
    joint_placements(world.tree, still[0], stretch.placements)
    place_bodies(world, stretch.placements, stretch.poses, stretch.centres, begins)
    longest = 0.0
    if low == high:
        return longest
    begun, ended, row, change, axes = stretch.rows[0], stretch.rows[1], stretch.rows[2], stretch.change, stretch.axes
    signs = stretch.signs
    write_row(samples.vertices, numbers, low, begun)
    write_row(samples.vertices, numbers, high, ended)
    _write_reach(samples.vertices, numbers, low, high, begun, ended, stretch.reach)
    straight = 1.0 if _is_straight(numbers, low, high) else 0.0
    for joint in range(len(signs)):
        signs[joint] = straight if ended[joint] > begun[joint] else -straight
    write_row(samples.travelled, numbers, low, begun)
    write_row(samples.travelled, numbers, high, ended)
    write_row(samples.travelled, numbers, middle, row)
    for joint in range(len(change)):
        change[joint] = max(row[joint] - begun[joint], ended[joint] - row[joint])
    _write_axes(world.tree.axes, stretch.placements, axes)
    parents, prismatic, centres, spheres = world.tree.parents, world.tree.prismatic, stretch.centres, world.spheres
    for body in range(len(hangs_on)):
        if hangs_on[body] >= 0:
            joint = hangs_on[body]
            motion = _motion_of(parents, prismatic, axes, change, signs, centres, spheres, body, joint, -1)
            stretch.motions[body] = motion
            longest = max(longest, motion if motion < np.inf else 0.0)
    return longest


@njit(cache=True, nogil=True)
def _write_axes(directions, placements, out):  # type: ignore[no-untyped-def]
    """Writes a point and the direction of each joint's axis."""
    for joint in range(len(out)):
        a, b, c = directions[joint, 0], directions[joint, 1], directions[joint, 2]
        for row in range(3):
            pose = placements[joint, row]
            out[joint, row] = pose[3]
            out[joint, 3 + row] = pose[0] * a + pose[1] * b + pose[2] * c


@njit(cache=True, nogil=True)
def _is_straight(numbers, low, high):  # type: ignore[no-untyped-def]
    """Whether all samples between two samples lie on one straight piece."""
    begin, (end, share) = _piece_of(numbers, low)[0], _piece_of(numbers, high)
    return end == begin or (end == begin + 1 and share == 0.0)


@njit(cache=True, nogil=True)
def _motion_of(parents, prismatic, axes, change, signs, centres, spheres, body, joint, until):  # type: ignore[no-untyped-def]
    """Bounds how far a point of a body moves [m], seen from the joint `until`, when joints change by `change` at most.

    The smaller one of two bounds. Let a joint j change by d_j, and R_j be the distance of the body (a sphere with
    centre c and radius r) from its axis a_j, which grows by what the joints between can move the body.

    - The lengths of all arcs: M = sum d_j R_j.
    - On a straight stretch, the velocity v at its sample and half the acceleration: |v| + sum d_j (M_j + d_j R_j / 2),
      where M_j is the part of M that the joints between j and the body make, and |v| at most
      |sum d_j a_j x (c - o_j)| + r |sum d_j a_j|, with the sign of each change. Joints that turn against each other
      then count against each other.
    """
    moved, bent = 0.0, 0.0
    vx, vy, vz, wx, wy, wz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    radius, is_straight = spheres[body, 3], True
    while joint != until:
        turn = change[joint]
        if turn > 0.0:
            ax, ay, az = axes[joint, 3], axes[joint, 4], axes[joint, 5]
            signed = turn * signs[joint]
            is_straight = is_straight and signed != 0.0
            if prismatic[joint]:
                moved += turn
                vx, vy, vz = vx + signed * ax, vy + signed * ay, vz + signed * az
            else:
                x, y, z = (
                    centres[body, 0] - axes[joint, 0],
                    centres[body, 1] - axes[joint, 1],
                    centres[body, 2] - axes[joint, 2],
                )
                cx, cy, cz = ay * z - az * y, az * x - ax * z, ax * y - ay * x
                arc = turn * (np.sqrt(cx * cx + cy * cy + cz * cz) + radius + moved)
                bent += turn * (moved + 0.5 * arc)
                moved += arc
                vx, vy, vz = vx + signed * cx, vy + signed * cy, vz + signed * cz
                wx, wy, wz = wx + signed * ax, wy + signed * ay, wz + signed * az
        joint = parents[joint]
    if not is_straight or moved == np.inf:
        return moved
    speed = np.sqrt(vx * vx + vy * vy + vz * vz) + radius * np.sqrt(wx * wx + wy * wy + wz * wz)
    return min(moved, speed + bent)


@njit(cache=True, nogil=True)
def _certified(samples, near, far, change, rows):  # type: ignore[no-untyped-def]
    """Returns the sample farthest from `near`, towards `far`, where no joint has gone further than `change`.

    The last argument is working memory, shape (2, joints) at least.
    """
    travelled, numbers, begun, row = samples.travelled, samples.numbers, rows[0], rows[1]
    write_row(travelled, numbers, near, begun)
    write_row(travelled, numbers, far, row)
    if _is_within(row, begun, change):
        return far
    while abs(far - near) > 1:
        middle = (near + far) // 2
        write_row(travelled, numbers, middle, row)
        if _is_within(row, begun, change):
            near = middle
        else:
            far = middle
    return near


@njit(cache=True, nogil=True)
def _is_within(one, other, change):  # type: ignore[no-untyped-def]
    for joint in range(len(change)):  # noqa: SIM110 - numba compiles no generator
        if abs(one[joint] - other[joint]) > change[joint]:
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
def _with_room(rows, count):  # type: ignore[no-untyped-def]
    """Returns an array that begins with the same rows and has at least `count`."""
    if count <= len(rows):
        return rows
    larger = np.empty((max(count, 2 * len(rows)), *rows.shape[1:]), rows.dtype)
    larger[: len(rows)] = rows
    return larger


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
        entries, more than n when they do not fit; CLEAR with the number of samples looked at.
    """
    workspace = new_workspace(world)
    result = check_samples(world, borrowed(samples), first, undecided, borrowed(workspace))
    release(workspace)
    return result


@njit(cache=True, nogil=True)
def _move_to_front(order, pair):  # type: ignore[no-untyped-def]
    """Moves a pair to the front: what touched last often touches next, and is then found before other pairs."""
    place = 0
    while order[place] != pair:
        place += 1
    while place > 0:
        order[place] = order[place - 1]
        place -= 1
    order[0] = pair


# What is done to each pair stands in the loop, on single arrays: a call costs more than most of what is asked.
@njit(cache=True, nogil=True)
def check_samples(world, samples, first, undecided, workspace):  # type: ignore[no-untyped-def]
    """Does what check_path does, in given working memory; none of the arrays should have an owner (see `borrowed`)."""
    stretch, memory, order = workspace
    pairs, margins, spheres, kinds, sizes = world.pairs, world.margins, world.spheres, world.kinds, world.sizes
    tables, table_joints, table_of = world.tables, world.table_joints, world.table_of
    parents, prismatic, hangs_on, field = world.tree.parents, world.tree.prismatic, world.joints, world.field
    counts, refusals, represented = world.counts, world.refusals, world.represented
    _, poses, centres, axes, still, reach, change, signs, motions, rows = stretch
    ranges = np.empty((64, 4), np.int64)  # first sample, last sample, and their pairs' indices in `active`
    active, used, last = np.empty(4 * len(pairs) + 16, np.int64), len(world.watched), samples.numbers[-1]
    active[:used] = order
    ranges[0], ranges[1] = (last, last, 0, used), (first, last - 1, 0, used)
    head, tail, looked_at, open_questions = 0, 2, 0, 0
    while head < tail:
        low, high, begin, end = ranges[head, 0], ranges[head, 1], ranges[head, 2], ranges[head, 3]
        head += 1
        if low > high:
            continue
        middle, kept, share = (low + high) // 2, used, 1.0
        is_long = look_at(world, samples, low, high, looked_at == 0, stretch) > LONG_MOTION
        looked_at += 1
        moves = low < high and not is_long
        active = _with_room(active, used + end - begin)
        for index in range(begin, end):
            pair = active[index]
            if table_of[pair] >= 0:
                if moves and _table_says(world, tables, table_joints, table_of, pair, reach) == APART:
                    continue
                if _table_says(world, tables, table_joints, table_of, pair, still) == APART:
                    if moves:
                        active[kept] = pair
                        kept, share = kept + 1, 0.0
                    continue
            one, two, needed = pairs[pair, 0], pairs[pair, 1], 2.0 * ROUNDING
            x, y, z = centres[one, 0], centres[one, 1], centres[one, 2]
            if two == FIELD:
                needed += motions[one] if moves else 0.0
                apart = needed + spheres[one, 3] + margins[pair]
                if field_distance(field, x, y, z, apart) >= apart:
                    continue
            else:
                if moves:
                    common = world.meets[pair]
                    if common < 0:
                        needed += motions[one] + motions[two]
                    else:
                        needed += _motion_of(
                            parents, prismatic, axes, change, signs, centres, spheres, one, hangs_on[one], common
                        )
                        needed += _motion_of(
                            parents, prismatic, axes, change, signs, centres, spheres, two, hangs_on[two], common
                        )
                if centre_gap(centres, one, two) - spheres[one, 3] - spheres[two, 3] - margins[pair] >= needed:
                    continue
                if kinds[two] != SURFACE:
                    gap = placed_solid_distance(solid_of(kinds, sizes, two), poses, two, x, y, z)
                    if gap - spheres[one, 3] - margins[pair] >= needed:
                        continue
            status, bound = pair_bound(world, pair, poses, centres, needed, memory)
            if status == TOUCHING:
                counts[LOOKED_AT] += looked_at
                refusals[represented[pair - len(pairs) + len(represented), int(bound)] if two == FIELD else pair] += 1
                _move_to_front(order, pair)
                return TOUCHING, middle
            if status == TOO_CLOSE:
                if open_questions < len(undecided):
                    undecided[open_questions] = middle, pair
                open_questions += 1
            if bound < needed and moves:
                active[kept] = pair
                kept, share = kept + 1, min(share, bound / needed)
        surrounded = surrounded_pair(world, poses, centres) if len(samples.vertices) == 1 else -1
        if surrounded >= 0:  # a path would cross the surface
            counts[LOOKED_AT] += looked_at
            refusals[surrounded] += 1
            return TOUCHING, middle
        if is_long:
            ranges = _with_room(ranges, tail + 2)
            ranges[tail], ranges[tail + 1] = (low, middle - 1, begin, end), (middle + 1, high, begin, end)
            tail += 2
        elif kept > used:
            change *= share
            ranges = _with_room(ranges, tail + 2)
            ranges[tail] = low, _certified(samples, middle, low, change, rows) - 1, used, kept
            ranges[tail + 1] = _certified(samples, middle, high, change, rows) + 1, high, used, kept
            tail, used = tail + 2, kept
    counts[LOOKED_AT] += looked_at
    return (TOO_CLOSE, open_questions) if open_questions else (CLEAR, looked_at)


@njit(cache=True, nogil=True)
def count_verdict(counts, status):  # type: ignore[no-untyped-def]
    """Counts a check in World.counts."""
    counts[ASKED] += 1
    if status == CLEAR:
        counts[FOUND_FREE] += 1
    elif status == TOUCHING:
        counts[FOUND_TOUCHING] += 1


@njit(cache=True, nogil=True)
def check_polyline(vertices, step, first, undecided, *world):  # type: ignore[no-untyped-def]
    """Checks straight pieces between vertices (n, joints) at samples at most `step` apart in every joint.

    `world` is what `arguments` returns; the others are as for check_path.

    Returns:
        What check_path does, and the numbers of the samples at the vertices, shape (n,).
    """
    samples = sample(vertices, step)
    bodies = world_of(world)
    status, number = check_path(bodies, samples, first, undecided)
    count_verdict(bodies.counts, status)
    return status, number, samples.numbers


@njit(cache=True, nogil=True)
def sample_at(vertices, numbers, number):  # type: ignore[no-untyped-def]
    """Returns the positions of a sample, shape (joints,)."""
    out = np.empty(vertices.shape[1])
    write_row(vertices, numbers, number, out)
    return out
