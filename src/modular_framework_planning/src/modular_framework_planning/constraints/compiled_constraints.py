# SPDX-License-Identifier: BSD-3-Clause
"""Compiled checks of states and edges against constraints, and projection of states onto constraints.

A pose constraint limits a link's pose in a reference frame, by three angles or by regions for a point of the link. A
projection takes Gauss-Newton steps with the geometric Jacobian, as in Berenson, Srinivasa, Ferguson, Kuffner:
Manipulation planning on constraint manifolds, ICRA 2009.
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
    joint_distance,
    joint_placements,
    rotation_vector,
)

TOLERANCE = 1.0e-6  # accuracy of inverse kinematics, so that a zero-size region stays reachable [m or rad]
TIGHT_TOLERANCE = 0.005  # projections target the centre of a tolerance up to this value [m or rad]
INNER_FRACTION = 0.9  # projections target this fraction of a tolerance, because edges deviate between projected states
HULL_MARGIN = 1.0e-5  # projections target a point at this depth inside a hull [m]
MAX_STEP = 0.3  # maximum joint displacement in a projection step [rad or m]
DAMPING = 1.0e-6  # damping of a projection step
IDENTITY = np.eye(3)
SAME_STATE_DISTANCE = 1.0e-9  # [rad or m]
MAX_PROJECTION_STEPS = 8  # maximum steps of a projection in a walk, which starts close to the constraints
MIN_PROGRESS = 0.1  # minimum progress of a walk step towards the target, as a fraction of its length
EULER_ANGLES, ROTATION_VECTOR, POINT = range(3)  # quantity types
BOX, SPHERE, CYLINDER, CONE, HULL = range(5)  # region shapes


class ConstraintArrays(NamedTuple):
    """Constraints as arrays.

    Attributes:
        tree: The n joints that move links or reference frames of pose constraints.
        ranges: Target, lower and upper tolerance of k joint constraints, shape (k, 3) [rad or m]. In arrays of joint
            values, these joints follow the tree's joints.
        is_continuous: Whether each of the k joints is continuous, shape (k,).
        kinds: Quantity that each of m pose constraints limits, shape (m,).
        frames: Tree joints that move the link and the reference frame, -1 for none, shape (m, 2).
        placements: Link and reference frame in the frames of these joints, shape (m, 2, 3, 4). The target rotation is
            included in the reference frame for EULER_ANGLES; its inverse is included in the link for ROTATION_VECTOR.
        signs: 1 for a joint that moves only the link, -1 for a joint that moves only the reference frame, otherwise 0;
            shape (m, n).
        tolerances: Tolerances of the angles, shape (m, 3) [rad].
        regions: First and last (exclusive) region of a POINT, shape (m, 2).
        shapes: Shape of each region, shape (r,).
        sizes: Edges, radius, or height and radius of each region, shape (r, 3) [m].
        poses: Region poses in the reference frame, shape (r, 3, 4).
        face_ranges: First and last (exclusive) face of a HULL, shape (r, 2).
        faces: Outward normal and offset of each face, shape (f, 4); normal . p + offset <= 0 for a point p inside.
    """

    tree: Tree
    ranges: Array
    is_continuous: NDArray[np.bool_]
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


class JointMapping(NamedTuple):
    """Mapping of a state to the n + k constrained joints: offset + gain * state[driver], or offset if driver is -1."""

    drivers: NDArray[np.int64]
    gains: Array
    offsets: Array


class Workspace(NamedTuple):
    """Working memory for a state.

    Attributes:
        values: Joint values, shape (n + k,).
        placements: Placements of the tree's joints, shape (n, 3, 4).
        pose: Link pose in the reference frame, shape (3, 4).
        reference: Pose of the reference frame in the planning frame, shape (3, 4).
        deviation: Three angles, or the point in a region's frame, shape (3,).
        directions: Directions of linearised constraints in the reference frame, shape (rows, 3).
        changes: Required changes of linearised constraints, shape (rows,).
    """

    values: Array
    placements: Array
    pose: Array
    reference: Array
    deviation: Array
    directions: Array
    changes: Array


@njit(cache=True, nogil=True)
def _new_workspace(constraints: ConstraintArrays) -> Workspace:
    joints, rows = len(constraints.tree.parents), 3 + len(constraints.faces)
    values, placements = np.empty(joints + len(constraints.ranges)), np.empty((joints, 3, 4))
    pose, reference, deviation = np.empty((3, 4)), np.empty((3, 4)), np.empty(3)
    return Workspace(values, placements, pose, reference, deviation, np.empty((rows, 3)), np.empty(rows))


@njit(cache=True, nogil=True)
def _place_joints(constraints: ConstraintArrays, mapping: JointMapping, state: Array, workspace: Workspace) -> None:
    """Writes the joint values and the placements of the tree's joints to the workspace."""
    drivers, gains, offsets = mapping
    values = workspace.values
    for index in range(len(values)):
        values[index] = offsets[index]
        if drivers[index] >= 0:
            values[index] += gains[index] * state[drivers[index]]
    joint_placements(constraints.tree, values, workspace.placements)


