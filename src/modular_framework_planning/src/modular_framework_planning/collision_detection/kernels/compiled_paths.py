# SPDX-License-Identifier: BSD-3-Clause
"""Compiled collision checks of whole paths: the clearance at one state certifies a section of the path.

Two bodies with clearance c at a state cannot collide until they move by c relative to each other. The motion of a body
is bounded by the sum over joints of joint motion times the body's distance from the joint axis. Far from obstacles, a
fine step therefore costs no more than a coarse step: certified samples are skipped.
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
    FOUND_FREE,
    FOUND_TOUCHING,
    REQUESTED,
    UNKNOWN,
    World,
    centre_distance,
    pair_bound,
    place_bodies,
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
    solid_of,
)
from modular_framework_planning.collision_detection.kernels.compiled_tables import fill_cells, table_verdict
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements

INITIAL_UNDECIDED_ROWS = 256
MAX_MOTION_M = 0.2  # a section with a longer body motion is halved before clearances are computed


class Samples(NamedTuple):
    """Samples of a polyline, evenly spaced on each segment and indexed from 0.

    Attributes:
        vertices: Joint positions of the whole robot, shape (n, joints) [rad or m].
        vertex_samples: Sample index of each vertex, shape (n,).
        joint_travel: Distance travelled by each joint up to each vertex, shape (n, joints) [rad or m].
    """

    vertices: Array
    vertex_samples: NDArray[np.int64]
    joint_travel: Array


@njit(cache=True, nogil=True)
def sample(vertices: Array, step: float) -> Samples:
    """Returns samples at most `step` [rad or m] apart in every joint on the polyline `vertices`, shape (n, joints)."""
    samples = Samples(vertices, np.zeros(len(vertices), np.int64), np.zeros(vertices.shape))
    index_samples(samples, step)
    return samples


@njit(cache=True, nogil=True)
def index_samples(samples: Samples, step: float) -> None:
    """Writes the sample index and the joint travel of each vertex; `step` as in `sample`."""
    vertices, vertex_samples, joint_travel = samples
    count, joints = vertices.shape
    vertex_samples[0], joint_travel[0] = 0, 0.0
    for vertex in range(1, count):
        max_change = 0.0
        for joint in range(joints):
            change = abs(vertices[vertex, joint] - vertices[vertex - 1, joint])
            joint_travel[vertex, joint] = joint_travel[vertex - 1, joint] + change
            max_change = max(max_change, change)
        vertex_samples[vertex] = vertex_samples[vertex - 1] + max(1, int(np.ceil(max_change / step)))


@njit(cache=True, nogil=True)
def _segment_of(vertex_samples: NDArray[np.int64], index: int) -> tuple[int, float]:
    """Returns the vertex at or before a sample, and the sample's position on the next segment as a fraction."""
    low, high = 0, len(vertex_samples) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if vertex_samples[middle] <= index:
            low = middle
        else:
            high = middle
    if high == low:
        return 0, 0.0
    return low, (index - vertex_samples[low]) / (vertex_samples[high] - vertex_samples[low])


@njit(cache=True, nogil=True)
def write_row(rows: Array, vertex_samples: NDArray[np.int64], index: int, out: Array) -> None:
    """Interpolates joint values at a sample.

    Args:
        rows: Joint values at each vertex, shape (n, joints).
        vertex_samples: Sample index of each vertex, shape (n,).
        index: Index of the sample.
        out: Written joint values, shape (joints,).
    """
    vertex, fraction = _segment_of(vertex_samples, index)
    for joint in range(rows.shape[1]):
        out[joint] = rows[vertex, joint]
        if fraction > 0.0:
            out[joint] += fraction * (rows[vertex + 1, joint] - rows[vertex, joint])


