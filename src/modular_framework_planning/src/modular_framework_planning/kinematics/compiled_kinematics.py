# SPDX-License-Identifier: BSD-3-Clause
"""Compiled forward kinematics, about one microsecond per state, and least-squares inverse kinematics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array

POSE_SIZE = 6  # rows of a pose error: translation and rotation vector
SMALL_ANGLE = 1.0e-8  # a rotation with a smaller sine is treated as a rotation by 0 or pi
MAX_STEP = 0.5  # maximum joint displacement in a step of `converge` [rad or m]
MAX_SEED_STEP = 0.3  # maximum joint displacement in a step of `approach_seed` [rad or m]


class Tree(NamedTuple):
    """Joints with one degree of freedom, parents before children.

    Attributes:
        parents: Index of the parent joint, -1 for the planning frame, shape (n,).
        placements: Pose of each joint at position zero in its parent's frame, shape (n, 3, 4).
        axes: Unit axis of each joint in the joint's frame, shape (n, 3).
        prismatic: Whether each joint is prismatic instead of revolute, shape (n,).
    """

    parents: NDArray[np.int64]
    placements: Array
    axes: Array
    prismatic: NDArray[np.bool_]


class Chain(NamedTuple):
    """A kinematic chain from the planning frame to a tip, driven by the joint values of a group.

    The value of a joint is offset + gain * values[driver], or offset if the driver is -1.

    Attributes:
        tree: Joints of the chain, each the parent of the next.
        tip: Pose of the tip in the last joint's frame, shape (3, 4).
        drivers: Index of the group value that drives each joint, -1 for none, shape (n,).
        gains: Gain of each joint, shape (n,).
        offsets: Offset of each joint, shape (n,) [rad or m].
    """

    tree: Tree
    tip: Array
    drivers: NDArray[np.int64]
    gains: Array
    offsets: Array


@njit(cache=True, nogil=True)
def joint_distance(first: Array, second: Array) -> float:
    """Returns the Euclidean distance between two joint vectors, shape (joints,) each [rad or m]."""
    squared_distance = 0.0
    for joint in range(len(first)):
        squared_distance += (second[joint] - first[joint]) ** 2
    return np.sqrt(squared_distance)


@njit(cache=True, nogil=True)
def _write_column(frames: Array, parent: int, a: float, b: float, c: float, column: int, index: int) -> None:
    """Writes a column of frames[index], which is (a, b, c) in the parent's frame; column 3 is a point."""
    for row in range(3):
        if parent < 0:
            value = a if row == 0 else (b if row == 1 else c)
        else:
            value = frames[parent, row, 0] * a + frames[parent, row, 1] * b + frames[parent, row, 2] * c
            if column == 3:
                value += frames[parent, row, 3]
        frames[index, row, column] = value


@njit(cache=True, nogil=True)
def joint_placements(tree: Tree, positions: Array, out: Array) -> None:
    """Computes the pose of every joint in the planning frame.

    Args:
        tree: Joints.
        positions: Joint values, including mimic joints, shape (n,) [rad or m].
        out: Written poses, shape (n, 3, 4).
    """
    placements, axes = tree.placements, tree.axes
    for index in range(len(tree.parents)):
        parent, value = tree.parents[index], positions[index]
        x, y, z = axes[index, 0], axes[index, 1], axes[index, 2]
        slide, sine, cosine = value, 0.0, 1.0
        if not tree.prismatic[index]:
            slide, sine, cosine = 0.0, np.sin(value), np.cos(value)
        versine = 1.0 - cosine
        for column in range(4):  # rotation (Rodrigues) or translation of the joint, transformed to the parent's frame
            if column == 0:
                a, b, c = cosine + x * x * versine, y * x * versine + z * sine, z * x * versine - y * sine
            elif column == 1:
                a, b, c = x * y * versine - z * sine, cosine + y * y * versine, z * y * versine + x * sine
            elif column == 2:
                a, b, c = x * z * versine + y * sine, y * z * versine - x * sine, cosine + z * z * versine
            else:
                a, b, c = slide * x, slide * y, slide * z
            d = placements[index, 0, 0] * a + placements[index, 0, 1] * b + placements[index, 0, 2] * c
            e = placements[index, 1, 0] * a + placements[index, 1, 1] * b + placements[index, 1, 2] * c
            f = placements[index, 2, 0] * a + placements[index, 2, 1] * b + placements[index, 2, 2] * c
            if column == 3:
                d, e, f = d + placements[index, 0, 3], e + placements[index, 1, 3], f + placements[index, 2, 3]
            _write_column(out, parent, d, e, f, column, index)