@njit(cache=True, nogil=True)
def _joint_excess(constraints: ConstraintArrays, values: Array) -> float:
    """Returns the maximum violation of the joint constraints, at most 0 if all are satisfied."""
    ranges, max_excess = constraints.ranges, -np.inf
    first = len(values) - len(ranges)
    for index in range(len(ranges)):
        deviation = values[first + index] - ranges[index, 0]
        if constraints.is_continuous[index]:
            deviation = np.arctan2(np.sin(deviation), np.cos(deviation))
        max_excess = max(max_excess, deviation - ranges[index, 2], -deviation - ranges[index, 1])
    return max_excess


@njit(cache=True, nogil=True)
def _write_frame(placements: Array, joint: int, placement: Array, out: Array) -> None:
    """Writes the planning-frame pose of a frame; `placement` is in the joint's frame, in the planning frame for -1."""
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
def _write_relative(reference: Array, pose: Array) -> None:
    """Converts a pose from the planning frame to the reference frame, in place."""
    for column in range(4):
        x, y, z = pose[0, column], pose[1, column], pose[2, column]
        if column == 3:
            x, y, z = x - reference[0, 3], y - reference[1, 3], z - reference[2, 3]
        for row in range(3):
            pose[row, column] = reference[0, row] * x + reference[1, row] * y + reference[2, row] * z


@njit(cache=True, nogil=True)
def _write_euler(rotation: Array, roll_tolerance: float, out: Array) -> None:
    """Writes the intrinsic XYZ Euler angles of a rotation.

    In gimbal lock, the rotation counts as roll, or as yaw if the angle exceeds the roll tolerance.
    """
    sine = min(max(rotation[0, 2], -1.0), 1.0)
    out[1] = np.arcsin(sine)
    if abs(sine) > 1.0 - 1.0e-12:
        out[0], out[2] = np.arctan2(rotation[2, 1], rotation[1, 1]), 0.0
        if abs(out[0]) > roll_tolerance:
            out[0], out[2] = 0.0, out[0]
    else:
        out[0], out[2] = np.arctan2(-rotation[1, 2], rotation[2, 2]), np.arctan2(-rotation[0, 1], rotation[0, 0])


@njit(cache=True, nogil=True)
def _cone_gap(height: float, radius: float, r: float, z: float) -> tuple[float, float, float]:
    """Returns the distance of a point (r, z), at the distance r from the axis, from a cone, and the nearest point."""
    half = 0.5 * height
    if -half <= z <= half and r * height <= radius * (half - z):
        return 0.0, r, z
    squared_slant = radius * radius + height * height
    fraction = ((radius - r) * radius + (z + half) * height) / squared_slant if squared_slant > 0.0 else 0.0
    fraction = min(max(fraction, 0.0), 1.0)
    side_r, side_z, base_r = radius * (1.0 - fraction), fraction * height - half, min(r, radius)
    side_gap, base_gap = np.hypot(side_r - r, side_z - z), np.hypot(base_r - r, half + z)
    return (base_gap, base_r, -half) if base_gap < side_gap else (side_gap, side_r, side_z)