@njit(cache=True, nogil=True)
def _write_joint_ranges(
    vertices: Array,
    vertex_samples: NDArray[np.int64],
    low: int,
    high: int,
    first: Array,
    last: Array,
    joint_ranges: Array,
) -> None:
    """Writes minimum and maximum joint positions, shape (2, joints), from sample `low` to sample `high`.

    `first` and `last` are the joint positions at these two samples.
    """
    for joint in range(vertices.shape[1]):
        joint_ranges[0, joint], joint_ranges[1, joint] = min(first[joint], last[joint]), max(first[joint], last[joint])
    begin, end = _segment_of(vertex_samples, low)[0] + 1, _segment_of(vertex_samples, high)[0]
    for vertex in range(begin, end + 1):
        for joint in range(vertices.shape[1]):
            joint_ranges[0, joint] = min(joint_ranges[0, joint], vertices[vertex, joint])
            joint_ranges[1, joint] = max(joint_ranges[1, joint], vertices[vertex, joint])


class Section(NamedTuple):
    """State at the middle sample of a section of a path, and motion bounds over the section.

    Attributes:
        placements: Pose of each joint at the sample, shape (joints, 3, 4).
        poses: Pose of each body at the sample, shape (b, 3, 4).
        centres: Centre of each body's bounding sphere at the sample, shape (b, 3) [m].
        axes: Point and direction of each joint axis at the sample, shape (joints, 6).
        sample_ranges: Joint positions at the sample, as minimum and maximum; shape (2, joints) [rad or m].
        joint_ranges: Minimum and maximum joint positions on the section, shape (2, joints) [rad or m].
        joint_motions: Maximum motion of each joint from the sample to either end, shape (joints,) [rad or m].
        signs: Direction of each joint's motion, 1 or -1; all 0 if the section is not straight; shape (joints,).
        body_motions: Maximum motion of any point of each body from the sample to either end, shape (b,) [m].
        rows: Working memory, shape (3, joints).
    """

    placements: Array
    poses: Array
    centres: Array
    axes: Array
    sample_ranges: Array
    joint_ranges: Array
    joint_motions: Array
    signs: Array
    body_motions: Array
    rows: Array


@njit(cache=True, nogil=True)
def _new_section(joints: int, bodies: int) -> Section:
    placements, poses, centres = np.empty((joints, 3, 4)), np.empty((bodies, 3, 4)), np.empty((bodies, 3))
    axes, sample_ranges, joint_ranges = np.empty((joints, 6)), np.empty((2, joints)), np.empty((2, joints))
    joint_motions, signs, body_motions = np.empty(joints), np.empty(joints), np.zeros(bodies)
    rows = np.empty((3, joints))
    return Section(
        placements, poses, centres, axes, sample_ranges, joint_ranges, joint_motions, signs, body_motions, rows
    )


class Workspace(NamedTuple):
    """Working memory of a path check.

    Attributes:
        section: State and motion bounds of the current section.
        memory: Working memory of a pair check.
        order: Pairs, the most recently touching pair first.
    """

    section: Section
    memory: Memory
    order: NDArray[np.int64]


@njit(cache=True, nogil=True)
def new_workspace(world: World) -> Workspace:
    """Returns working memory for path checks in a world."""
    joints, bodies = len(world.tree.parents), len(world.joints)
    return Workspace(_new_section(joints, bodies), new_memory(), np.arange(len(world.pairs)))


@njit(cache=True, nogil=True)
def release(workspace: Workspace, samples: Samples) -> None:
    """Keeps working memory alive up to this call, because borrowed arrays do not."""
    workspace.section.body_motions[:], workspace.memory.bounds[0], samples.vertex_samples[0] = 0.0, 0.0, 0