@njit(cache=True, nogil=True)
def rotation_vector(first: Array, second: Array, out: Array) -> None:
    """Writes the rotation vector from `first` to `second`: log(second first^T), in their common frame [rad].

    Args:
        first: Rotation matrix or pose, shape (3, 3) or (3, 4).
        second: Rotation matrix or pose, shape (3, 3) or (3, 4).
        out: Written rotation vector, shape (3,).
    """
    xx = second[0, 0] * first[0, 0] + second[0, 1] * first[0, 1] + second[0, 2] * first[0, 2]
    xy = second[0, 0] * first[1, 0] + second[0, 1] * first[1, 1] + second[0, 2] * first[1, 2]
    xz = second[0, 0] * first[2, 0] + second[0, 1] * first[2, 1] + second[0, 2] * first[2, 2]
    yx = second[1, 0] * first[0, 0] + second[1, 1] * first[0, 1] + second[1, 2] * first[0, 2]
    yy = second[1, 0] * first[1, 0] + second[1, 1] * first[1, 1] + second[1, 2] * first[1, 2]
    yz = second[1, 0] * first[2, 0] + second[1, 1] * first[2, 1] + second[1, 2] * first[2, 2]
    zx = second[2, 0] * first[0, 0] + second[2, 1] * first[0, 1] + second[2, 2] * first[0, 2]
    zy = second[2, 0] * first[1, 0] + second[2, 1] * first[1, 1] + second[2, 2] * first[1, 2]
    zz = second[2, 0] * first[2, 0] + second[2, 1] * first[2, 1] + second[2, 2] * first[2, 2]
    x, y, z = zy - yz, xz - zx, yx - xy
    sine = 0.5 * np.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (xx + yy + zz - 1.0)
    angle = np.arctan2(sine, cosine)
    if sine > SMALL_ANGLE:
        scale = 0.5 * angle / sine
        out[0], out[1], out[2] = scale * x, scale * y, scale * z
    elif cosine > 0.0:
        out[0], out[1], out[2] = 0.5 * x, 0.5 * y, 0.5 * z
    else:  # rotation by pi, whose axis is the longest column of rotation + identity
        if xx >= yy and xx >= zz:
            out[0], out[1], out[2] = xx + 1.0, yx, zx
        elif yy >= zz:
            out[0], out[1], out[2] = xy, yy + 1.0, zy
        else:
            out[0], out[1], out[2] = xz, yz, zz + 1.0
        norm = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
        for row in range(3):
            out[row] *= angle / norm


@njit(cache=True, nogil=True)
def pose_error(
    chain: Chain, values: Array, target: Array, jacobian: Array, error: Array, positions: Array, poses: Array
) -> float:
    """Computes the pose error of the tip and its geometric Jacobian; returns the norm of the error.

    Args:
        chain: Joints from the planning frame to the tip.
        values: Joint values of the group, shape (group,) [rad or m].
        target: Target pose of the tip in the planning frame, shape (3, 4).
        jacobian: Written Jacobian, linear rows above angular rows, shape (6, group).
        error: Written difference from tip to target, linear [m] above angular [rad], shape (6,).
        positions: Working memory, shape (joints,).
        poses: Working memory, shape (joints + 1, 3, 4); the last pose is the pose of the tip.
    """
    count = len(chain.drivers)
    for index in range(count):
        driver = chain.drivers[index]
        positions[index] = chain.offsets[index]
        if driver >= 0:
            positions[index] += chain.gains[index] * values[driver]
    joint_placements(chain.tree, positions, poses)
    end = chain.tip
    for column in range(4):
        _write_column(poses, count - 1, end[0, column], end[1, column], end[2, column], column, count)
    tip = poses[count]
    for row in range(3):
        error[row] = target[row, 3] - tip[row, 3]
    rotation_vector(tip, target, error[3:])
    jacobian[:] = 0.0
    for index in range(count):
        driver, gain = chain.drivers[index], chain.gains[index]
        if driver < 0:
            continue
        u, v, w = chain.tree.axes[index, 0], chain.tree.axes[index, 1], chain.tree.axes[index, 2]
        x = poses[index, 0, 0] * u + poses[index, 0, 1] * v + poses[index, 0, 2] * w
        y = poses[index, 1, 0] * u + poses[index, 1, 1] * v + poses[index, 1, 2] * w
        z = poses[index, 2, 0] * u + poses[index, 2, 1] * v + poses[index, 2, 2] * w
        if chain.tree.prismatic[index]:
            jacobian[0, driver] += gain * x
            jacobian[1, driver] += gain * y
            jacobian[2, driver] += gain * z
        else:
            a = poses[count, 0, 3] - poses[index, 0, 3]
            b = poses[count, 1, 3] - poses[index, 1, 3]
            c = poses[count, 2, 3] - poses[index, 2, 3]
            jacobian[0, driver] += gain * (y * c - z * b)
            jacobian[1, driver] += gain * (z * a - x * c)
            jacobian[2, driver] += gain * (x * b - y * a)
            jacobian[3, driver] += gain * x
            jacobian[4, driver] += gain * y
            jacobian[5, driver] += gain * z
    squared_norm = 0.0
    for row in range(POSE_SIZE):
        squared_norm += error[row] * error[row]
    return np.sqrt(squared_norm)


