# SPDX-License-Identifier: BSD-3-Clause
"""Forward kinematics and least-squares inverse kinematics as compiled loops: a microsecond a state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array

POSE_SIZE = 6
SMALL_ANGLE = 1.0e-8
WIDEST_STEP = 0.5  # [rad or m]; of any joint in one step of the search


class Tree(NamedTuple):
    """Joints of one degree of freedom, parents before children.

    Attributes:
        parents: number of the joint each one hangs on, -1 for the planning frame; shape (n,).
        placements: pose of the joint at zero in its parent's frame, rotation beside translation; shape (n, 3, 4).
        axes: unit axis in the joint's own frame; shape (n, 3).
        prismatic: whether it slides along the axis instead of turning about it; shape (n,).
    """

    parents: NDArray[np.int64]
    placements: Array
    axes: Array
    prismatic: NDArray[np.bool_]


class Chain(NamedTuple):
    """The way from the planning frame to a tip, driven by the joint values of a group.

    Attributes:
        tree: the joints on the way, each hanging on the one before.
        tip: pose of the tip in the last joint's frame; shape (3, 4).
        drivers: which group value moves each joint, -1 for none; gains: by how much; shape (n,).
        offsets: value of each joint where all group values are 0; shape (n,).
    """

    tree: Tree
    tip: Array
    drivers: NDArray[np.int64]
    gains: Array
    offsets: Array


@njit(cache=True, nogil=True)
def _place(frames: Array, parent: int, a: float, b: float, c: float, column: int, out: Array, number: int) -> None:
    """Writes the vector (a, b, c), given in a parent's frame, as a column of out[number]; column 3 is a point."""
    for row in range(3):
        if parent < 0:
            value = a if row == 0 else (b if row == 1 else c)
        else:
            value = frames[parent, row, 0] * a + frames[parent, row, 1] * b + frames[parent, row, 2] * c
            if column == 3:
                value += frames[parent, row, 3]
        out[number, row, column] = value


@njit(cache=True, nogil=True)
def joint_placements(tree: Tree, positions: Array, out: Array) -> None:
    """Computes the pose of every joint in the planning frame.

    Args:
        tree: the joints.
        positions: one value a joint [rad or m], mimic joints included.
        out: filled; shape (n, 3, 4), rotation beside translation.
    """
    at, axes = tree.placements, tree.axes
    for number in range(len(tree.parents)):
        parent, value = tree.parents[number], positions[number]
        x, y, z = axes[number, 0], axes[number, 1], axes[number, 2]
        slide, sine, cosine = value, 0.0, 1.0
        if not tree.prismatic[number]:
            slide, sine, cosine = 0.0, np.sin(value), np.cos(value)
        rest = 1.0 - cosine
        for column in range(4):  # columns of the joint's own turn (Rodrigues) or slide, carried into its parent's frame
            if column == 0:
                a, b, c = cosine + x * x * rest, y * x * rest + z * sine, z * x * rest - y * sine
            elif column == 1:
                a, b, c = x * y * rest - z * sine, cosine + y * y * rest, z * y * rest + x * sine
            elif column == 2:
                a, b, c = x * z * rest + y * sine, y * z * rest - x * sine, cosine + z * z * rest
            else:
                a, b, c = slide * x, slide * y, slide * z
            d = at[number, 0, 0] * a + at[number, 0, 1] * b + at[number, 0, 2] * c
            e = at[number, 1, 0] * a + at[number, 1, 1] * b + at[number, 1, 2] * c
            f = at[number, 2, 0] * a + at[number, 2, 1] * b + at[number, 2, 2] * c
            if column == 3:
                d, e, f = d + at[number, 0, 3], e + at[number, 1, 3], f + at[number, 2, 3]
            _place(out, parent, d, e, f, column, out, number)


@njit(cache=True, nogil=True)
def rotation_vector(first: Array, second: Array, out: Array) -> None:
    """Writes the rotation from `first` to `second` (leading 3 x 3 blocks) as a vector in the common frame [rad]."""
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
    else:  # half a turn: the axis is the longest column of turn + identity
        if xx >= yy and xx >= zz:
            out[0], out[1], out[2] = xx + 1.0, yx, zx
        elif yy >= zz:
            out[0], out[1], out[2] = xy, yy + 1.0, zy
        else:
            out[0], out[1], out[2] = xz, yz, zz + 1.0
        size = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
        for row in range(3):
            out[row] *= angle / size


