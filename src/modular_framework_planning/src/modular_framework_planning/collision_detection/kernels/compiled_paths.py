# SPDX-License-Identifier: BSD-3-Clause
"""Compiled collision checks of whole paths: the clearance at one state certifies a section of the path.

If two bodies have clearance c at a state, the pair cannot collide until the bodies move by c relative to each other.
The motion of a body is bounded by the sum over joints of joint motion times the body's distance from the joint axis.
Only evaluated samples are computed, so that a fine step costs no more than a coarse step far from obstacles.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_arrays import borrowed
from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    APART,
    EVALUATED_STATES,
    FIELD,
    FOUND_FREE,
    FOUND_TOUCHING,
    REQUESTED,
    UNKNOWN,
    World,
    centre_distance,
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
from modular_framework_planning.collision_detection.kernels.compiled_tables import fill_cells, table_verdict
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements

INITIAL_UNDECIDED_ROWS = 256
MAX_MOTION_M = 0.2  # sections with a longer body motion are halved before clearances are computed


class Samples(NamedTuple):
    """Evenly spaced samples on each segment of a polyline, indexed from 0.

    Attributes:
        vertices: Joint positions of the whole robot, shape (n, joints) [rad or m].
        at_vertices: Sample index of each vertex, shape (n,).
        travelled: Distance travelled by each joint up to each vertex, shape (n, joints) [rad or m].
    """

    vertices: Array
    at_vertices: NDArray[np.int64]
    travelled: Array


@njit(cache=True, nogil=True)
def sample(vertices: Array, step: float) -> Samples:
    """Returns samples at most `step` [rad or m] apart in every joint on the polyline `vertices`, shape (n, joints)."""
    samples = Samples(vertices, np.zeros(len(vertices), np.int64), np.zeros(vertices.shape))
    index_samples(samples, step)
    return samples


@njit(cache=True, nogil=True)
def index_samples(samples: Samples, step: float) -> None:
    """Writes the sample index and the travelled joint distances of each vertex."""
    vertices, at_vertices, travelled = samples
    count, joints = vertices.shape
    at_vertices[0], travelled[0] = 0, 0.0
    for vertex in range(1, count):
        widest = 0.0
        for joint in range(joints):
            change = abs(vertices[vertex, joint] - vertices[vertex - 1, joint])
            travelled[vertex, joint] = travelled[vertex - 1, joint] + change
            widest = max(widest, change)
        at_vertices[vertex] = at_vertices[vertex - 1] + max(1, int(np.ceil(widest / step)))


@njit(cache=True, nogil=True)
def _segment_of(at_vertices: NDArray[np.int64], index: int) -> tuple[int, float]:
    """Returns the vertex before a sample, and the sample's fraction of the segment after this vertex."""
    low, high = 0, len(at_vertices) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if at_vertices[middle] <= index:
            low = middle
        else:
            high = middle
    return (low, (index - at_vertices[low]) / (at_vertices[high] - at_vertices[low])) if high > low else (0, 0.0)


@njit(cache=True, nogil=True)
def write_row(rows: Array, at_vertices: NDArray[np.int64], index: int, out: Array) -> None:
    """Interpolates a row at a sample.

    Args:
        rows: Row of each vertex, shape (n, joints).
        at_vertices: Sample index of each vertex, shape (n,).
        index: Index of the sample.
        out: Written row, shape (joints,).
    """
    vertex, fraction = _segment_of(at_vertices, index)
    for joint in range(rows.shape[1]):
        out[joint] = rows[vertex, joint]
        if fraction > 0.0:
            out[joint] += fraction * (rows[vertex + 1, joint] - rows[vertex, joint])


@njit(cache=True, nogil=True)
def _write_joint_ranges(
    vertices: Array, at_vertices: NDArray[np.int64], low: int, high: int, first: Array, last: Array, joint_ranges: Array
) -> None:
    """Writes minimum and maximum joint positions, shape (2, joints), between samples `low` and `high`."""
    for joint in range(vertices.shape[1]):
        joint_ranges[0, joint], joint_ranges[1, joint] = min(first[joint], last[joint]), max(first[joint], last[joint])
    begin, end = _segment_of(at_vertices, low)[0] + 1, _segment_of(at_vertices, high)[0]
    for vertex in range(begin, end + 1):
        for joint in range(vertices.shape[1]):
            joint_ranges[0, joint] = min(joint_ranges[0, joint], vertices[vertex, joint])
            joint_ranges[1, joint] = max(joint_ranges[1, joint], vertices[vertex, joint])