@njit(cache=True, nogil=True)
def damped_step(
    jacobian: Array,
    error: Array,
    rows: int,
    damping: float,
    free: NDArray[np.bool_],
    step: Array,
    factor: Array,
    solution: Array,
) -> None:
    """Solves min |J step - error|^2 + damping |step|^2 over the free joints by a Cholesky factor of J J^T + damping I.

    Args:
        jacobian: J, shape (>= rows, joints).
        error: Right-hand side, shape (>= rows,).
        rows: Number of rows of the problem.
        damping: Damping factor.
        free: Whether each joint may move, shape (joints,); fixed joints get a step of 0.
        step: Written step, shape (joints,).
        factor: Working memory, shape (>= rows, >= rows).
        solution: Working memory, shape (>= rows,).
    """
    width = jacobian.shape[1]
    for row in range(rows):
        for column in range(row + 1):
            value = damping if row == column else 0.0
            for joint in range(width):
                if free[joint]:
                    value += jacobian[row, joint] * jacobian[column, joint]
            for other in range(column):
                value -= factor[row, other] * factor[column, other]
            factor[row, column] = np.sqrt(max(value, 1e-30)) if row == column else value / factor[column, column]
    for row in range(rows):
        value = error[row]
        for other in range(row):
            value -= factor[row, other] * solution[other]
        solution[row] = value / factor[row, row]
    for row in range(rows - 1, -1, -1):
        value = solution[row]
        for other in range(row + 1, rows):
            value -= factor[other, row] * solution[other]
        solution[row] = value / factor[row, row]
    for joint in range(width):
        step[joint] = 0.0
        if free[joint]:
            for row in range(rows):
                step[joint] += jacobian[row, joint] * solution[row]


@njit(cache=True, nogil=True)
def converge(
    chain: Chain, values: Array, target: Array, lower: Array, upper: Array, tolerance: float, steps: int
) -> bool:
    """Moves joint values within bounds until the tip is at the target; returns whether the tip is at the target.

    The damping of a step grows with the squared error, as in T. Sugihara, "Solvability-unconcerned inverse kinematics
    by the Levenberg-Marquardt method", IEEE T-RO 27 (2011). A joint at a bound stays fixed if the step would violate
    the bound; the step is then computed again.

    Args:
        chain: Joints from the planning frame to the tip.
        values: Joint values of the group, changed in place, shape (group,) [rad or m].
        target: Target pose of the tip in the planning frame, shape (3, 4).
        lower: Lower bounds of the group, shape (group,).
        upper: Upper bounds of the group, shape (group,).
        tolerance: Tolerance of the pose error norm.
        steps: Maximum number of steps.
    """
    width = len(values)
    jacobian, error, factor = np.empty((POSE_SIZE, width)), np.empty(POSE_SIZE), np.zeros((POSE_SIZE, POSE_SIZE))
    positions, poses = np.empty(len(chain.drivers)), np.empty((len(chain.drivers) + 1, 3, 4))
    step, solution, free = np.empty(width), np.empty(POSE_SIZE), np.empty(width, dtype=np.bool_)
    for _ in range(steps):
        error_norm = pose_error(chain, values, target, jacobian, error, positions, poses)
        if error_norm < tolerance:
            return True
        damping = min(1.0e-3, 0.1 * error_norm * error_norm) + 1.0e-14
        free[:] = True
        for _attempt in range(2):
            damped_step(jacobian, error, POSE_SIZE, damping, free, step, factor, solution)
            is_blocked = False
            for joint in range(width):
                if free[joint] and (
                    (values[joint] <= lower[joint] and step[joint] < 0.0)
                    or (values[joint] >= upper[joint] and step[joint] > 0.0)
                ):
                    free[joint] = False
                    is_blocked = True
            if not is_blocked:
                break
        max_change = 1.0e-12
        for joint in range(width):
            if free[joint]:
                max_change = max(max_change, abs(step[joint]))
        scale = min(1.0, MAX_STEP / max_change)
        for joint in range(width):
            if free[joint]:
                values[joint] = min(max(values[joint] + scale * step[joint], lower[joint]), upper[joint])
    return bool(pose_error(chain, values, target, jacobian, error, positions, poses) < tolerance)