@njit(cache=True, nogil=True)
def evaluate_middle(world: World, samples: Samples, low: int, high: int, is_first: bool, section: Section) -> float:
    """Places the bodies at the middle sample of a section and bounds their motion to both ends.

    Args:
        world: Bodies and pairs.
        samples: Samples of the path.
        low: First sample of the section.
        high: Last sample of the section.
        is_first: Whether no sample was evaluated before; only then are the bodies of the world placed.
        section: Written state; the motion bounds are written only if `low` and `high` differ.

    Returns:
        Maximum motion over all bounded bodies [m], 0 if `low` and `high` are equal.
    """
    vertex_samples, middle, sample_ranges = samples.vertex_samples, (low + high) // 2, section.sample_ranges
    write_row(samples.vertices, vertex_samples, middle, sample_ranges[0])
    sample_ranges[1] = sample_ranges[0]
    joint_placements(world.tree, sample_ranges[0], section.placements)
    place_bodies(world, section.placements, section.poses, section.centres, is_first)
    max_motion = 0.0
    if low == high:
        return max_motion
    start_row, end_row, row = section.rows[0], section.rows[1], section.rows[2]
    joint_motions, signs, axes = section.joint_motions, section.signs, section.axes
    write_row(samples.vertices, vertex_samples, low, start_row)
    write_row(samples.vertices, vertex_samples, high, end_row)
    _write_joint_ranges(samples.vertices, vertex_samples, low, high, start_row, end_row, section.joint_ranges)
    straight = 1.0 if _is_straight(vertex_samples, low, high) else 0.0
    for joint in range(len(signs)):
        signs[joint] = straight if end_row[joint] > start_row[joint] else -straight
    write_row(samples.joint_travel, vertex_samples, low, start_row)
    write_row(samples.joint_travel, vertex_samples, high, end_row)
    write_row(samples.joint_travel, vertex_samples, middle, row)
    for joint in range(len(joint_motions)):
        joint_motions[joint] = max(row[joint] - start_row[joint], end_row[joint] - row[joint])
    _write_axes(world.tree.axes, section.placements, axes)
    parents, prismatic, centres, spheres = world.tree.parents, world.tree.prismatic, section.centres, world.spheres
    for body in range(len(world.joints)):
        joint = world.joints[body]
        if joint >= 0:
            motion = _max_motion(parents, prismatic, axes, joint_motions, signs, centres, spheres, body, joint, -1)
            section.body_motions[body] = motion
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
def _is_straight(vertex_samples: NDArray[np.int64], low: int, high: int) -> bool:
    """Returns whether all samples from `low` to `high` lie on one segment."""
    begin, (end, fraction) = _segment_of(vertex_samples, low)[0], _segment_of(vertex_samples, high)
    return end == begin or (end == begin + 1 and fraction == 0.0)


@njit(cache=True, nogil=True)
def _max_motion(
    parents: NDArray[np.int64],
    prismatic: NDArray[np.bool_],
    axes: Array,
    joint_motions: Array,
    signs: Array,
    centres: Array,
    spheres: Array,
    body: int,
    joint: int,
    base_joint: int,
) -> float:
    """Returns an upper bound of the motion of any point of a body relative to the joint `base_joint` [m].

    The arrays are the arrays of Section, Tree and World; `joint` is the joint that moves the body. The result is the
    smaller of two bounds. Let d_j be the maximum motion of joint j, o_j and a_j a point and the direction of its axis,
    c and r the body's bounding sphere, and R_j the maximum distance of the body from the axis, including the motion
    caused by the joints between j and the body.

    - Sum of arc lengths: M = sum d_j R_j.
    - On a straight section, first-order motion plus second-order remainder: |v| + sum d_j (M_j + d_j R_j / 2), where
      M_j is the part of M caused by the joints between j and the body. With the signs of the motions,
      |v| <= |sum d_j a_j x (c - o_j)| + r |sum d_j a_j|, so that opposite rotations cancel.
    """
    motion, remainder = 0.0, 0.0
    vx, vy, vz, wx, wy, wz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    radius, is_straight = spheres[body, 3], True
    while joint != base_joint:
        delta = joint_motions[joint]
        if delta > 0.0:
            ax, ay, az = axes[joint, 3], axes[joint, 4], axes[joint, 5]
            signed = delta * signs[joint]
            is_straight = is_straight and signed != 0.0
            if prismatic[joint]:
                motion += delta
                vx, vy, vz = vx + signed * ax, vy + signed * ay, vz + signed * az
            else:
                x, y = centres[body, 0] - axes[joint, 0], centres[body, 1] - axes[joint, 1]
                z = centres[body, 2] - axes[joint, 2]
                cx, cy, cz = ay * z - az * y, az * x - ax * z, ax * y - ay * x
                arc = delta * (np.sqrt(cx * cx + cy * cy + cz * cz) + radius + motion)
                remainder += delta * (motion + 0.5 * arc)
                motion += arc
                vx, vy, vz = vx + signed * cx, vy + signed * cy, vz + signed * cz
                wx, wy, wz = wx + signed * ax, wy + signed * ay, wz + signed * az
        joint = parents[joint]
    if not is_straight or motion == np.inf:
        return motion
    first_order = np.sqrt(vx * vx + vy * vy + vz * vz) + radius * np.sqrt(wx * wx + wy * wy + wz * wz)
    return min(motion, first_order + remainder)