@njit(cache=True, nogil=True)
def pose_error(
    chain: Chain, values: Array, target: Array, jacobian: Array, error: Array, positions: Array, poses: Array
) -> float:
    """Compares the tip with a target.

    Args:
        chain: the joints from the planning frame to the tip.
        values: the group's joint values [rad or m].
        target: pose of the tip in the planning frame, shape (3, 4).
        jacobian: filled; how the values move the tip, linear above angular, shape (6, group).
        error: filled; what is missing to the target, linear [m] above angular [rad], shape (6,).
        positions: working memory, shape (joints,).
        poses: working memory, shape (joints + 1, 3, 4); the last one is the tip's pose.

    Returns:
        The length of the error.
    """
    count = len(chain.drivers)
    for number in range(count):
        driver = chain.drivers[number]
        positions[number] = chain.offsets[number]
        if driver >= 0:
            positions[number] += chain.gains[number] * values[driver]
    joint_placements(chain.tree, positions, poses)
    end = chain.tip
    for column in range(4):
        _place(poses, count - 1, end[0, column], end[1, column], end[2, column], column, poses, count)
    tip = poses[count]
    for row in range(3):
        error[row] = target[row, 3] - tip[row, 3]
    rotation_vector(tip, target, error[3:])
    jacobian[:] = 0.0
    for number in range(count):
        driver, gain = chain.drivers[number], chain.gains[number]
        if driver < 0:
            continue
        u, v, w = chain.tree.axes[number, 0], chain.tree.axes[number, 1], chain.tree.axes[number, 2]
        x = poses[number, 0, 0] * u + poses[number, 0, 1] * v + poses[number, 0, 2] * w
        y = poses[number, 1, 0] * u + poses[number, 1, 1] * v + poses[number, 1, 2] * w
        z = poses[number, 2, 0] * u + poses[number, 2, 1] * v + poses[number, 2, 2] * w
        if chain.tree.prismatic[number]:
            jacobian[0, driver] += gain * x
            jacobian[1, driver] += gain * y
            jacobian[2, driver] += gain * z
        else:
            a = poses[count, 0, 3] - poses[number, 0, 3]
            b = poses[count, 1, 3] - poses[number, 1, 3]
            c = poses[count, 2, 3] - poses[number, 2, 3]
            jacobian[0, driver] += gain * (y * c - z * b)
            jacobian[1, driver] += gain * (z * a - x * c)
            jacobian[2, driver] += gain * (x * b - y * a)
            jacobian[3, driver] += gain * x
            jacobian[4, driver] += gain * y
            jacobian[5, driver] += gain * z
    total = 0.0
    for row in range(POSE_SIZE):
        total += error[row] * error[row]
    return np.sqrt(total)


@njit(cache=True, nogil=True)
def damped_step(
    jacobian: Array,
    error: Array,
    rows: int,
    damping: float,
    free: NDArray[np.bool_],
    step: Array,
    square: Array,
    solved: Array,
) -> None:
    """Solves min |J step - error|^2 + damping |step|^2 over the free joints by a Cholesky factor of J J^T + damping.

    Args:
        jacobian: J, shape (rows or more, joints).
        error: shape (rows or more,).
        rows: how many of them count.
        damping: see above.
        free: which joints may move, shape (joints,); the others get a step of 0.
        step: filled, shape (joints,).
        square: working memory, shape (rows or more, rows or more).
        solved: working memory, shape (rows or more,).
    """
    width = jacobian.shape[1]
    for row in range(rows):
        for column in range(row + 1):
            value = damping if row == column else 0.0
            for joint in range(width):
                if free[joint]:
                    value += jacobian[row, joint] * jacobian[column, joint]
            for inner in range(column):
                value -= square[row, inner] * square[column, inner]
            square[row, column] = np.sqrt(max(value, 1e-30)) if row == column else value / square[column, column]
    for row in range(rows):
        value = error[row]
        for inner in range(row):
            value -= square[row, inner] * solved[inner]
        solved[row] = value / square[row, row]
    for row in range(rows - 1, -1, -1):
        value = solved[row]
        for inner in range(row + 1, rows):
            value -= square[inner, row] * solved[inner]
        solved[row] = value / square[row, row]
    for joint in range(width):
        step[joint] = 0.0
        if free[joint]:
            for row in range(rows):
                step[joint] += jacobian[row, joint] * solved[row]