@njit(cache=True, nogil=True)
def polish(
    chain: Chain,
    candidates: Array,
    target: Array,
    lower: Array,
    upper: Array,
    tolerance: float,
    max_error: float,
    steps: int,
) -> NDArray[np.bool_]:
    """Refines approximate solutions by `converge`; returns whether each candidate converged, shape (k,).

    Args:
        chain: Joints from the planning frame to the tip.
        candidates: Joint values, changed in place, shape (k, group) [rad or m].
        target: Target pose of the tip in the planning frame, shape (3, 4).
        lower: Lower bounds of the group, shape (group,).
        upper: Upper bounds of the group, shape (group,).
        tolerance: Tolerance of the pose error norm.
        max_error: Pose error norm above which a candidate is rejected.
        steps: Maximum number of steps.
    """
    count, width = candidates.shape
    has_converged = np.zeros(count, dtype=np.bool_)
    jacobian, error = np.empty((POSE_SIZE, width)), np.empty(POSE_SIZE)
    positions, poses = np.empty(len(chain.drivers)), np.empty((len(chain.drivers) + 1, 3, 4))
    for index in range(count):
        error_norm = pose_error(chain, candidates[index], target, jacobian, error, positions, poses)
        if error_norm < max_error:
            has_converged[index] = error_norm < tolerance or converge(
                chain, candidates[index], target, lower, upper, tolerance, steps
            )
    return has_converged


@njit(cache=True, nogil=True)
def search(
    chain: Chain, starts: Array, target: Array, lower: Array, upper: Array, tolerance: float, steps: int, max_count: int
) -> NDArray[np.bool_]:
    """Runs `converge` from each start until `max_count` solutions are found; returns whether each start converged.

    Args:
        chain: Joints from the planning frame to the tip.
        starts: Initial joint values, changed in place, shape (k, group) [rad or m].
        target: Target pose of the tip in the planning frame, shape (3, 4).
        lower: Lower bounds of the group, shape (group,).
        upper: Upper bounds of the group, shape (group,).
        tolerance: Tolerance of the pose error norm.
        steps: Maximum number of steps per start.
        max_count: Number of solutions that ends the search.
    """
    has_converged = np.zeros(len(starts), dtype=np.bool_)
    solution_count = 0
    for index in range(len(starts)):
        has_converged[index] = converge(chain, starts[index], target, lower, upper, tolerance, steps)
        solution_count += int(has_converged[index])
        if solution_count >= max_count:
            break
    return has_converged


@njit(cache=True, nogil=True)
def approach_seed(
    chain: Chain, values: Array, seed: Array, target: Array, lower: Array, upper: Array, tolerance: float, steps: int
) -> None:
    """Moves a solution of a redundant chain closer to the seed while the tip stays at the target.

    Each step projects the difference from the seed onto the null space of the Jacobian, then calls `converge`. The
    search ends if the step is short, does not converge, or leads away from the seed.

    Args:
        chain: Joints from the planning frame to the tip.
        values: Joint values of the group, changed in place, shape (group,) [rad or m].
        seed: Joint values to approach, shape (group,) [rad or m].
        target: Pose of the tip in the planning frame, shape (3, 4).
        lower: Lower bounds of the group, shape (group,).
        upper: Upper bounds of the group, shape (group,).
        tolerance: Tolerance of the pose error norm.
        steps: Maximum number of steps.
    """
    width = len(values)
    jacobian, error, factor = np.empty((POSE_SIZE, width)), np.empty(POSE_SIZE), np.zeros((POSE_SIZE, POSE_SIZE))
    positions, poses = np.empty(len(chain.drivers)), np.empty((len(chain.drivers) + 1, 3, 4))
    correction, solution, free = np.empty(width), np.empty(POSE_SIZE), np.ones(width, dtype=np.bool_)
    for _ in range(steps):
        pose_error(chain, values, target, jacobian, error, positions, poses)
        towards_seed = seed - values
        for row in range(POSE_SIZE):
            error[row] = 0.0
            for joint in range(width):
                error[row] += jacobian[row, joint] * towards_seed[joint]
        damped_step(jacobian, error, POSE_SIZE, 1.0e-9, free, correction, factor, solution)
        trial = values.copy()
        max_change = 0.0
        for joint in range(width):
            move = towards_seed[joint] - correction[joint]
            max_change = max(max_change, abs(move))
            move *= min(1.0, MAX_SEED_STEP / max(abs(move), 1e-12))
            trial[joint] = min(max(values[joint] + move, lower[joint]), upper[joint])
        if max_change < 1.0e-4 or not converge(chain, trial, target, lower, upper, tolerance, 8):
            return
        if np.sum((trial - seed) ** 2) >= np.sum((values - seed) ** 2):
            return
        values[:] = trial