@njit(cache=True, nogil=True)
def _certified_sample(samples: Samples, near: int, far: int, max_motions: Array, rows: Array) -> int:
    """Returns the last sample from `near` towards `far` up to which no joint moves by more than `max_motions`.

    Args:
        samples: Samples of the path.
        near: Sample to start from.
        far: Last candidate.
        max_motions: Maximum motion of each joint, shape (joints,) [rad or m].
        rows: Working memory, shape (2, joints) at least.
    """
    joint_travel, vertex_samples, start_row, row = samples.joint_travel, samples.vertex_samples, rows[0], rows[1]
    write_row(joint_travel, vertex_samples, near, start_row)
    write_row(joint_travel, vertex_samples, far, row)
    if _is_within(row, start_row, max_motions):
        return far
    while abs(far - near) > 1:
        middle = (near + far) // 2
        write_row(joint_travel, vertex_samples, middle, row)
        if _is_within(row, start_row, max_motions):
            near = middle
        else:
            far = middle
    return near


@njit(cache=True, nogil=True)
def _is_within(row: Array, start_row: Array, max_motions: Array) -> bool:
    for joint in range(len(max_motions)):  # noqa: SIM110 - numba compiles no generator
        if abs(row[joint] - start_row[joint]) > max_motions[joint]:
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
    """Returns the `table_verdict` of a pair after filling unknown cells."""
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
    """Checks the samples of a path; samples certified by the clearance at another sample are skipped.

    Args:
        world: Bodies and pairs.
        samples: Samples of the path.
        first: Index of the first checked sample.
        undecided: Written rows (sample, pair) of pairs that are too close to decide, shape (n, 2).

    Returns:
        TOUCHING and the index of a touching sample; TOO_CLOSE and the number of undecided rows, above n if the rows do
        not fit; or CLEAR and the number of evaluated samples.
    """
    workspace = new_workspace(world)
    result = check_samples(world, borrowed(samples), first, undecided, borrowed(workspace))
    release(workspace, samples)
    return result


@njit(cache=True, nogil=True)
def _move_to_front(order: NDArray[np.int64], pair: int) -> None:
    """Moves a pair to the front of the order, because this pair often touches again in the next check."""
    position = 0
    while order[position] != pair:
        position += 1
    while position > 0:
        order[position] = order[position - 1]
        position -= 1
    order[0] = pair