@njit(cache=True, nogil=True)
def _region_gap(shape: int, size: Array, faces: Array, point: Array) -> float:
    """Returns the distance of a point from a region, for a hull from the most violated face; 0 inside."""
    x, y, z = point[0], point[1], point[2]
    if shape == BOX:
        x, y, z = abs(x) - 0.5 * size[0], abs(y) - 0.5 * size[1], abs(z) - 0.5 * size[2]
        return np.sqrt(max(x, 0.0) ** 2 + max(y, 0.0) ** 2 + max(z, 0.0) ** 2)
    if shape == SPHERE:
        return max(np.sqrt(x * x + y * y + z * z) - size[0], 0.0)
    if shape == CYLINDER:
        return np.hypot(max(np.hypot(x, y) - size[1], 0.0), max(abs(z) - 0.5 * size[0], 0.0))
    if shape == CONE:
        return _cone_gap(size[0], size[1], np.hypot(x, y), z)[0]
    max_excess = 0.0
    for face in range(len(faces)):
        max_excess = max(max_excess, faces[face, 0] * x + faces[face, 1] * y + faces[face, 2] * z + faces[face, 3])
    return max_excess


@njit(cache=True, nogil=True)
def _write_point(frame: Array, link_pose: Array, out: Array) -> None:
    """Writes the position of a link in a frame; both poses have the same reference."""
    x, y, z = link_pose[0, 3] - frame[0, 3], link_pose[1, 3] - frame[1, 3], link_pose[2, 3] - frame[2, 3]
    for row in range(3):
        out[row] = frame[0, row] * x + frame[1, row] * y + frame[2, row] * z


@njit(cache=True, nogil=True)
def _pose_excess(constraints: ConstraintArrays, constraint: int, workspace: Workspace) -> tuple[float, int]:
    """Writes the deviation from a pose constraint to the workspace, for the current placements.

    Returns:
        The violation of the tolerances, or the distance from the nearest region, and this region (-1 for a rotation).
    """
    placements, frames, pose = constraints.placements[constraint], constraints.frames[constraint], workspace.pose
    _write_frame(workspace.placements, frames[1], placements[1], workspace.reference)
    _write_frame(workspace.placements, frames[0], placements[0], pose)
    _write_relative(workspace.reference, pose)
    kind, deviation, tolerances = constraints.kinds[constraint], workspace.deviation, constraints.tolerances[constraint]
    if kind != POINT:
        if kind == EULER_ANGLES:
            _write_euler(pose, tolerances[0], deviation)
        else:
            rotation_vector(IDENTITY, pose, deviation)
        max_excess = -np.inf
        for axis in range(3):
            max_excess = max(max_excess, abs(deviation[axis]) - tolerances[axis])
        return max_excess, -1
    best, nearest = np.inf, -1
    for region in range(constraints.regions[constraint, 0], constraints.regions[constraint, 1]):
        _write_point(constraints.poses[region], pose, deviation)
        first_face, end = constraints.face_ranges[region, 0], constraints.face_ranges[region, 1]
        gap = _region_gap(
            constraints.shapes[region], constraints.sizes[region], constraints.faces[first_face:end], deviation
        )
        if gap < best:
            best, nearest = gap, region
    _write_point(constraints.poses[nearest], pose, deviation)
    return best, nearest


@njit(cache=True, nogil=True)
def _excess(constraints: ConstraintArrays, mapping: JointMapping, state: Array, workspace: Workspace) -> float:
    """Returns the maximum violation of the constraints, at most 0 if all are satisfied."""
    _place_joints(constraints, mapping, state, workspace)
    max_excess = _joint_excess(constraints, workspace.values)
    for constraint in range(len(constraints.kinds)):
        max_excess = max(max_excess, _pose_excess(constraints, constraint, workspace)[0])
    return max_excess


@njit(cache=True, nogil=True)
def first_violated(constraints: ConstraintArrays, mapping: JointMapping, states: Array) -> int:
    """Returns the index of the first state that violates a constraint, or -1.

    Args:
        constraints: Constraints as arrays.
        mapping: Mapping of the states to the joints of the constraints.
        states: States, shape (s, joints) [rad or m].
    """
    workspace = _new_workspace(constraints)
    for index in range(len(states)):
        if _excess(constraints, mapping, states[index], workspace) > TOLERANCE:
            return index
    return -1