class Stretch(NamedTuple):
    """State at the middle sample of a section of a path, and motion bounds over the section.

    Attributes:
        placements: Poses of the joints at the sample, shape (joints, 3, 4).
        poses: Poses of the bodies at the sample, shape (b, 3, 4).
        centres: Centres of the bounding spheres at the sample, shape (b, 3) [m].
        axes: Point and direction of each joint axis at the sample, shape (joints, 6).
        sample_ranges: Joint positions at the sample, twice; shape (2, joints) [rad or m].
        joint_ranges: Minimum and maximum joint positions on the section, shape (2, joints) [rad or m].
        change: Maximum joint motion from the sample to either end, shape (joints,) [rad or m].
        signs: Direction of each joint's motion, 1 or -1; all 0 if the section is not straight; shape (joints,).
        motions: Maximum motion of any point of each body from the sample to either end, shape (b,) [m].
        rows: Working memory, shape (3, joints).
    """

    placements: Array
    poses: Array
    centres: Array
    axes: Array
    sample_ranges: Array
    joint_ranges: Array
    change: Array
    signs: Array
    motions: Array
    rows: Array


@njit(cache=True, nogil=True)
def _new_stretch(joints: int, bodies: int) -> Stretch:
    placements, poses, centres = np.empty((joints, 3, 4)), np.empty((bodies, 3, 4)), np.empty((bodies, 3))
    axes, sample_ranges, joint_ranges = np.empty((joints, 6)), np.empty((2, joints)), np.empty((2, joints))
    change, signs, motions, rows = np.empty(joints), np.empty(joints), np.zeros(bodies), np.empty((3, joints))
    return Stretch(placements, poses, centres, axes, sample_ranges, joint_ranges, change, signs, motions, rows)


class Workspace(NamedTuple):
    """Working memory of a path check.

    Attributes:
        stretch: State and motion bounds of the current section.
        memory: Working memory of a pair check.
        order: Watched pairs, the pair that touched last first.
    """

    stretch: Stretch
    memory: Memory
    order: NDArray[np.int64]


@njit(cache=True, nogil=True)
def new_workspace(world: World) -> Workspace:
    """Returns working memory for path checks in a world."""
    joints, bodies = len(world.tree.parents), len(world.joints)
    return Workspace(_new_stretch(joints, bodies), new_memory(), world.watched.copy())


@njit(cache=True, nogil=True)
def release(workspace: Workspace) -> None:
    """Keeps working memory alive up to this call, because borrowed arrays do not."""
    workspace.stretch.motions[:], workspace.memory.bounds[0] = 0.0, 0.0


@njit(cache=True, nogil=True)
def evaluate_middle(world: World, samples: Samples, low: int, high: int, is_first: bool, stretch: Stretch) -> float:
    """Places the bodies at the middle sample of a section and bounds their motion to both ends.

    Args:
        world: Bodies and pairs.
        samples: Samples of the path.
        low: First sample of the section.
        high: Last sample of the section.
        is_first: Whether this is the first evaluated sample; only then are bodies of the world placed.
        stretch: Filled; the motion bounds only if `low` and `high` differ.

    Returns:
        Maximum motion over all bounded bodies [m].
    """
    at_vertices, middle, sample_ranges, body_joints = (
        samples.at_vertices,
        (low + high) // 2,
        stretch.sample_ranges,
        world.joints,
    )
    write_row(samples.vertices, at_vertices, middle, sample_ranges[0])
    sample_ranges[1] = sample_ranges[0]
    joint_placements(world.tree, sample_ranges[0], stretch.placements)
    place_bodies(world, stretch.placements, stretch.poses, stretch.centres, is_first)
    max_motion = 0.0
    if low == high:
        return max_motion
    start_row, end_row, row, change, axes = (
        stretch.rows[0],
        stretch.rows[1],
        stretch.rows[2],
        stretch.change,
        stretch.axes,
    )
    signs = stretch.signs
    write_row(samples.vertices, at_vertices, low, start_row)
    write_row(samples.vertices, at_vertices, high, end_row)
    _write_joint_ranges(samples.vertices, at_vertices, low, high, start_row, end_row, stretch.joint_ranges)
    straight = 1.0 if _is_straight(at_vertices, low, high) else 0.0
    for joint in range(len(signs)):
        signs[joint] = straight if end_row[joint] > start_row[joint] else -straight
    write_row(samples.travelled, at_vertices, low, start_row)
    write_row(samples.travelled, at_vertices, high, end_row)
    write_row(samples.travelled, at_vertices, middle, row)
    for joint in range(len(change)):
        change[joint] = max(row[joint] - start_row[joint], end_row[joint] - row[joint])
    _write_axes(world.tree.axes, stretch.placements, axes)
    parents, prismatic, centres, spheres = world.tree.parents, world.tree.prismatic, stretch.centres, world.spheres
    for body in range(len(body_joints)):
        if body_joints[body] >= 0:
            joint = body_joints[body]
            motion = _motion_of(parents, prismatic, axes, change, signs, centres, spheres, body, joint, -1)
            stretch.motions[body] = motion
            max_motion = max(max_motion, motion if motion < np.inf else 0.0)
    return max_motion