@njit(cache=True, nogil=True)
def converge(
    chain: Chain, values: Array, target: Array, lower: Array, upper: Array, tolerance: float, steps: int
) -> bool:
    """Moves joint values, within bounds, until the tip is at the target; changes `values` in place.

    Args:
        chain: the joints from the planning frame to the tip.
        values: the group's joint values [rad or m].
        target: pose of the tip in the planning frame, shape (3, 4).
        lower: least values of the group's joints, shape (group,).
        upper: largest values, shape (group,).
        tolerance: length of the pose error to get below.
        steps: how many steps to try.
    """
    width = len(values)
    jacobian, error, square = np.empty((POSE_SIZE, width)), np.empty(POSE_SIZE), np.zeros((POSE_SIZE, POSE_SIZE))
    positions, poses = np.empty(len(chain.drivers)), np.empty((len(chain.drivers) + 1, 3, 4))
    step, solved, free = np.empty(width), np.empty(POSE_SIZE), np.empty(width, dtype=np.bool_)
    for _ in range(steps):
        size = pose_error(chain, values, target, jacobian, error, positions, poses)
        if size < tolerance:
            return True
        damping = min(1.0e-3, 0.1 * size * size) + 1.0e-14
        free[:] = True
        for _attempt in range(2):
            damped_step(jacobian, error, POSE_SIZE, damping, free, step, square, solved)
            blocked = False
            for joint in range(width):
                if free[joint] and (
                    (values[joint] <= lower[joint] and step[joint] < 0.0)
                    or (values[joint] >= upper[joint] and step[joint] > 0.0)
                ):
                    free[joint] = False
                    blocked = True
            if not blocked:
                break
        widest = 1.0e-12
        for joint in range(width):
            if free[joint]:
                widest = max(widest, abs(step[joint]))
        share = min(1.0, WIDEST_STEP / widest)
        for joint in range(width):
            if free[joint]:
                values[joint] = min(max(values[joint] + share * step[joint], lower[joint]), upper[joint])
    return bool(pose_error(chain, values, target, jacobian, error, positions, poses) < tolerance)


@njit(cache=True, nogil=True)
def polish(
    chain: Chain,
    candidates: Array,
    target: Array,
    lower: Array,
    upper: Array,
    tolerance: float,
    furthest: float,
    steps: int,
) -> NDArray[np.bool_]:
    """Drives approximate solutions to the target, in place; says which arrived.

    Args:
        chain: the joints from the planning frame to the tip.
        candidates: joint values, shape (k, group).
        target: pose of the tip in the planning frame, shape (3, 4).
        lower: least values of the group's joints, shape (group,).
        upper: largest values, shape (group,).
        tolerance: length of the pose error to get below.
        furthest: pose error above which a candidate is not a solution at all.
        steps: how many steps to try.
    """
    count, width = candidates.shape
    arrived = np.zeros(count, dtype=np.bool_)
    jacobian, error = np.empty((POSE_SIZE, width)), np.empty(POSE_SIZE)
    positions, poses = np.empty(len(chain.drivers)), np.empty((len(chain.drivers) + 1, 3, 4))
    for number in range(count):
        size = pose_error(chain, candidates[number], target, jacobian, error, positions, poses)
        if size < furthest:
            arrived[number] = size < tolerance or converge(
                chain, candidates[number], target, lower, upper, tolerance, steps
            )
    return arrived


@njit(cache=True, nogil=True)
def search(
    chain: Chain, starts: Array, target: Array, lower: Array, upper: Array, tolerance: float, steps: int, most: int
) -> NDArray[np.bool_]:
    """Runs `converge` from each start, in place, until `most` have arrived; says which did."""
    arrived = np.zeros(len(starts), dtype=np.bool_)
    found = 0
    for number in range(len(starts)):
        arrived[number] = converge(chain, starts[number], target, lower, upper, tolerance, steps)
        found += int(arrived[number])
        if found >= most:
            break
    return arrived