@njit(cache=True, nogil=True)
def pose_deviations(constraints: ConstraintArrays, mapping: JointMapping, state: Array) -> tuple[Array, Array]:
    """Evaluates the pose constraints at a state.

    Args:
        constraints: Constraints as arrays.
        mapping: Mapping of the state to the joints of the constraints.
        state: State, shape (joints,) [rad or m].

    Returns:
        The violation of each constraint, shape (m,), and its three angles or the point in the frame of the nearest
        region, shape (m, 3).
    """
    count, workspace = len(constraints.kinds), _new_workspace(constraints)
    excesses, deviations = np.empty(count), np.empty((count, 3))
    _place_joints(constraints, mapping, state, workspace)
    for constraint in range(count):
        excesses[constraint] = _pose_excess(constraints, constraint, workspace)[0]
        deviations[constraint] = workspace.deviation
    return excesses, deviations


@njit(cache=True, nogil=True)
def _edge_satisfied(
    constraints: ConstraintArrays,
    mapping: JointMapping,
    start: Array,
    end: Array,
    step: float,
    state: Array,
    workspace: Workspace,
) -> bool:
    """Returns whether an edge satisfies the constraints, except at its start; checks samples from coarse to fine."""
    max_change = 0.0
    for joint in range(len(start)):
        max_change = max(max_change, abs(end[joint] - start[joint]))
    if _excess(constraints, mapping, end, workspace) > TOLERANCE:
        return False
    count, stride = max(1, int(np.ceil(max_change / step))), 1
    while stride < count:
        stride *= 2
    while stride > 1:
        for index in range(stride // 2, count, stride):
            fraction = index / count
            for joint in range(len(start)):
                state[joint] = start[joint] + fraction * (end[joint] - start[joint])
            if _excess(constraints, mapping, state, workspace) > TOLERANCE:
                return False
        stride //= 2
    return True


@njit(cache=True, nogil=True)
def edges_satisfied(constraints: ConstraintArrays, mapping: JointMapping, vertices: Array, step: float) -> bool:
    """Returns whether a polyline satisfies the constraints, except at its start.

    Args:
        constraints: Constraints as arrays.
        mapping: Mapping of the states to the joints of the constraints.
        vertices: States of the polyline, shape (s, joints) [rad or m].
        step: Maximum joint displacement between checked states [rad or m].
    """
    workspace, state = _new_workspace(constraints), np.empty(vertices.shape[1])
    for index in range(1, len(vertices)):
        if not _edge_satisfied(constraints, mapping, vertices[index - 1], vertices[index], step, state, workspace):
            return False
    return True


@njit(cache=True, nogil=True)
def _angle_rows(
    kind: int, deviation: Array, tolerances: Array, is_violated: bool, directions: Array, changes: Array
) -> int:
    """Writes the rows of violated and tight angles; returns the number of rows.

    A row consists of the derivatives of an angle by a rotation vector in the reference frame, and the required change.
    """
    x, y, z = deviation[0], deviation[1], deviation[2]
    count = 0
    for axis in range(3):
        limit = 0.0 if tolerances[axis] <= TIGHT_TOLERANCE else INNER_FRACTION * tolerances[axis]
        if not (limit == 0.0 or (is_violated and abs(deviation[axis]) > limit)):
            continue
        row = directions[count]
        if kind == EULER_ANGLES:
            sine, cosine, divisor = np.sin(x), np.cos(x), np.cos(y)
            divisor = max(abs(divisor), 1.0e-3) * (1.0 if divisor >= 0.0 else -1.0)
            if axis == 0:
                tangent = np.sin(y) / divisor
                row[0], row[1], row[2] = 1.0, sine * tangent, -cosine * tangent
            elif axis == 1:
                row[0], row[1], row[2] = 0.0, cosine, sine
            else:
                row[0], row[1], row[2] = 0.0, -sine / divisor, cosine / divisor
        else:  # row of the inverse left Jacobian of SO(3): 1 - [v] / 2 + s [v]^2, with [v]^2 = v v^T - |v|^2
            squared_angle = x * x + y * y + z * z
            angle = np.sqrt(squared_angle)
            factor = 1.0 / 12.0
            if angle > 1.0e-3:
                factor = (1.0 - 0.5 * angle * np.cos(0.5 * angle) / np.sin(0.5 * angle)) / squared_angle
            for column in range(3):
                row[column] = factor * deviation[axis] * deviation[column]
            row[axis] += 1.0 - factor * squared_angle
            next_axis, last_axis = (axis + 1) % 3, (axis + 2) % 3
            row[next_axis] += 0.5 * deviation[last_axis]
            row[last_axis] -= 0.5 * deviation[next_axis]
        changes[count] = min(max(deviation[axis], -limit), limit) - deviation[axis]
        count += 1
    return count


@njit(cache=True, nogil=True)
def _inner_limit(half: float) -> float:
    """Returns the half length that projections target in a region with the given half length."""
    return 0.0 if half <= TIGHT_TOLERANCE else half - min((1.0 - INNER_FRACTION) * half, TIGHT_TOLERANCE)


@njit(cache=True, nogil=True)
def _add_row(x: float, y: float, z: float, change: float, count: int, directions: Array, changes: Array) -> int:
    """Adds the row that moves a point by `change` along (x, y, z); returns the new number of rows."""
    directions[count, 0], directions[count, 1], directions[count, 2], changes[count] = x, y, z, change
    return count + 1


@njit(cache=True, nogil=True)
def _axis_row(
    axis: int, half: float, point: Array, is_violated: bool, count: int, directions: Array, changes: Array
) -> int:
    """Adds the row that keeps a coordinate between -half and half; returns the new number of rows."""
    limit, value = _inner_limit(half), point[axis]
    if limit > 0.0 and (not is_violated or abs(value) <= limit):
        return count
    change = min(max(value, -limit), limit) - value
    return _add_row(1.0 * (axis == 0), 1.0 * (axis == 1), 1.0 * (axis == 2), change, count, directions, changes)


@njit(cache=True, nogil=True)
def _region_rows(
    shape: int, size: Array, faces: Array, point: Array, is_violated: bool, directions: Array, changes: Array
) -> int:
    """Writes directions in which a point must move, in a region's frame, and the distances; returns their number."""
    x, y, z = point[0], point[1], point[2]
    if shape == BOX:
        count = 0
        for axis in range(3):
            count = _axis_row(axis, 0.5 * size[axis], point, is_violated, count, directions, changes)
        return count
    if shape == HULL:
        count = 0
        for face in range(len(faces)):
            a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
            gap = a * x + b * y + c * z + faces[face, 3] + HULL_MARGIN
            if is_violated and gap > 0.0:
                count = _add_row(a, b, c, -gap, count, directions, changes)
        return count
    if shape == CONE:
        if not is_violated:
            return 0
        r = max(np.hypot(x, y), 1.0e-12)
        _, nearest_r, nearest_z = _cone_gap(size[0], size[1], r, z)
        fraction = INNER_FRACTION * nearest_r / r
        count = _add_row(1.0, 0.0, 0.0, fraction * x - x, 0, directions, changes)
        count = _add_row(0.0, 1.0, 0.0, fraction * y - y, count, directions, changes)
        return _add_row(0.0, 0.0, 1.0, INNER_FRACTION * nearest_z - z, count, directions, changes)
    is_cylinder = shape == CYLINDER
    count = _axis_row(2, 0.5 * size[0], point, is_violated, 0, directions, changes) if is_cylinder else 0
    radius, height = size[1] if is_cylinder else size[0], 0.0 if is_cylinder else z
    limit, distance = _inner_limit(radius), np.sqrt(x * x + y * y + height * height)
    if limit == 0.0:
        for axis in range(2 if is_cylinder else 3):
            count = _axis_row(axis, 0.0, point, is_violated, count, directions, changes)
    elif is_violated and distance > limit:
        count = _add_row(x / distance, y / distance, height / distance, limit - distance, count, directions, changes)
    return count


@njit(cache=True, nogil=True)
def _pose_rows(
    constraints: ConstraintArrays, constraint: int, region: int, is_violated: bool, workspace: Workspace
) -> int:
    """Writes the linearised rows of a pose constraint in the reference frame; returns the number of rows."""
    directions, changes = workspace.directions, workspace.changes
    if region < 0:
        kind, tolerances = constraints.kinds[constraint], constraints.tolerances[constraint]
        return _angle_rows(kind, workspace.deviation, tolerances, is_violated, directions, changes)
    first_face, end = constraints.face_ranges[region, 0], constraints.face_ranges[region, 1]
    shape, size, pose = constraints.shapes[region], constraints.sizes[region], constraints.poses[region]
    count = _region_rows(
        shape, size, constraints.faces[first_face:end], workspace.deviation, is_violated, directions, changes
    )
    for row in range(count):
        x, y, z = directions[row, 0], directions[row, 1], directions[row, 2]
        for axis in range(3):
            directions[row, axis] = pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2] * z
    return count


