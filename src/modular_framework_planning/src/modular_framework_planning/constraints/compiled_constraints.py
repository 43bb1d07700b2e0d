# SPDX-License-Identifier: BSD-3-Clause
"""Checks states and edges against pose constraints, and projects states onto them, as compiled loops.

A constraint compares the pose of a link with that of a reference frame: by three angles, or by the place of a point in
regions. A projection takes Gauss-Newton steps with the geometric Jacobian, as in Berenson, Srinivasa, Ferguson,
Kuffner: Manipulation planning on constraint manifolds, ICRA 2009.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import (
    Tree,
    damped_step,
    joint_placements,
    rotation_vector,
)

SLACK = 1.0e-6  # [m] or [rad]; the accuracy of inverse kinematics, so that a region of no extent can be met
TIGHT = 0.005  # [m] or [rad]; within smaller tolerances projections aim at the middle, also where others are violated
INNER_SHARE = 0.9  # of a tolerance, which projections aim at: straight motions between two states bulge
INSIDE = 1.0e-5  # [m]; projections aim this far inside a hull
WIDEST_STEP = 0.3  # [rad or m]; of any joint in one step of a projection
DAMPING = 1.0e-6
IDENTITY = np.eye(3)
SAME = 1.0e-9  # [rad or m]; distance of two states that count as the same
CLOSE_STEPS = 8  # of the projection of a step of a walk, which begins near the constraints
LEAST_PROGRESS = 0.1  # of a step of a walk, towards its target
EULER_ANGLES, ROTATION_VECTOR, POINT = range(3)  # what is compared
BOX, BALL, CYLINDER, CONE, HULL = range(5)  # regions


class Conditions(NamedTuple):
    """What has to hold of a state.

    Attributes:
        tree: the n joints that move a link or a reference frame of a constraint.
        ranges: target, tolerance below and above of k joints [rad or m], shape (k, 3). Their values stand behind those
            of the tree's joints.
        turns: which of the k joints turn without end, shape (k,).
        kinds: what is compared in each of m poses, shape (m,).
        frames: the tree's joint that moves the link, and the one that moves the reference, -1 for none; shape (m, 2).
        placements: of both in the frames of these joints, shape (m, 2, 3, 4). In terms of EULER_ANGLES the wanted
            rotation is part of the reference's; in terms of a ROTATION_VECTOR, its inverse of the link's.
        signs: 1 where a joint moves the link alone, -1 the reference alone, 0 both or none; shape (m, n).
        tolerances: of the angles [rad], shape (m, 3).
        regions: first and last (exclusive) of the regions of a POINT, shape (m, 2).
        shapes: BOX, BALL, ... of each region; sizes: edges, or radius, or height and radius [m]; shapes (r,), (r, 3).
        poses: of the regions in the reference frame, shape (r, 3, 4).
        face_ranges: first and last (exclusive) of the faces of a HULL, shape (r, 2).
        faces: outward normal and offset, a point p is inside where normal . p + offset <= 0; shape (f, 4).
    """

    tree: Tree
    ranges: Array
    turns: NDArray[np.bool_]
    kinds: NDArray[np.int64]
    frames: NDArray[np.int64]
    placements: Array
    signs: Array
    tolerances: Array
    regions: NDArray[np.int64]
    shapes: NDArray[np.int64]
    sizes: Array
    poses: Array
    face_ranges: NDArray[np.int64]
    faces: Array


class Drive(NamedTuple):
    """How a state moves the n + k joints of conditions: offset + gain * state[driver], no driver where that is -1."""

    drivers: NDArray[np.int64]
    gains: Array
    offsets: Array


class Workspace(NamedTuple):
    """Working memory for one state.

    Attributes:
        values: of the joints, shape (n + k,); placements: of the tree's joints, shape (n, 3, 4).
        pose: of the link in the reference frame; reference: its pose in the planning frame; both of shape (3, 4).
        deviation: three angles, or the point in a region's frame; shape (3,).
        directions: of linearised conditions in the reference frame, aims: wanted change; shapes (rows, 3), (rows,).
    """

    values: Array
    placements: Array
    pose: Array
    reference: Array
    deviation: Array
    directions: Array
    aims: Array


@njit(cache=True, nogil=True)
def _new_workspace(conditions):  # type: ignore[no-untyped-def]
    joints, rows = len(conditions.tree.parents), 3 + len(conditions.faces)
    values, placements = np.empty(joints + len(conditions.ranges)), np.empty((joints, 3, 4))
    pose, reference, deviation = np.empty((3, 4)), np.empty((3, 4)), np.empty(3)
    return Workspace(values, placements, pose, reference, deviation, np.empty((rows, 3)), np.empty(rows))


@njit(cache=True, nogil=True)
def _place(conditions, drive, state, workspace):  # type: ignore[no-untyped-def]
    """Places the joints of the tree."""
    drivers, gains, offsets = drive
    values = workspace.values
    for number in range(len(values)):
        values[number] = offsets[number]
        if drivers[number] >= 0:
            values[number] += gains[number] * state[drivers[number]]
    joint_placements(conditions.tree, values, workspace.placements)


@njit(cache=True, nogil=True)
def _joint_excess(conditions, values):  # type: ignore[no-untyped-def]
    """Returns how far the joint farthest out of its range is out of it."""
    ranges, worst = conditions.ranges, -np.inf
    first = len(values) - len(ranges)
    for number in range(len(ranges)):
        gap = values[first + number] - ranges[number, 0]
        if conditions.turns[number]:
            gap = np.arctan2(np.sin(gap), np.cos(gap))
        worst = max(worst, gap - ranges[number, 2], -gap - ranges[number, 1])
    return worst


@njit(cache=True, nogil=True)
def _write_frame(placements, joint, placement, out):  # type: ignore[no-untyped-def]
    """Writes the pose in the planning frame of what a joint moves."""
    if joint < 0:
        out[:] = placement
        return
    frame = placements[joint]
    for row in range(3):
        a, b, c = frame[row, 0], frame[row, 1], frame[row, 2]
        for column in range(4):
            out[row, column] = a * placement[0, column] + b * placement[1, column] + c * placement[2, column]
        out[row, 3] += frame[row, 3]


@njit(cache=True, nogil=True)
def _write_relative(reference, pose):  # type: ignore[no-untyped-def]
    """Turns a pose in the planning frame into one in the reference frame, in place."""
    for column in range(4):
        x, y, z = pose[0, column], pose[1, column], pose[2, column]
        if column == 3:
            x, y, z = x - reference[0, 3], y - reference[1, 3], z - reference[2, 3]
        for row in range(3):
            pose[row, column] = reference[0, row] * x + reference[1, row] * y + reference[2, row] * z


@njit(cache=True, nogil=True)
def _write_euler(turn, tolerance, out):  # type: ignore[no-untyped-def]
    """Writes intrinsic XYZ Euler angles of a rotation.

    Where roll and yaw turn about one axis, the turn counts as roll, and as yaw where the tolerance of roll is less.
    """
    sine = min(max(turn[0, 2], -1.0), 1.0)
    out[1] = np.arcsin(sine)
    if abs(sine) > 1.0 - 1.0e-12:
        out[0], out[2] = np.arctan2(turn[2, 1], turn[1, 1]), 0.0
        if abs(out[0]) > tolerance:
            out[0], out[2] = 0.0, out[0]
    else:
        out[0], out[2] = np.arctan2(-turn[1, 2], turn[2, 2]), np.arctan2(-turn[0, 1], turn[0, 0])


@njit(cache=True, nogil=True)
def _cone_gap(height, radius, distance, z):  # type: ignore[no-untyped-def]
    """Returns how far a point (distance from the axis, z) is from a cone, and the nearest point of it, likewise."""
    half = 0.5 * height
    if -half <= z <= half and distance * height <= radius * (half - z):
        return 0.0, distance, z
    length = radius * radius + height * height
    share = ((radius - distance) * radius + (z + half) * height) / length if length > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    side, up, flat = radius * (1.0 - share), share * height - half, min(distance, radius)
    on_side, on_base = np.hypot(side - distance, up - z), np.hypot(flat - distance, half + z)
    return (on_base, flat, -half) if on_base < on_side else (on_side, side, up)


@njit(cache=True, nogil=True)
def _region_gap(shape, size, faces, point):  # type: ignore[no-untyped-def]
    """Returns how far a point is out of a region; of a hull, out of the face it is farthest beyond."""
    x, y, z = point[0], point[1], point[2]
    if shape == BOX:
        x, y, z = abs(x) - 0.5 * size[0], abs(y) - 0.5 * size[1], abs(z) - 0.5 * size[2]
        return np.sqrt(max(x, 0.0) ** 2 + max(y, 0.0) ** 2 + max(z, 0.0) ** 2)
    if shape == BALL:
        return max(np.sqrt(x * x + y * y + z * z) - size[0], 0.0)
    if shape == CYLINDER:
        return np.hypot(max(np.hypot(x, y) - size[1], 0.0), max(abs(z) - 0.5 * size[0], 0.0))
    if shape == CONE:
        return _cone_gap(size[0], size[1], np.hypot(x, y), z)[0]
    worst = 0.0
    for face in range(len(faces)):
        worst = max(worst, faces[face, 0] * x + faces[face, 1] * y + faces[face, 2] * z + faces[face, 3])
    return worst


@njit(cache=True, nogil=True)
def _write_point(pose, point, out):  # type: ignore[no-untyped-def]
    """Writes a point of the reference frame in the frame of a region."""
    x, y, z = point[0, 3] - pose[0, 3], point[1, 3] - pose[1, 3], point[2, 3] - pose[2, 3]
    for row in range(3):
        out[row] = pose[0, row] * x + pose[1, row] * y + pose[2, row] * z


@njit(cache=True, nogil=True)
def _pose_excess(conditions, item, workspace):  # type: ignore[no-untyped-def]
    """Compares one pair of poses, of placed joints.

    Returns:
        How far the deviation, which is written, is out of its tolerance; the nearest region, -1 for a rotation.
    """
    placements, frames, pose = conditions.placements[item], conditions.frames[item], workspace.pose
    _write_frame(workspace.placements, frames[1], placements[1], workspace.reference)
    _write_frame(workspace.placements, frames[0], placements[0], pose)
    _write_relative(workspace.reference, pose)
    kind, deviation, tolerances = conditions.kinds[item], workspace.deviation, conditions.tolerances[item]
    if kind != POINT:
        if kind == EULER_ANGLES:
            _write_euler(pose, tolerances[0], deviation)
        else:
            rotation_vector(IDENTITY, pose, deviation)
        worst = -np.inf
        for axis in range(3):
            worst = max(worst, abs(deviation[axis]) - tolerances[axis])
        return worst, -1
    best, nearest = np.inf, -1
    for region in range(conditions.regions[item, 0], conditions.regions[item, 1]):
        _write_point(conditions.poses[region], pose, deviation)
        begin, end = conditions.face_ranges[region, 0], conditions.face_ranges[region, 1]
        gap = _region_gap(conditions.shapes[region], conditions.sizes[region], conditions.faces[begin:end], deviation)
        if gap < best:
            best, nearest = gap, region
    _write_point(conditions.poses[nearest], pose, deviation)
    return best, nearest


@njit(cache=True, nogil=True)
def _excess(conditions, drive, state, workspace):  # type: ignore[no-untyped-def]
    """Returns by how much the condition that is violated most is violated; nothing above 0 where all hold."""
    _place(conditions, drive, state, workspace)
    worst = _joint_excess(conditions, workspace.values)
    for item in range(len(conditions.kinds)):
        worst = max(worst, _pose_excess(conditions, item, workspace)[0])
    return worst


@njit(cache=True, nogil=True)
def first_violated(conditions, drive, states):  # type: ignore[no-untyped-def]
    """Returns the number of the first of some states (s, joints) that violates a condition; -1 where none does."""
    workspace = _new_workspace(conditions)
    for number in range(len(states)):
        if _excess(conditions, drive, states[number], workspace) > SLACK:
            return number
    return -1


@njit(cache=True, nogil=True)
def _edge_holds(conditions, drive, start, end, step, state, workspace):  # type: ignore[no-untyped-def]
    """Whether the conditions hold along an edge, behind its start; its middle is checked first."""
    widest = 0.0
    for joint in range(len(start)):
        widest = max(widest, abs(end[joint] - start[joint]))
    if _excess(conditions, drive, end, workspace) > SLACK:
        return False
    count, stride = max(1, int(np.ceil(widest / step))), 1
    while stride < count:
        stride *= 2
    while stride > 1:
        for number in range(stride // 2, count, stride):
            share = number / count
            for joint in range(len(start)):
                state[joint] = start[joint] + share * (end[joint] - start[joint])
            if _excess(conditions, drive, state, workspace) > SLACK:
                return False
        stride //= 2
    return True


@njit(cache=True, nogil=True)
def edges_hold(conditions, drive, vertices, step):  # type: ignore[no-untyped-def]
    """Whether the conditions hold on the straight pieces between states (s, joints), behind the first of them.

    They are looked at at samples at most `step` apart in every joint.
    """
    workspace, state = _new_workspace(conditions), np.empty(vertices.shape[1])
    for number in range(1, len(vertices)):
        if not _edge_holds(conditions, drive, vertices[number - 1], vertices[number], step, state, workspace):
            return False
    return True


@njit(cache=True, nogil=True)
def _angle_rows(kind, deviation, tolerances, violated, directions, aims):  # type: ignore[no-untyped-def]
    """Writes how a turn of the link changes the angles that have to change, and by how much they have to."""
    x, y, z = deviation[0], deviation[1], deviation[2]
    count = 0
    for axis in range(3):
        limit = 0.0 if tolerances[axis] <= TIGHT else INNER_SHARE * tolerances[axis]
        if not (limit == 0.0 or (violated and abs(deviation[axis]) > limit)):
            continue
        row = directions[count]
        if kind == EULER_ANGLES:
            sine, cosine, rise = np.sin(x), np.cos(x), np.cos(y)
            rise = max(abs(rise), 1.0e-3) * (1.0 if rise >= 0.0 else -1.0)
            if axis == 0:
                tangent = np.sin(y) / rise
                row[0], row[1], row[2] = 1.0, sine * tangent, -cosine * tangent
            elif axis == 1:
                row[0], row[1], row[2] = 0.0, cosine, sine
            else:
                row[0], row[1], row[2] = 0.0, -sine / rise, cosine / rise
        else:  # of the inverse left Jacobian of the rotations: 1 - [v] / 2 + s [v]^2, [v]^2 = v v^T - |v|^2
            square = x * x + y * y + z * z
            angle = np.sqrt(square)
            bend = 1.0 / 12.0
            if angle > 1.0e-3:
                bend = (1.0 - 0.5 * angle * np.cos(0.5 * angle) / np.sin(0.5 * angle)) / square
            for column in range(3):
                row[column] = bend * deviation[axis] * deviation[column]
            row[axis] += 1.0 - bend * square
            following, last = (axis + 1) % 3, (axis + 2) % 3
            row[following] += 0.5 * deviation[last]
            row[last] -= 0.5 * deviation[following]
        aims[count] = min(max(deviation[axis], -limit), limit) - deviation[axis]
        count += 1
    return count


@njit(cache=True, nogil=True)
def _inner(length):  # type: ignore[no-untyped-def]
    """Returns the half length of a region that projections aim at."""
    return 0.0 if length <= TIGHT else length - min((1.0 - INNER_SHARE) * length, TIGHT)


@njit(cache=True, nogil=True)
def _add_row(x, y, z, aim, count, directions, aims):  # type: ignore[no-untyped-def]
    directions[count, 0], directions[count, 1], directions[count, 2], aims[count] = x, y, z, aim
    return count + 1


@njit(cache=True, nogil=True)
def _axis_row(axis, half, point, violated, count, directions, aims):  # type: ignore[no-untyped-def]
    """Adds the condition that keeps a coordinate within half a length of 0; returns how many there are then."""
    limit, value = _inner(half), point[axis]
    if limit > 0.0 and (not violated or abs(value) <= limit):
        return count
    aim = min(max(value, -limit), limit) - value
    return _add_row(1.0 * (axis == 0), 1.0 * (axis == 1), 1.0 * (axis == 2), aim, count, directions, aims)


@njit(cache=True, nogil=True)
def _region_rows(shape, size, faces, point, violated, directions, aims):  # type: ignore[no-untyped-def]
    """Writes the directions, in the frame of a region, in which a point has to move, and how far."""
    x, y, z = point[0], point[1], point[2]
    if shape == BOX:
        count = 0
        for axis in range(3):
            count = _axis_row(axis, 0.5 * size[axis], point, violated, count, directions, aims)
        return count
    if shape == HULL:
        count = 0
        for face in range(len(faces)):
            a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
            gap = a * x + b * y + c * z + faces[face, 3] + INSIDE
            if violated and gap > 0.0:
                count = _add_row(a, b, c, -gap, count, directions, aims)
        return count
    if shape == CONE:
        if not violated:
            return 0
        distance = max(np.hypot(x, y), 1.0e-12)
        _, inside, up = _cone_gap(size[0], size[1], distance, z)
        share = INNER_SHARE * inside / distance
        count = _add_row(1.0, 0.0, 0.0, share * x - x, 0, directions, aims)
        count = _add_row(0.0, 1.0, 0.0, share * y - y, count, directions, aims)
        return _add_row(0.0, 0.0, 1.0, INNER_SHARE * up - z, count, directions, aims)
    flat = shape == CYLINDER
    count = _axis_row(2, 0.5 * size[0], point, violated, 0, directions, aims) if flat else 0
    radius, height = size[1] if flat else size[0], 0.0 if flat else z
    limit, distance = _inner(radius), np.sqrt(x * x + y * y + height * height)
    if limit == 0.0:
        for axis in range(2 if flat else 3):
            count = _axis_row(axis, 0.0, point, violated, count, directions, aims)
    elif violated and distance > limit:
        count = _add_row(x / distance, y / distance, height / distance, limit - distance, count, directions, aims)
    return count


@njit(cache=True, nogil=True)
def _pose_rows(conditions, item, region, violated, workspace):  # type: ignore[no-untyped-def]
    """Writes the linearised conditions on one pair of poses, in the reference frame; returns their number."""
    directions, aims = workspace.directions, workspace.aims
    if region < 0:
        return _angle_rows(
            conditions.kinds[item], workspace.deviation, conditions.tolerances[item], violated, directions, aims
        )
    begin, end = conditions.face_ranges[region, 0], conditions.face_ranges[region, 1]
    shape, size, pose = conditions.shapes[region], conditions.sizes[region], conditions.poses[region]
    count = _region_rows(shape, size, conditions.faces[begin:end], workspace.deviation, violated, directions, aims)
    for row in range(count):
        x, y, z = directions[row, 0], directions[row, 1], directions[row, 2]
        for axis in range(3):
            directions[row, axis] = pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2] * z
    return count


@njit(cache=True, nogil=True)
def _add_gradients(conditions, drive, item, count, first, workspace, rates, wanted):  # type: ignore[no-untyped-def]
    """Writes how the state changes what the conditions on one pair of poses are about."""
    tree, signs, reference, pose = conditions.tree, conditions.signs[item], workspace.reference, workspace.pose
    turns = conditions.kinds[item] != POINT
    px, py, pz = reference[0, 3], reference[1, 3], reference[2, 3]  # the point in the planning frame
    for column in range(3):
        px += reference[0, column] * pose[column, 3]
        py += reference[1, column] * pose[column, 3]
        pz += reference[2, column] * pose[column, 3]
    rates[first : first + count] = 0.0
    for row in range(count):
        wanted[first + row] = workspace.aims[row]
    for joint in range(len(signs)):
        driver = drive.drivers[joint]
        if signs[joint] == 0.0 or driver < 0 or (turns and tree.prismatic[joint]):
            continue
        frame, axis = workspace.placements[joint], tree.axes[joint]
        x = frame[0, 0] * axis[0] + frame[0, 1] * axis[1] + frame[0, 2] * axis[2]
        y = frame[1, 0] * axis[0] + frame[1, 1] * axis[1] + frame[1, 2] * axis[2]
        z = frame[2, 0] * axis[0] + frame[2, 1] * axis[1] + frame[2, 2] * axis[2]
        if not turns and not tree.prismatic[joint]:
            a, b, c = px - frame[0, 3], py - frame[1, 3], pz - frame[2, 3]
            x, y, z = y * c - z * b, z * a - x * c, x * b - y * a
        u = reference[0, 0] * x + reference[1, 0] * y + reference[2, 0] * z
        v = reference[0, 1] * x + reference[1, 1] * y + reference[2, 1] * z
        w = reference[0, 2] * x + reference[1, 2] * y + reference[2, 2] * z
        scale = signs[joint] * drive.gains[joint]
        for row in range(count):
            direction = workspace.directions[row]
            rates[first + row, driver] += scale * (direction[0] * u + direction[1] * v + direction[2] * w)


@njit(cache=True, nogil=True)
def _write_step(rates, wanted, count, free, square, solved, step):  # type: ignore[no-untyped-def]
    """Writes the least-squares step of the free joints, in which none goes farther than WIDEST_STEP."""
    damped_step(rates, wanted, count, DAMPING, free, step, square, solved)
    widest = 1.0e-12
    for joint in range(len(step)):
        widest = max(widest, abs(step[joint]))
    share = min(1.0, WIDEST_STEP / widest)
    for joint in range(len(step)):
        step[joint] *= share


@njit(cache=True, nogil=True)
def project(conditions, drive, state, lower, upper, steps):  # type: ignore[no-untyped-def]
    """Moves a state (joints,), in place, by least-squares steps within bounds until every condition holds.

    Joints that a step would push over a bound stay, and the others take over.

    Returns:
        Whether all conditions hold after at most that many steps.
    """
    width, most = len(state), 3 * len(conditions.kinds) + len(conditions.faces)
    workspace = _new_workspace(conditions)
    rates, wanted, square = np.empty((most, width)), np.empty(most), np.empty((most, most))
    solved, step, free = np.empty(most), np.empty(width), np.empty(width, dtype=np.bool_)
    for joint in range(width):
        state[joint] = min(max(state[joint], lower[joint]), upper[joint])
    for _ in range(steps):
        _place(conditions, drive, state, workspace)
        count, is_violated = 0, False
        for item in range(len(conditions.kinds)):
            excess, region = _pose_excess(conditions, item, workspace)
            rows = _pose_rows(conditions, item, region, excess > SLACK, workspace)
            _add_gradients(conditions, drive, item, rows, count, workspace, rates, wanted)
            count, is_violated = count + rows, is_violated or excess > SLACK
        if not is_violated:
            return _joint_excess(conditions, workspace.values) <= SLACK
        free[:] = True
        for _attempt in range(3):
            _write_step(rates, wanted, count, free, square, solved, step)
            blocked = False
            for joint in range(width):
                at_end = (state[joint] <= lower[joint] and step[joint] < 0.0) or (
                    state[joint] >= upper[joint] and step[joint] > 0.0
                )
                if free[joint] and at_end:
                    free[joint], blocked = False, True
            if not blocked:
                break
        for joint in range(width):
            state[joint] = min(max(state[joint] + step[joint], lower[joint]), upper[joint])
    return False


@njit(cache=True, nogil=True)
def _distance(one, other):  # type: ignore[no-untyped-def]
    square = 0.0
    for joint in range(len(one)):
        square += (other[joint] - one[joint]) * (other[joint] - one[joint])
    return np.sqrt(square)


@njit(cache=True, nogil=True)
def nearest_state(states, target):  # type: ignore[no-untyped-def]
    """Returns the number of the state, of some (n, joints), that is nearest to another one."""
    best, found = np.inf, 0
    for number in range(len(states)):
        square = 0.0
        for joint in range(len(target)):
            square += (states[number, joint] - target[joint]) ** 2
        if square < best:
            best, found = square, number
    return found


@njit(cache=True, nogil=True)
def walk(conditions, drive, start, target, lower, upper, longest, shortest, step, out):  # type: ignore[no-untyped-def]
    """Goes from a state towards another one along the conditions: a straight step, its projection, and so on.

    A step is halved where the conditions do not hold between its ends, and doubled again where they do.

    Args:
        conditions: hold at the start.
        drive: of the states.
        start: shape (joints,).
        target: shape (joints,).
        lower: bounds of projected states, shape (joints,).
        upper: likewise.
        longest: most that a step is long, before projection.
        shortest: least.
        step: distance of samples along a step, of any joint.
        out: filled with the states that were reached, shape (most, joints).

    Returns:
        How many there are; fewer than there is room for where the walk has arrived at the target, exactly, or where
        no step leads nearer to it.
    """
    workspace, state, sampled = _new_workspace(conditions), np.empty(len(start)), np.empty(len(start))
    here, size, count = start.copy(), longest, 0
    while count < len(out):
        distance = _distance(here, target)
        if distance < SAME:
            break
        length = min(size, distance)
        for joint in range(len(state)):
            state[joint] = target[joint]
            if length < distance:
                state[joint] = here[joint] + length / distance * (target[joint] - here[joint])
        is_nearer = _excess(conditions, drive, state, workspace) <= SLACK or project(
            conditions, drive, state, lower, upper, CLOSE_STEPS
        )
        is_nearer = (
            is_nearer
            and _distance(state, target) <= distance - LEAST_PROGRESS * length
            and _distance(here, state) <= 2.0 * length
        )
        if is_nearer and _edge_holds(conditions, drive, here, state, step, sampled, workspace):
            here[:] = state
            out[count] = state
            count, size = count + 1, min(longest, 2.0 * size)
            continue
        size = 0.5 * length
        if size < (shortest if is_nearer else max(shortest, 0.25 * longest)):
            break
    return count