# The loop over pairs is inline and uses single arrays, because a call costs more than most pair checks.
@njit(cache=True, nogil=True)
def check_samples(
    world: World, samples: Samples, first: int, undecided: NDArray[np.int64], workspace: Workspace
) -> tuple[int, int]:
    """Implements check_path with given working memory and borrowed arrays.

    A queue holds sections of the path, each with the pairs that are not certified on the whole section. Each section is
    evaluated at its middle sample. The parts before and after the certified samples join the queue.

    Args:
        world: Bodies and pairs, borrowed.
        samples: Samples of the path, borrowed.
        first: Index of the first checked sample.
        undecided: Written rows (sample, pair) of pairs that are too close to decide, shape (n, 2).
        workspace: Working memory from `new_workspace`, borrowed.
    """
    section, memory, order = workspace
    pairs, margins, spheres, kinds, sizes = world.pairs, world.margins, world.spheres, world.kinds, world.sizes
    tables, table_joints, table_of = world.tables, world.table_joints, world.table_of
    parents, prismatic, body_joints = world.tree.parents, world.tree.prismatic, world.joints
    counts, refusals = world.counts, world.refusals
    _, poses, centres, axes, sample_ranges, joint_ranges, joint_motions, signs, body_motions, rows = section
    queue = np.empty((64, 4), np.int64)  # first and last sample, begin and end of their pairs in `queued_pairs`
    queued_pairs, used, last = np.empty(4 * len(pairs) + 16, np.int64), len(pairs), samples.vertex_samples[-1]
    queued_pairs[:used] = order
    queue[0], queue[1] = (last, last, 0, used), (first, last - 1, 0, used)
    head, tail, evaluated, undecided_count = 0, 2, 0, 0
    while head < tail:
        low, high, begin, end = queue[head, 0], queue[head, 1], queue[head, 2], queue[head, 3]
        head += 1
        if low > high:
            continue
        middle, kept, fraction = (low + high) // 2, used, 1.0
        is_long = evaluate_middle(world, samples, low, high, evaluated == 0, section) > MAX_MOTION_M
        evaluated += 1
        certifies = low < high and not is_long  # otherwise only the middle sample is checked
        queued_pairs = _with_capacity(queued_pairs, used + end - begin)
        for index in range(begin, end):
            pair = queued_pairs[index]
            if table_of[pair] >= 0:
                if certifies and _table_verdict(world, tables, table_joints, table_of, pair, joint_ranges) == APART:
                    continue
                if _table_verdict(world, tables, table_joints, table_of, pair, sample_ranges) == APART:
                    if certifies:
                        queued_pairs[kept] = pair
                        kept, fraction = kept + 1, 0.0
                    continue
            body, other, needed = pairs[pair, 0], pairs[pair, 1], 2.0 * ROUNDING
            x, y, z = centres[body, 0], centres[body, 1], centres[body, 2]
            base = world.common_joints[pair]
            if certifies and base < 0:
                needed += body_motions[body] + body_motions[other]
            elif certifies:
                for moving_body in (body, other):
                    joint = body_joints[moving_body]
                    needed += _max_motion(
                        parents, prismatic, axes, joint_motions, signs, centres, spheres, moving_body, joint, base
                    )
            gap = centre_distance(centres, body, other) - spheres[body, 3] - spheres[other, 3] - margins[pair]
            if gap >= needed:
                continue
            if kinds[other] != SURFACE:
                distance = placed_solid_distance(solid_of(kinds, sizes, other), poses, other, x, y, z)
                if distance - spheres[body, 3] - margins[pair] >= needed:
                    continue
            status, bound = pair_bound(world, pair, poses, centres, needed, memory)
            if status == TOUCHING:
                counts[EVALUATED_STATES] += evaluated
                refusals[pair] += 1
                _move_to_front(order, pair)
                return TOUCHING, middle
            if status == TOO_CLOSE:
                if undecided_count < len(undecided):
                    undecided[undecided_count] = middle, pair
                undecided_count += 1
            if bound < needed and certifies:
                queued_pairs[kept] = pair
                kept, fraction = kept + 1, min(fraction, bound / needed)
        surrounded = surrounded_pair(world, poses, centres) if len(samples.vertices) == 1 else -1
        if surrounded >= 0:  # checked only for single states, because a path into a body crosses its surface
            counts[EVALUATED_STATES] += evaluated
            refusals[surrounded] += 1
            return TOUCHING, middle
        if is_long:
            queue = _with_capacity(queue, tail + 2)
            queue[tail], queue[tail + 1] = (low, middle - 1, begin, end), (middle + 1, high, begin, end)
            tail += 2
        elif kept > used:
            joint_motions *= fraction
            queue = _with_capacity(queue, tail + 2)
            queue[tail] = low, _certified_sample(samples, middle, low, joint_motions, rows) - 1, used, kept
            queue[tail + 1] = _certified_sample(samples, middle, high, joint_motions, rows) + 1, high, used, kept
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
        undecided: Written rows (sample, pair) of pairs that are too close to decide, shape (m, 2).
        *world: Arrays from `compiled_collision.arguments`.

    Returns:
        The two results of `check_path`, and the sample index of each vertex, shape (n,).
    """
    samples = sample(vertices, step)
    bodies = world_of(world)
    status, index = check_path(bodies, samples, first, undecided)
    count_verdict(bodies.counts, status)
    return status, index, samples.vertex_samples


def sample_at(vertices: Array, vertex_samples: NDArray[np.int64], index: int) -> Array:
    """Returns the joint positions at a sample, shape (joints,).

    Args:
        vertices: Joint positions at the vertices, shape (n, joints) [rad or m].
        vertex_samples: Sample index of each vertex, shape (n,).
        index: Index of the sample.
    """
    out = np.empty(vertices.shape[1])
    write_row(vertices, vertex_samples, index, out)
    return out