@njit(cache=True, nogil=True)
def _add_gradients(
    constraints: ConstraintArrays,
    mapping: JointMapping,
    constraint: int,
    count: int,
    first: int,
    workspace: Workspace,
    jacobian: Array,
    targets: Array,
) -> None:
    """Writes the Jacobian rows `first` to `first + count` and the target changes of a pose constraint."""
    tree, signs, reference, pose = constraints.tree, constraints.signs[constraint], workspace.reference, workspace.pose
    is_rotation = constraints.kinds[constraint] != POINT
    px, py, pz = reference[0, 3], reference[1, 3], reference[2, 3]  # origin of the link in the planning frame
    for column in range(3):
        px += reference[0, column] * pose[column, 3]
        py += reference[1, column] * pose[column, 3]
        pz += reference[2, column] * pose[column, 3]
    jacobian[first : first + count] = 0.0
    for row in range(count):
        targets[first + row] = workspace.changes[row]
    for joint in range(len(signs)):
        driver = mapping.drivers[joint]
        if signs[joint] == 0.0 or driver < 0 or (is_rotation and tree.prismatic[joint]):
            continue
        frame, axis = workspace.placements[joint], tree.axes[joint]
        x = frame[0, 0] * axis[0] + frame[0, 1] * axis[1] + frame[0, 2] * axis[2]
        y = frame[1, 0] * axis[0] + frame[1, 1] * axis[1] + frame[1, 2] * axis[2]
        z = frame[2, 0] * axis[0] + frame[2, 1] * axis[1] + frame[2, 2] * axis[2]
        if not is_rotation and not tree.prismatic[joint]:
            a, b, c = px - frame[0, 3], py - frame[1, 3], pz - frame[2, 3]
            x, y, z = y * c - z * b, z * a - x * c, x * b - y * a
        u = reference[0, 0] * x + reference[1, 0] * y + reference[2, 0] * z
        v = reference[0, 1] * x + reference[1, 1] * y + reference[2, 1] * z
        w = reference[0, 2] * x + reference[1, 2] * y + reference[2, 2] * z
        scale = signs[joint] * mapping.gains[joint]
        for row in range(count):
            direction = workspace.directions[row]
            jacobian[first + row, driver] += scale * (direction[0] * u + direction[1] * v + direction[2] * w)


