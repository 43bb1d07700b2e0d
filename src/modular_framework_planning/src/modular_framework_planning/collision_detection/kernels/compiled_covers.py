# SPDX-License-Identifier: BSD-3-Clause
"""Checks pairs of bodies along a straight motion with spheres, at several samples at once, compiled.

As in Thomason, Kingston, Kavraki: Motions in microseconds via vectorized sampling-based planning, ICRA 2024, a loop
over samples is innermost, so that a processor works on some of them in one instruction. Unlike there, the spheres are
certain: those around a body say that it is free, balls inside of it that it touches; what is nearer is left open.

Between two samples a distance is bounded by its curvature. Let u be the shortest vector from a sphere's centre to
another centre or to a solid, which changes by at most V from one sample to the next and whose rate of change by at most
A. If it were shorter than r somewhere between two samples, it would be shorter than r + V everywhere between them. The
second derivative of its squared length is then at most 2 V^2 + 2 (r + V) A (also of a distance from a fixed set: its
square is the least of many such squares), and at that place the squared length is at most (V^2 + (r + V) A) / 4 less
than at one of the samples. So it stays above r where its square is at least r^2 + (V^2 + (r + V) A) / 4 at all samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    APART,
    FIELD,
    UNKNOWN,
    solid_of,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import (
    BOX,
    CYLINDER,
    ROUNDING,
    SURFACE,
    placed_solid_distance,
)
from modular_framework_planning.collision_detection.kernels.compiled_tables import fill_line, line_answer
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements

LANES = 8  # samples that are looked at together
MIDDLE = LANES // 2  # one of them
MOST_TURN = 1.5  # [rad]; of all joints together between two of them; on longer motions spheres decide next to nothing
BALL_SLACK = 1.0e-4  # [m]; how far a ball has to reach into a solid
MOST_SOLIDS = 64  # of the world; among more, spheres are not asked, as each would be held against all of them
MOST_LOOKS = 64  # at two spheres, for one pair of bodies


class Nodes(NamedTuple):
    """The spheres of the bodies at the samples that are looked at together.

    Attributes:
        joints: that move the bodies, shape (b,).
        spheres: see Covers; shape (b, nodes, 4).
        moves: whether each joint moves in the planning frame; shape (joints,).
        still: poses of the joints at the first sample, shape (joints, 3, 4).
        placements: poses of the joints that move, shape (joints, 12, LANES).
        placed: whether the centre of a sphere is known, shape (b, nodes).
        centres: of the spheres in the planning frame, shape (b, nodes, 3, LANES).
    """

    joints: NDArray[np.int64]
    spheres: Array
    moves: NDArray[np.bool_]
    still: Array
    placements: Array
    placed: NDArray[np.bool_]
    centres: Array


class Batch(NamedTuple):
    """Working memory of the check of a motion.

    Attributes:
        nodes: the spheres.
        numbers: of the samples; shape (LANES,).
        turns: sine and cosine of a joint, or how far it slides; shape (2, LANES).
        speeds, bends: V and A of each body in the frame of each joint, that of the planning frame first; shape
            (b, 1 + joints).
        squares: of distances, shape (LANES,).
        waiting: spheres of two bodies that are still to look at, shape (MOST_LOOKS + 2, 2).
        pairs: that are left open, shape (p,).
    """

    nodes: Nodes
    numbers: NDArray[np.int64]
    turns: Array
    speeds: Array
    bends: Array
    squares: Array
    waiting: NDArray[np.int64]
    pairs: NDArray[np.int64]


@njit(cache=True, nogil=True)
def new_batch(world, is_used):  # type: ignore[no-untyped-def]
    """Returns working memory; empty where it is not used."""
    joints, spheres = len(world.tree.parents), world.covers.spheres
    bodies, nodes = spheres.shape[:2]
    if nodes == 0 or not is_used:
        joints, bodies, nodes = 0, 0, 0
    moves, still, placements = np.empty(joints, np.bool_), np.empty((joints, 3, 4)), np.empty((joints, 12, LANES))
    placed, centres = np.empty((bodies, nodes), np.bool_), np.empty((bodies, nodes, 3, LANES))
    return Batch(
        Nodes(world.joints, spheres, moves, still, placements, placed, centres),
        np.empty(LANES, np.int64),
        np.empty((2, LANES)),
        np.empty((bodies, 1 + joints)),
        np.empty((bodies, 1 + joints)),
        np.empty(LANES),
        np.empty((MOST_LOOKS + 2, 2), np.int64),
        np.empty(len(world.watched), np.int64),
    )


@njit(cache=True, nogil=True)
def _place_joints(tree, first, last, count, nodes, numbers, turns):  # type: ignore[no-untyped-def]
    """Computes the poses of the joints at samples of the motion between two positions (all,), `count` steps long."""
    parents, at, axes, prismatic = tree.parents, tree.placements, tree.axes, tree.prismatic
    moves, still, placements = nodes.moves, nodes.still, nodes.placements
    sine, cosine = turns[0], turns[1]
    joint_placements(tree, first, still)
    least, longer = count // (LANES - 1), count % (LANES - 1)
    for lane in range(LANES):
        numbers[lane] = lane * least + min(lane, longer)
    for joint in range(len(parents)):
        parent = parents[joint]
        hangs_on_moving = parent >= 0 and moves[parent]
        moves[joint] = hangs_on_moving or first[joint] != last[joint]
        if not moves[joint]:
            continue
        out, here = placements[joint], at[joint]
        for row in range(3):
            if hangs_on_moving:
                base = placements[parent]
                for column in range(4):
                    a, b, c = here[0, column], here[1, column], here[2, column]
                    for lane in range(LANES):
                        out[4 * row + column, lane] = (
                            base[4 * row, lane] * a + base[4 * row + 1, lane] * b + base[4 * row + 2, lane] * c
                        )
                for lane in range(LANES):
                    out[4 * row + 3, lane] += base[4 * row + 3, lane]
            else:
                for column in range(4):
                    value = here[row, column]
                    if parent >= 0:
                        value = still[parent, row, 3] if column == 3 else 0.0
                        for inner in range(3):
                            value += still[parent, row, inner] * here[inner, column]
                    for lane in range(LANES):
                        out[4 * row + column, lane] = value
        x, y, z, step = axes[joint, 0], axes[joint, 1], axes[joint, 2], (last[joint] - first[joint]) / count
        if prismatic[joint]:
            for lane in range(LANES):
                sine[lane] = first[joint] + step * numbers[lane]
            for row in range(3):
                for lane in range(LANES):
                    out[4 * row + 3, lane] += sine[lane] * (
                        out[4 * row, lane] * x + out[4 * row + 1, lane] * y + out[4 * row + 2, lane] * z
                    )
            continue
        sine[0], cosine[0] = np.sin(first[joint]), np.cos(first[joint])
        short_sine, short_cosine = np.sin(least * step), np.cos(least * step)
        long_sine, long_cosine = np.sin((least + 1) * step), np.cos((least + 1) * step)
        for lane in range(LANES - 1):
            s, c = (long_sine, long_cosine) if lane < longer else (short_sine, short_cosine)
            sine[lane + 1] = sine[lane] * c + cosine[lane] * s
            cosine[lane + 1] = cosine[lane] * c - sine[lane] * s
        for row in range(3):  # each row of the rotation, turned about the axis (Rodrigues)
            for lane in range(LANES):
                a, b, c = out[4 * row, lane], out[4 * row + 1, lane], out[4 * row + 2, lane]
                along = (a * x + b * y + c * z) * (1.0 - cosine[lane])
                out[4 * row, lane] = a * cosine[lane] + along * x + sine[lane] * (b * z - c * y)
                out[4 * row + 1, lane] = b * cosine[lane] + along * y + sine[lane] * (c * x - a * z)
                out[4 * row + 2, lane] = c * cosine[lane] + along * z + sine[lane] * (a * y - b * x)


@njit(cache=True, nogil=True)
def _bound_motions(tree, joints, extents, lengths, first, last, share, speeds, bends):  # type: ignore[no-untyped-def]
    """Writes `speeds` and `bends`, for a motion of which two samples are at most `share` apart.

    A point that joint j turns by d_j, at most R_j away from its axis, goes at most sum d_j R_j. A is at most
    sum d_j (d_j R_j + 2 M_j), where M_j is the part of the first sum that the joints between j and the point make.
    """
    parents, prismatic = tree.parents, tree.prismatic
    for body in range(len(joints)):
        joint, reach, speed, bend = joints[body], extents[body], 0.0, 0.0
        while joint >= 0:
            speeds[body, 1 + joint], bends[body, 1 + joint] = speed, bend
            step = share * abs(last[joint] - first[joint])
            reach_here = reach
            reach += lengths[joint]
            if prismatic[joint]:
                speed += step
                reach += max(abs(first[joint]), abs(last[joint]))
            elif step > 0.0:
                bend += step * (step * reach_here + 2.0 * speed)
                speed += step * reach_here
            joint = parents[joint]
        speeds[body, 0], bends[body, 0] = speed, bend


@njit(cache=True, nogil=True)
def _place_node(nodes, body, node):  # type: ignore[no-untyped-def]
    """Computes where the centre of a sphere is at the samples, if that is not known."""
    joints, spheres, moves, still, placements, placed, centres = nodes
    if placed[body, node]:
        return
    placed[body, node] = True
    joint = joints[body]
    x, y, z = spheres[body, node, 0], spheres[body, node, 1], spheres[body, node, 2]
    for row in range(3):
        if moves[joint]:
            for lane in range(LANES):
                centres[body, node, row, lane] = (
                    placements[joint, 4 * row, lane] * x
                    + placements[joint, 4 * row + 1, lane] * y
                    + placements[joint, 4 * row + 2, lane] * z
                    + placements[joint, 4 * row + 3, lane]
                )
        else:
            value = (
                still[joint, row, 0] * x + still[joint, row, 1] * y + still[joint, row, 2] * z + still[joint, row, 3]
            )
            for lane in range(LANES):
                centres[body, node, row, lane] = value


@njit(cache=True, nogil=True, inline="always")
def _needed_square(radius, speed, bend):  # type: ignore[no-untyped-def]
    """Returns the square of the distance at two samples between which it stays above `radius`."""
    return radius * radius + 0.25 * (speed * speed + (radius + speed) * bend)


@njit(cache=True, nogil=True)
def _speed_of(centre, bend):  # type: ignore[no-untyped-def]
    """Bounds how far a centre (3, LANES) goes between two samples."""
    longest = 0.0
    for lane in range(LANES - 1):
        x, y, z = (
            centre[0, lane + 1] - centre[0, lane],
            centre[1, lane + 1] - centre[1, lane],
            centre[2, lane + 1] - centre[2, lane],
        )
        longest = max(longest, x * x + y * y + z * z)
    return np.sqrt(longest) + 0.5 * bend


@njit(cache=True, nogil=True)
def _write_squares(solid, poses, number, centre, out):  # type: ignore[no-untyped-def]
    """Writes the squared distances (LANES,) of a centre (3, LANES) from a solid, whose pose is one of (n, 3, 4)."""
    kind, p0, p1, p2 = solid
    pose = poses[number]
    if kind == BOX:
        for lane in range(LANES):
            x, y, z = centre[0, lane] - pose[0, 3], centre[1, lane] - pose[1, 3], centre[2, lane] - pose[2, 3]
            u = max(abs(pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z) - p0, 0.0)
            v = max(abs(pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z) - p1, 0.0)
            w = max(abs(pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z) - p2, 0.0)
            out[lane] = u * u + v * v + w * w
    elif kind == CYLINDER:
        for lane in range(LANES):
            x, y, z = centre[0, lane] - pose[0, 3], centre[1, lane] - pose[1, 3], centre[2, lane] - pose[2, 3]
            u = pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z
            v = pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z
            w = max(abs(pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z) - p1, 0.0)
            around = max(np.sqrt(u * u + v * v) - p0, 0.0)
            out[lane] = around * around + w * w
    else:
        for lane in range(LANES):
            distance = placed_solid_distance(solid, poses, number, centre[0, lane], centre[1, lane], centre[2, lane])
            out[lane] = max(distance, 0.0) ** 2


@njit(cache=True, nogil=True)
def _stays_outside(nodes, squares, waiting, body, bend, solid, poses, number, margin):  # type: ignore[no-untyped-def]
    """Whether spheres show that a body stays apart from a solid that stands still.

    Args:
        nodes: the spheres.
        squares: working memory, see Batch.
        waiting: the same.
        body: number of the body.
        bend: A of the body, see above.
        solid: the closed form.
        poses: in the planning frame, shape (n, 3, 4).
        number: of the solid's pose.
        margin: distance to keep [m].
    """
    spheres, centres, depth = nodes.spheres, nodes.centres, 1
    waiting[0, 0] = 0
    while depth > 0:
        depth -= 1
        node = waiting[depth, 0]
        _place_node(nodes, body, node)
        centre = centres[body, node]
        _write_squares(solid, poses, number, centre, squares)
        least = _needed_square(spheres[body, node, 3] + margin, _speed_of(centre, bend), bend)
        near = 0
        for lane in range(LANES):
            near += not squares[lane] >= least
        if near == 0:
            continue
        child = 2 * node + 1
        if child >= spheres.shape[1] or spheres[body, child, 3] < 0.0:
            return False
        waiting[depth, 0], waiting[depth + 1, 0] = child, child + 1
        depth += 2
    return True


@njit(cache=True, nogil=True)
def _stays_apart(nodes, waiting, one, two, margin, speed, bend, surface, root, pose):  # type: ignore[no-untyped-def]
    """Whether spheres show that two bodies stay apart.

    Args:
        nodes: the spheres.
        waiting: working memory, see Batch.
        one: number of a body that moves.
        two: number of the other one.
        margin: distance to keep [m].
        speed: V, see above.
        bend: A.
        surface: holds that of the other body, if this one stands still.
        root: of its tree, -1 where the body moves.
        pose: of the surface in the planning frame, shape (3, 4).
    """
    spheres, centres, balls, links = nodes.spheres, nodes.centres, surface.spheres, surface.links
    most, depth, looks, is_still, a, b, c = spheres.shape[1], 1, 0, root >= 0, 0.0, 0.0, 0.0
    waiting[0, 0], waiting[0, 1] = 0, max(root, 0)
    while depth > 0:
        depth -= 1
        looks += 1
        node, other = waiting[depth, 0], waiting[depth, 1]
        _place_node(nodes, one, node)
        centre, radius, near = centres[one, node], spheres[one, node, 3], 0
        if is_still:
            radius_there = balls[other, 3]
            least = _needed_square(radius + radius_there + margin, speed, bend)
            x, y, z = balls[other, 0], balls[other, 1], balls[other, 2]
            a = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]
            b = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]
            c = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
            for lane in range(LANES):
                x, y, z = centre[0, lane] - a, centre[1, lane] - b, centre[2, lane] - c
                near += not x * x + y * y + z * z >= least
        else:
            _place_node(nodes, two, other)
            partner, radius_there = centres[two, other], spheres[two, other, 3]
            least = _needed_square(radius + radius_there + margin, speed, bend)
            for lane in range(LANES):
                x, y, z = (
                    centre[0, lane] - partner[0, lane],
                    centre[1, lane] - partner[1, lane],
                    centre[2, lane] - partner[2, lane],
                )
                near += not x * x + y * y + z * z >= least
        if near == 0:
            continue
        if looks > MOST_LOOKS:
            return False
        child, left, right = 2 * node + 1, 2 * other + 1, 2 * other + 2
        splits, splits_there = child < most and spheres[one, child, 3] >= 0.0, False
        if is_still:
            left, right = links[other, 0], links[other, 1]
            splits_there = left >= 0
        else:
            splits_there = left < most and spheres[two, left, 3] >= 0.0
        if splits and (radius >= radius_there or not splits_there):
            waiting[depth, 0], waiting[depth, 1] = child, other
            waiting[depth + 1, 0], waiting[depth + 1, 1] = child + 1, other
        elif splits_there:
            waiting[depth, 0], waiting[depth, 1] = node, left
            waiting[depth + 1, 0], waiting[depth + 1, 1] = node, right
        else:
            return False
        depth += 2
    return True


# As in check_samples, what decides most pairs stands in the loop, on single arrays.
@njit(cache=True, nogil=True)
def find_open_pairs(world, positions, count, batch):  # type: ignore[no-untyped-def]
    """Finds the watched pairs that spheres do not show to be free all along a straight motion.

    Args:
        world: what to check in; with covers.
        positions: at the start and at the end, of the whole robot, shape (2, joints).
        count: steps of the motion: its samples are one step apart.
        batch: working memory; the pairs that are left open are written to it.

    Returns:
        How many pairs are left open.
    """
    pairs, joints, kinds, sizes, poses = world.pairs, world.joints, world.kinds, world.sizes, world.poses
    margins, watched = world.margins, world.watched
    tables, table_joints, table_of = world.tables, world.table_joints, world.table_of
    prismatic, left = world.tree.prismatic, 0
    begin, end = positions[0], positions[1]
    share, turn = np.ceil(count / (LANES - 1)) / count, 0.0
    for joint in range(len(begin)):
        if not prismatic[joint]:
            turn += share * abs(end[joint] - begin[joint])
    if not turn <= MOST_TURN:
        batch.pairs[:] = watched
        return len(watched)
    nodes, numbers, turns, speeds, bends, squares, waiting, out = batch
    _place_joints(world.tree, begin, end, count, nodes, numbers, turns)
    _bound_motions(world.tree, joints, world.covers.extents, world.covers.lengths, begin, end, share, speeds, bends)
    centres = nodes.centres
    meets, spheres, boxes = world.covers.meets, world.covers.spheres, world.covers.boxes
    field_kinds, field_sizes, field_poses = world.field.kinds, world.field.sizes, world.field.poses
    nodes.placed[:] = False
    for body in range(len(joints)):
        if joints[body] >= 0:
            _place_node(nodes, body, 0)
    for index in range(len(watched)):
        pair = watched[index]
        one, two, margin, is_open = pairs[pair, 0], pairs[pair, 1], margins[pair] + 2.0 * ROUNDING, False
        if table_of[pair] >= 0:
            answer = line_answer(tables, table_of[pair], table_joints, begin, end)
            if answer == UNKNOWN:
                fill_line(world, pair, begin, end)
                answer = line_answer(tables, table_of[pair], table_joints, begin, end)
            is_open = answer != APART
        elif two == FIELD:
            radius, bend = spheres[one, 0, 3] + margin, bends[one, 0]
            around = np.sqrt(_needed_square(radius, _speed_of(centres[one, 0], bend), bend))
            x0, x1 = _extent(centres[one, 0, 0], around)
            y0, y1 = _extent(centres[one, 0, 1], around)
            z0, z1 = _extent(centres[one, 0, 2], around)
            for number in range(len(boxes)):
                if (
                    x0 > boxes[number, 3]
                    or x1 < boxes[number, 0]
                    or y0 > boxes[number, 4]
                    or y1 < boxes[number, 1]
                    or z0 > boxes[number, 5]
                    or z1 < boxes[number, 2]
                ):
                    continue
                solid = solid_of(field_kinds, field_sizes, number)
                if not _stays_outside(nodes, squares, waiting, one, bend, solid, field_poses, number, margin):
                    is_open = True
                    break
        else:
            if joints[one] < 0:
                one, two = two, one
            if joints[two] >= 0:
                at = 1 + meets[pair]
                speed, bend, near = speeds[one, at] + speeds[two, at], bends[one, at] + bends[two, at], 0
                radius = spheres[one, 0, 3] + spheres[two, 0, 3] + margin
                far = radius + (LANES - MIDDLE) * speed
                x, y, z = (
                    centres[one, 0, 0, MIDDLE] - centres[two, 0, 0, MIDDLE],
                    centres[one, 0, 1, MIDDLE] - centres[two, 0, 1, MIDDLE],
                    centres[one, 0, 2, MIDDLE] - centres[two, 0, 2, MIDDLE],
                )
                if x * x + y * y + z * z >= far * far:
                    continue
                least = _needed_square(radius, speed, bend)
                for lane in range(LANES):
                    x, y, z = (
                        centres[one, 0, 0, lane] - centres[two, 0, 0, lane],
                        centres[one, 0, 1, lane] - centres[two, 0, 1, lane],
                        centres[one, 0, 2, lane] - centres[two, 0, 2, lane],
                    )
                    near += not x * x + y * y + z * z >= least
                is_open = near > 0 and not _stays_apart(
                    nodes, waiting, one, two, margin, speed, bend, world.robot, -1, poses[two]
                )
            elif kinds[two] == SURFACE:
                surface = world.scene if world.is_environment[two] else world.robot
                is_open = not _stays_apart(
                    nodes,
                    waiting,
                    one,
                    two,
                    margin,
                    speeds[one, 0],
                    bends[one, 0],
                    surface,
                    world.roots[two],
                    poses[two],
                )
            else:
                bend, solid = bends[one, 0], solid_of(kinds, sizes, two)
                is_open = not _stays_outside(nodes, squares, waiting, one, bend, solid, poses, two, margin)
        if is_open:
            out[left] = pair
            left += 1
    return left


@njit(cache=True, nogil=True)
def _extent(values, around):  # type: ignore[no-untyped-def]
    """Returns the least and the largest value, `around` further apart at both ends."""
    least, largest = values[0], values[0]
    for lane in range(1, LANES):
        least, largest = min(least, values[lane]), max(largest, values[lane])
    return least - around, largest + around


@njit(cache=True, nogil=True)
def find_touching_pair(world, order, placements):  # type: ignore[no-untyped-def]
    """Finds a body and a solid of the field of which balls inside of the body show that they touch.

    A solid that reaches into a ball and is too large to lie in the body crosses its surface.

    Args:
        world: what to check.
        order: of the pairs.
        placements: poses of the joints, shape (joints, 3, 4).

    Returns:
        (pair with FIELD, number of the solid), or (-1, 0).
    """
    pairs, joints, spheres, excess = world.pairs, world.joints, world.spheres, world.excess
    balls, boxes = world.covers.balls, world.covers.boxes
    kinds, sizes, poses = world.field.kinds, world.field.sizes, world.field.poses
    for index in range(len(order)):
        pair = order[index]
        body = pairs[pair, 0]
        if pairs[pair, 1] != FIELD or joints[body] < 0:
            continue
        joint = joints[body]
        for ball in range(balls.shape[1]):
            radius = balls[body, ball, 3] - excess[pair] - BALL_SLACK
            if not radius > 0.0:
                break  # the others are smaller
            a, b, c = balls[body, ball, 0], balls[body, ball, 1], balls[body, ball, 2]
            x = placements[joint, 0, 0] * a + placements[joint, 0, 1] * b + placements[joint, 0, 2] * c
            y = placements[joint, 1, 0] * a + placements[joint, 1, 1] * b + placements[joint, 1, 2] * c
            z = placements[joint, 2, 0] * a + placements[joint, 2, 1] * b + placements[joint, 2, 2] * c
            x, y, z = x + placements[joint, 0, 3], y + placements[joint, 1, 3], z + placements[joint, 2, 3]
            for number in range(len(boxes)):
                if (
                    boxes[number, 0] - radius < x < boxes[number, 3] + radius
                    and boxes[number, 1] - radius < y < boxes[number, 4] + radius
                    and boxes[number, 2] - radius < z < boxes[number, 5] + radius
                    and boxes[number, 6] > spheres[body, 3]
                    and placed_solid_distance(solid_of(kinds, sizes, number), poses, number, x, y, z) < radius
                ):
                    return pair, number
    return -1, 0