@njit(cache=True, nogil=True)
def unique_rows(rows: Array, is_revolute: NDArray[np.bool_], tolerance: float) -> NDArray[np.int64]:
    """Returns the indices of the rows that differ from all previous rows.

    Args:
        rows: Joint vectors, shape (k, group) [rad or m].
        is_revolute: Whether each joint is compared modulo 2 pi, shape (group,).
        tolerance: Maximum joint difference of equal rows [rad or m].
    """
    kept = np.empty(len(rows), dtype=np.int64)
    count = 0
    for index in range(len(rows)):
        is_new = True
        for earlier in range(count):
            is_same = True
            for joint in range(rows.shape[1]):
                difference = abs(rows[index, joint] - rows[kept[earlier], joint])
                if is_revolute[joint]:
                    difference = abs(difference - 2.0 * np.pi * np.round(difference / (2.0 * np.pi)))
                if difference > tolerance:
                    is_same = False
                    break
            if is_same:
                is_new = False
                break
        if is_new:
            kept[count] = index
            count += 1
    return kept[:count]


@njit(cache=True, nogil=True)
def full_rotations(rows: Array, is_revolute: NDArray[np.bool_], lower: Array, upper: Array, max_count: int) -> Array:
    """Returns the joint vectors within bounds that differ from a row by full rotations, shape (n, group).

    Args:
        rows: Joint vectors, shape (k, group) [rad or m].
        is_revolute: Whether each joint is revolute, shape (group,).
        lower: Lower bounds of the group, shape (group,).
        upper: Upper bounds of the group, shape (group,).
        max_count: Maximum number of returned vectors.
    """
    width = rows.shape[1]
    result = np.empty((max_count, width))
    count = 0
    first, last, current = np.empty(width), np.empty(width), np.empty(width)
    for index in range(len(rows)):
        is_possible = True
        for joint in range(width):
            value = rows[index, joint]
            first[joint] = last[joint] = value
            if is_revolute[joint]:
                first[joint] = value + 2.0 * np.pi * np.ceil((lower[joint] - 1e-9 - value) / (2.0 * np.pi))
                last[joint] = value + 2.0 * np.pi * np.floor((upper[joint] + 1e-9 - value) / (2.0 * np.pi))
            is_possible &= (
                lower[joint] - 1e-9 <= first[joint] <= last[joint] + 1e-9 and last[joint] <= upper[joint] + 1e-9
            )
        if not is_possible:
            continue
        current[:] = first
        while count < max_count:
            for joint in range(width):
                result[count, joint] = min(max(current[joint], lower[joint]), upper[joint])
            count += 1
            joint = 0
            while joint < width and current[joint] + 2.0 * np.pi > last[joint] + 1e-6:
                current[joint] = first[joint]
                joint += 1
            if joint == width:
                break
            current[joint] += 2.0 * np.pi
    return result[:count]


def warm_up() -> None:
    """Compiles the kernels that other modules call, or loads them from the cache."""
    width = 7
    placements = np.tile(np.eye(3, 4), (width, 1, 1))
    placements[:, 2, 3] = 0.1
    axes = np.eye(3)[np.arange(width) % 3]
    tree = Tree(np.arange(-1, width - 1), placements, axes, np.zeros(width, dtype=bool))
    chain = Chain(tree, np.eye(3, 4), np.arange(width), np.ones(width), np.zeros(width))
    values, bound, out = np.full(width, 0.2), np.full(width, 3.0), np.empty((width, 3, 4))
    is_revolute = np.ones(width, dtype=bool)
    joint_placements(tree, values, out)
    target = out[-1].copy()
    rows = np.full((2, width), 0.21)
    polish(chain, rows, target, -bound, bound, 1.0e-8, 0.5, 2)
    search(chain, rows, target, -bound, bound, 1.0e-8, 2, 1)
    approach_seed(chain, values, rows[0], target, -bound, bound, 1.0e-8, 1)
    unique_rows(rows, is_revolute, 1.0e-5)
    full_rotations(rows, is_revolute, -bound, bound, 4)