@njit(cache=True, nogil=True)
def _write_step(
    jacobian: Array, targets: Array, count: int, free: NDArray[np.bool_], factor: Array, solution: Array, step: Array
) -> None:
    """Writes the least-squares step of the free joints, scaled to at most MAX_STEP per joint."""
    damped_step(jacobian, targets, count, DAMPING, free, step, factor, solution)
    max_change = 1.0e-12
    for joint in range(len(step)):
        max_change = max(max_change, abs(step[joint]))
    fraction = min(1.0, MAX_STEP / max_change)
    for joint in range(len(step)):
        step[joint] *= fraction


@njit(cache=True, nogil=True)
def project(
    constraints: ConstraintArrays, mapping: JointMapping, state: Array, lower: Array, upper: Array, steps: int
) -> bool:
    """Moves a state by least-squares steps within bounds until all pose constraints hold.

    A joint at a bound stays fixed if the step would violate the bound; the step is then computed again. Joint
    constraints do not affect the steps and are checked at the end.

    Args:
        constraints: Constraints as arrays.
        mapping: Mapping of the state to the joints of the constraints.
        state: Joint vector, changed in place, shape (joints,) [rad or m].
        lower: Lower bounds, shape (joints,).
        upper: Upper bounds, shape (joints,).
        steps: Maximum number of steps.

    Returns:
        Whether all pose and joint constraints hold.
    """
    width, max_rows = len(state), 3 * len(constraints.kinds) + len(constraints.faces)
    workspace = _new_workspace(constraints)
    jacobian, targets, factor = np.empty((max_rows, width)), np.empty(max_rows), np.empty((max_rows, max_rows))
    solution, step, free = np.empty(max_rows), np.empty(width), np.empty(width, dtype=np.bool_)
    for joint in range(width):
        state[joint] = min(max(state[joint], lower[joint]), upper[joint])
    for _ in range(steps):
        _place_joints(constraints, mapping, state, workspace)
        count, is_violated = 0, False
        for constraint in range(len(constraints.kinds)):
            excess, region = _pose_excess(constraints, constraint, workspace)
            rows = _pose_rows(constraints, constraint, region, excess > TOLERANCE, workspace)
            _add_gradients(constraints, mapping, constraint, rows, count, workspace, jacobian, targets)
            count, is_violated = count + rows, is_violated or excess > TOLERANCE
        if not is_violated:
            return _joint_excess(constraints, workspace.values) <= TOLERANCE
        free[:] = True
        for _attempt in range(3):
            _write_step(jacobian, targets, count, free, factor, solution, step)
            is_blocked = False
            for joint in range(width):
                if free[joint] and (
                    (state[joint] <= lower[joint] and step[joint] < 0.0)
                    or (state[joint] >= upper[joint] and step[joint] > 0.0)
                ):
                    free[joint], is_blocked = False, True
            if not is_blocked:
                break
        for joint in range(width):
            state[joint] = min(max(state[joint] + step[joint], lower[joint]), upper[joint])
    return False