@njit(cache=True, nogil=True)
def _write_axes(directions: Array, placements: Array, out: Array) -> None:
    """Writes a point and the direction of each joint axis."""
    for joint in range(len(out)):
        a, b, c = directions[joint, 0], directions[joint, 1], directions[joint, 2]
        for row in range(3):
            pose = placements[joint, row]
            out[joint, row] = pose[3]
            out[joint, 3 + row] = pose[0] * a + pose[1] * b + pose[2] * c


@njit(cache=True, nogil=True)
def _is_straight(at_vertices: NDArray[np.int64], low: int, high: int) -> bool:
    """Returns whether all samples from `low` to `high` lie on one segment."""
    begin, (end, fraction) = _segment_of(at_vertices, low)[0], _segment_of(at_vertices, high)
    return end == begin or (end == begin + 1 and fraction == 0.0)


@njit(cache=True, nogil=True)
def _motion_of(
    parents: NDArray[np.int64],
    prismatic: NDArray[np.bool_],
    axes: Array,
    change: Array,
    signs: Array,
    centres: Array,
    spheres: Array,
    body: int,
    joint: int,
    until: int,
) -> float:
    """Bounds the motion of any point of a body relative to the joint `until` [m]; other arguments as in Stretch.

    The result is the smaller of two bounds. Let d_j be the maximum motion of joint j, o_j and a_j a point and the
    direction of its axis, c and r the body's bounding sphere, and R_j the maximum distance of the body from the axis,
    including the motion caused by the joints between j and the body.

    - Sum of arc lengths: M = sum d_j R_j.
    - On a straight section, first-order motion plus second-order remainder: |v| + sum d_j (M_j + d_j R_j / 2), where
      M_j is the part of M caused by the joints between j and the body. With the signs of the motions,
      |v| <= |sum d_j a_j x (c - o_j)| + r |sum d_j a_j|, so that opposite rotations cancel.
    """
    moved, remainder = 0.0, 0.0
    vx, vy, vz, wx, wy, wz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    radius, is_straight = spheres[body, 3], True
    while joint != until:
        delta = change[joint]
        if delta > 0.0:
            ax, ay, az = axes[joint, 3], axes[joint, 4], axes[joint, 5]
            signed = delta * signs[joint]
            is_straight = is_straight and signed != 0.0
            if prismatic[joint]:
                moved += delta
                vx, vy, vz = vx + signed * ax, vy + signed * ay, vz + signed * az
            else:
                x, y, z = (
                    centres[body, 0] - axes[joint, 0],
                    centres[body, 1] - axes[joint, 1],
                    centres[body, 2] - axes[joint, 2],
                )
                cx, cy, cz = ay * z - az * y, az * x - ax * z, ax * y - ay * x
                arc = delta * (np.sqrt(cx * cx + cy * cy + cz * cz) + radius + moved)
                remainder += delta * (moved + 0.5 * arc)
                moved += arc
                vx, vy, vz = vx + signed * cx, vy + signed * cy, vz + signed * cz
                wx, wy, wz = wx + signed * ax, wy + signed * ay, wz + signed * az
        joint = parents[joint]
    if not is_straight or moved == np.inf:
        return moved
    speed = np.sqrt(vx * vx + vy * vy + vz * vz) + radius * np.sqrt(wx * wx + wy * wy + wz * wz)
    return min(moved, speed + remainder)


@njit(cache=True, nogil=True)
def _certified_sample(samples: Samples, near: int, far: int, change: Array, rows: Array) -> int:
    """Returns the last sample from `near` towards `far` up to which no joint moves by more than `change`.

    Args:
        samples: Samples of the path.
        near: Sample to start from.
        far: Last candidate.
        change: Maximum motion of each joint, shape (joints,) [rad or m].
        rows: Working memory, shape (2, joints) at least.
    """
    travelled, at_vertices, start_row, row = samples.travelled, samples.at_vertices, rows[0], rows[1]
    write_row(travelled, at_vertices, near, start_row)
    write_row(travelled, at_vertices, far, row)
    if _is_within(row, start_row, change):
        return far
    while abs(far - near) > 1:
        middle = (near + far) // 2
        write_row(travelled, at_vertices, middle, row)
        if _is_within(row, start_row, change):
            near = middle
        else:
            far = middle
    return near