@njit(cache=True, nogil=True)
def approach_seed(
    chain: Chain, values: Array, seed: Array, target: Array, lower: Array, upper: Array, tolerance: float, steps: int
) -> None:
    """Moves a solution of a redundant chain nearer to the seed while the tip stays; changes `values` in place."""
    width = len(values)
    jacobian, error, square = np.empty((POSE_SIZE, width)), np.empty(POSE_SIZE), np.zeros((POSE_SIZE, POSE_SIZE))
    positions, poses = np.empty(len(chain.drivers)), np.empty((len(chain.drivers) + 1, 3, 4))
    back, solved, free = np.empty(width), np.empty(POSE_SIZE), np.ones(width, dtype=np.bool_)
    for _ in range(steps):
        pose_error(chain, values, target, jacobian, error, positions, poses)
        towards_seed = seed - values
        for row in range(POSE_SIZE):
            error[row] = 0.0
            for joint in range(width):
                error[row] += jacobian[row, joint] * towards_seed[joint]
        damped_step(jacobian, error, POSE_SIZE, 1.0e-9, free, back, square, solved)
        trial = values.copy()
        widest = 0.0
        for joint in range(width):
            move = towards_seed[joint] - back[joint]
            widest = max(widest, abs(move))
            trial[joint] = min(
                max(values[joint] + move * min(1.0, 0.3 / max(abs(move), 1e-12)), lower[joint]), upper[joint]
            )
        if widest < 1.0e-4 or not converge(chain, trial, target, lower, upper, tolerance, 8):
            return
        if np.sum((trial - seed) ** 2) >= np.sum((values - seed) ** 2):
            return
        values[:] = trial


@njit(cache=True, nogil=True)
def unique_rows(rows: Array, turning: NDArray[np.bool_], tolerance: float) -> NDArray[np.int64]:
    """Returns the numbers of rows that differ from all earlier ones; turning joints are compared modulo a turn."""
    kept = np.empty(len(rows), dtype=np.int64)
    count = 0
    for number in range(len(rows)):
        fresh = True
        for earlier in range(count):
            same = True
            for joint in range(rows.shape[1]):
                gap = abs(rows[number, joint] - rows[kept[earlier], joint])
                if turning[joint]:
                    gap = abs(gap - 2.0 * np.pi * np.round(gap / (2.0 * np.pi)))
                if gap > tolerance:
                    same = False
                    break
            if same:
                fresh = False
                break
        if fresh:
            kept[count] = number
            count += 1
    return kept[:count]


@njit(cache=True, nogil=True)
def whole_turns(rows: Array, turning: NDArray[np.bool_], lower: Array, upper: Array, most: int) -> Array:
    """Returns each row and what differs from it by whole turns of turning joints, within bounds; shape (n, group)."""
    width = rows.shape[1]
    result = np.empty((most, width))
    count = 0
    first, last, at = np.empty(width), np.empty(width), np.empty(width)
    for number in range(len(rows)):
        possible = True
        for joint in range(width):
            value = rows[number, joint]
            first[joint] = last[joint] = value
            if turning[joint]:
                first[joint] = value + 2.0 * np.pi * np.ceil((lower[joint] - 1e-9 - value) / (2.0 * np.pi))
                last[joint] = value + 2.0 * np.pi * np.floor((upper[joint] + 1e-9 - value) / (2.0 * np.pi))
            possible &= lower[joint] - 1e-9 <= first[joint] <= last[joint] + 1e-9 and last[joint] <= upper[joint] + 1e-9
        if not possible:
            continue
        at[:] = first
        while count < most:
            for joint in range(width):
                result[count, joint] = min(max(at[joint], lower[joint]), upper[joint])
            count += 1
            joint = 0
            while joint < width and at[joint] + 2.0 * np.pi > last[joint] + 1e-6:
                at[joint] = first[joint]
                joint += 1
            if joint == width:
                break
            at[joint] += 2.0 * np.pi
    return result[:count]


def warm_up() -> None:
    """Compiles every loop that is called from outside, or loads it from the cache."""
    width = 7
    at = np.tile(np.eye(3, 4), (width, 1, 1))
    at[:, 2, 3] = 0.1
    axes = np.eye(3)[np.arange(width) % 3]
    tree = Tree(np.arange(-1, width - 1), at, axes, np.zeros(width, dtype=bool))
    chain = Chain(tree, np.eye(3, 4), np.arange(width), np.ones(width), np.zeros(width))
    values, bound, out = np.full(width, 0.2), np.full(width, 3.0), np.empty((width, 3, 4))
    turning = np.ones(width, dtype=bool)
    joint_placements(tree, values, out)
    target = out[-1].copy()
    rows = np.full((2, width), 0.21)
    polish(chain, rows, target, -bound, bound, 1.0e-8, 0.5, 2)
    search(chain, rows, target, -bound, bound, 1.0e-8, 2, 1)
    approach_seed(chain, values, rows[0], target, -bound, bound, 1.0e-8, 1)
    unique_rows(rows, turning, 1.0e-5)
    whole_turns(rows, turning, -bound, bound, 4)