@njit(cache=True, nogil=True)
def walk(
    constraints: ConstraintArrays,
    mapping: JointMapping,
    start: Array,
    target: Array,
    lower: Array,
    upper: Array,
    max_step: float,
    min_step: float,
    step: float,
    out: Array,
) -> int:
    """Walks from a state towards a target along the constraints, by straight steps and projections.

    The step length is halved after a failed step and doubled after a successful step.

    Args:
        constraints: Constraints as arrays, satisfied at the start.
        mapping: Mapping of the states to the joints of the constraints.
        start: Start state, shape (joints,).
        target: Target state, shape (joints,).
        lower: Lower bounds of projected states, shape (joints,).
        upper: Upper bounds of projected states, shape (joints,).
        max_step: Maximum length of a step before projection [rad or m].
        min_step: Minimum length of a step [rad or m].
        step: Maximum joint displacement between checked states [rad or m].
        out: Written states, shape (capacity, joints) [rad or m].

    Returns:
        Number of written states. The walk ends exactly at the target, at a state from which no step leads closer to the
        target, or when `out` is full.
    """
    workspace, state, sampled = _new_workspace(constraints), np.empty(len(start)), np.empty(len(start))
    current, step_length, count = start.copy(), max_step, 0
    while count < len(out):
        distance = joint_distance(current, target)
        if distance < SAME_STATE_DISTANCE:
            break
        length = min(step_length, distance)
        for joint in range(len(state)):
            state[joint] = target[joint]
            if length < distance:
                state[joint] = current[joint] + length / distance * (target[joint] - current[joint])
        is_nearer = _excess(constraints, mapping, state, workspace) <= TOLERANCE or project(
            constraints, mapping, state, lower, upper, MAX_PROJECTION_STEPS
        )
        is_nearer = (
            is_nearer
            and joint_distance(state, target) <= distance - MIN_PROGRESS * length
            and joint_distance(current, state) <= 2.0 * length
        )
        if is_nearer and _edge_satisfied(constraints, mapping, current, state, step, sampled, workspace):
            current[:] = state
            out[count] = state
            count, step_length = count + 1, min(max_step, 2.0 * step_length)
            continue
        step_length = 0.5 * length
        if step_length < (min_step if is_nearer else max(min_step, 0.25 * max_step)):
            break
    return count