@njit(cache=True, nogil=True)
def _is_within(row: Array, start_row: Array, change: Array) -> bool:
    for joint in range(len(change)):  # noqa: SIM110 - numba compiles no generator
        if abs(row[joint] - start_row[joint]) > change[joint]:
            return False
    return True


@njit(cache=True, nogil=True)
def _table_verdict(
    world: World,
    tables: NDArray[np.int8],
    table_joints: NDArray[np.int64],
    table_of: NDArray[np.int64],
    pair: int,
    joint_ranges: Array,
) -> int:
    verdict = table_verdict(tables, table_of[pair], table_joints, joint_ranges)
    if verdict == UNKNOWN:
        fill_cells(world, pair, joint_ranges)
        verdict = table_verdict(tables, table_of[pair], table_joints, joint_ranges)
    return verdict


@njit(cache=True, nogil=True)
def _with_capacity(rows: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Returns the array, or a larger copy if it has fewer than `count` rows."""
    if count <= len(rows):
        return rows
    larger = np.empty((max(count, 2 * len(rows)), *rows.shape[1:]), rows.dtype)
    larger[: len(rows)] = rows
    return larger


@njit(cache=True, nogil=True)
def check_path(world: World, samples: Samples, first: int, undecided: NDArray[np.int64]) -> tuple[int, int]:
    """Checks the samples of a path; samples within the clearance of an evaluated sample are skipped.

    Args:
        world: Bodies and pairs.
        samples: Samples of the path.
        first: Index of the first checked sample.
        undecided: Filled with rows (sample, pair) that are too close to decide, shape (n, 2).

    Returns:
        TOUCHING and the index of a touching sample; TOO_CLOSE and the number of undecided rows, above n if the rows do
        not fit; or CLEAR and the number of evaluated samples.
    """
    workspace = new_workspace(world)
    result = check_samples(world, borrowed(samples), first, undecided, borrowed(workspace))
    release(workspace)
    return result


@njit(cache=True, nogil=True)
def _move_to_front(order: NDArray[np.int64], pair: int) -> None:
    """Moves a pair to the front of the order, because the pair that touched last often touches next."""
    position = 0
    while order[position] != pair:
        position += 1
    while position > 0:
        order[position] = order[position - 1]
        position -= 1
    order[0] = pair


# The loop over pairs is written inline on single arrays, because a call costs more than most pair checks.
@njit(cache=True, nogil=True)
def check_samples(
    world: World, samples: Samples, first: int, undecided: NDArray[np.int64], workspace: Workspace
) -> tuple[int, int]:
    """Does the same as check_path in given working memory; no array should have an owner (see `borrowed`).

    Args:
        world: Bodies and pairs.
        samples: Samples of the path.
        first: Index of the first checked sample.
        undecided: Filled with rows (sample, pair) that are too close to decide, shape (n, 2).
        workspace: Working memory, see new_workspace.
    """
    stretch, memory, order = workspace
    pairs, margins, spheres, kinds, sizes = world.pairs, world.margins, world.spheres, world.kinds, world.sizes
    tables, table_joints, table_of = world.tables, world.table_joints, world.table_of
    parents, prismatic, body_joints, field = world.tree.parents, world.tree.prismatic, world.joints, world.field
    counts, refusals, represented = world.counts, world.refusals, world.represented
    _, poses, centres, axes, sample_ranges, joint_ranges, change, signs, motions, rows = stretch
    ranges = np.empty((64, 4), np.int64)  # first and last sample, begin and end of their pairs in `active`
    active, used, last = np.empty(4 * len(pairs) + 16, np.int64), len(world.watched), samples.at_vertices[-1]
    active[:used] = order
    ranges[0], ranges[1] = (last, last, 0, used), (first, last - 1, 0, used)
    head, tail, evaluated, undecided_count = 0, 2, 0, 0
    while head < tail:
        low, high, begin, end = ranges[head, 0], ranges[head, 1], ranges[head, 2], ranges[head, 3]
        head += 1
        if low > high:
            continue
        middle, kept, fraction = (low + high) // 2, used, 1.0
        is_long = evaluate_middle(world, samples, low, high, evaluated == 0, stretch) > MAX_MOTION_M
        evaluated += 1
        moves = low < high and not is_long
        active = _with_capacity(active, used + end - begin)
        for index in range(begin, end):
            pair = active[index]
            if table_of[pair] >= 0:
                if moves and _table_verdict(world, tables, table_joints, table_of, pair, joint_ranges) == APART:
                    continue
                if _table_verdict(world, tables, table_joints, table_of, pair, sample_ranges) == APART:
                    if moves:
                        active[kept] = pair
                        kept, fraction = kept + 1, 0.0
                    continue
            body, other, needed = pairs[pair, 0], pairs[pair, 1], 2.0 * ROUNDING
            x, y, z = centres[body, 0], centres[body, 1], centres[body, 2]
            if other == FIELD:
                needed += motions[body] if moves else 0.0
                apart = needed + spheres[body, 3] + margins[pair]
                if field_distance(field, x, y, z, apart) >= apart:
                    continue
            else:
                if moves:
                    common = world.common_joints[pair]
                    if common < 0:
                        needed += motions[body] + motions[other]
                    else:
                        for moved in (body, other):
                            needed += _motion_of(
                                parents,
                                prismatic,
                                axes,
                                change,
                                signs,
                                centres,
                                spheres,
                                moved,
                                body_joints[moved],
                                common,
                            )
                if (
                    centre_distance(centres, body, other) - spheres[body, 3] - spheres[other, 3] - margins[pair]
                    >= needed
                ):
                    continue
                if kinds[other] != SURFACE:
                    gap = placed_solid_distance(solid_of(kinds, sizes, other), poses, other, x, y, z)
                    if gap - spheres[body, 3] - margins[pair] >= needed:
                        continue
            status, bound = pair_bound(world, pair, poses, centres, needed, memory)
            if status == TOUCHING:
                counts[EVALUATED_STATES] += evaluated
                refusals[represented[pair - len(pairs) + len(represented), int(bound)] if other == FIELD else pair] += 1
                _move_to_front(order, pair)
                return TOUCHING, middle
            if status == TOO_CLOSE:
                if undecided_count < len(undecided):
                    undecided[undecided_count] = middle, pair
                undecided_count += 1
            if bound < needed and moves:
                active[kept] = pair
                kept, fraction = kept + 1, min(fraction, bound / needed)
        surrounded = surrounded_pair(world, poses, centres) if len(samples.vertices) == 1 else -1
        if surrounded >= 0:  # only for single states, because a path into a body crosses the surface
            counts[EVALUATED_STATES] += evaluated
            refusals[surrounded] += 1
            return TOUCHING, middle
        if is_long:
            ranges = _with_capacity(ranges, tail + 2)
            ranges[tail], ranges[tail + 1] = (low, middle - 1, begin, end), (middle + 1, high, begin, end)
            tail += 2
        elif kept > used:
            change *= fraction
            ranges = _with_capacity(ranges, tail + 2)
            ranges[tail] = low, _certified_sample(samples, middle, low, change, rows) - 1, used, kept
            ranges[tail + 1] = _certified_sample(samples, middle, high, change, rows) + 1, high, used, kept
            tail, used = tail + 2, kept
    counts[EVALUATED_STATES] += evaluated
    return (TOO_CLOSE, undecided_count) if undecided_count else (CLEAR, evaluated)


@njit(cache=True, nogil=True)
def count_verdict(counts: NDArray[np.int64], status: int) -> None:
    """Counts a check and its status in World.counts."""
    counts[REQUESTED] += 1
    if status == CLEAR:
        counts[FOUND_FREE] += 1
    elif status == TOUCHING:
        counts[FOUND_TOUCHING] += 1


@njit(cache=True, nogil=True)
def check_polyline(
    vertices: Array, step: float, first: int, undecided: NDArray[np.int64], *world: NDArray[Any]
) -> tuple[int, int, NDArray[np.int64]]:
    """Checks a polyline at samples.

    Args:
        vertices: Joint positions of the whole robot, shape (n, joints) [rad or m].
        step: Maximum joint distance between samples [rad or m].
        first: Index of the first checked sample.
        undecided: Filled with rows (sample, pair) that are too close to decide, shape (m, 2).
        *world: Arrays from `compiled_collision.arguments`.

    Returns:
        The status and the number that check_path returns, and the sample index of each vertex, shape (n,).
    """
    samples = sample(vertices, step)
    bodies = world_of(world)
    status, index = check_path(bodies, samples, first, undecided)
    count_verdict(bodies.counts, status)
    return status, index, samples.at_vertices


def sample_at(vertices: Array, at_vertices: NDArray[np.int64], index: int) -> Array:
    """Returns the joint positions at a sample, shape (joints,).

    Args:
        vertices: Joint positions at the vertices, shape (n, joints) [rad or m].
        at_vertices: Sample index of each vertex, shape (n,).
        index: Index of the sample.
    """
    out = np.empty(vertices.shape[1])
    write_row(vertices, at_vertices, index, out)
    return out
