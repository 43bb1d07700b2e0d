# SPDX-License-Identifier: BSD-3-Clause
"""Forward kinematics and least-squares inverse kinematics as compiled loops: a microsecond a state."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.spatial import Array

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
def _multiply(first: Array, second: Array, out: Array) -> None:
    for row in range(3):
        for column in range(4):
            value = first[row, 3] if column == 3 else 0.0
            for inner in range(3):
                value += first[row, inner] * second[inner, column]
            out[row, column] = value


@njit(cache=True, nogil=True)
def joint_placements(tree: Tree, positions: Array, out: Array) -> None:
    """Computes the pose of every joint in the planning frame.

    Args:
        tree: the joints.
        positions: one value a joint [rad or m], mimic joints included.
        out: filled; shape (n, 3, 4), rotation beside translation.
    """
    moved = np.empty((3, 4))
    for number in range(len(tree.parents)):
        placement, axis, value = tree.placements[number], tree.axes[number], positions[number]
        x, y, z = axis[0], axis[1], axis[2]
        if tree.prismatic[number]:
            for row in range(3):
                slide = placement[row, 0] * x + placement[row, 1] * y + placement[row, 2] * z
                moved[row, 0], moved[row, 1], moved[row, 2] = placement[row, 0], placement[row, 1], placement[row, 2]
                moved[row, 3] = placement[row, 3] + value * slide
        else:
            sine, cosine = np.sin(value), np.cos(value)
            rest = 1.0 - cosine
            for row in range(3):
                a, b, c = placement[row, 0], placement[row, 1], placement[row, 2]
                moved[row, 0] = (a * (cosine + x * x * rest) + b * (y * x * rest + z * sine)
                                 + c * (z * x * rest - y * sine))
                moved[row, 1] = (a * (x * y * rest - z * sine) + b * (cosine + y * y * rest)
                                 + c * (z * y * rest + x * sine))
                moved[row, 2] = (a * (x * z * rest + y * sine) + b * (y * z * rest - x * sine)
                                 + c * (cosine + z * z * rest))
                moved[row, 3] = placement[row, 3]
        if tree.parents[number] < 0:
            out[number] = moved
        else:
            _multiply(out[tree.parents[number]], moved, out[number])


@njit(cache=True, nogil=True)
def rotation_vector(first: Array, second: Array, out: Array) -> None:
    """Writes the rotation from `first` to `second` (leading 3 x 3 blocks) as a vector in the common frame [rad]."""
    turn = np.empty((3, 3))
    for row in range(3):
        for column in range(3):
            turn[row, column] = (second[row, 0] * first[column, 0] + second[row, 1] * first[column, 1]
                                 + second[row, 2] * first[column, 2])
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sine = 0.5 * np.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    if sine > SMALL_ANGLE:
        scale = 0.5 * angle / sine
        out[0], out[1], out[2] = scale * x, scale * y, scale * z
    elif cosine > 0.0:
        out[0], out[1], out[2] = 0.5 * x, 0.5 * y, 0.5 * z
    else:  # half a turn: the axis is the longest column of turn + identity
        longest = 0
        for column in range(1, 3):
            if turn[column, column] > turn[longest, longest]:
                longest = column
        for row in range(3):
            out[row] = turn[row, longest] + (1.0 if row == longest else 0.0)
        size = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
        for row in range(3):
            out[row] *= angle / size


@njit(cache=True, nogil=True)
def pose_error(chain: Chain, values: Array, target: Array, jacobian: Array, error: Array, places: Array) -> float:
    """Compares the tip with a target.

    Args:
        values: the group's joint values [rad or m].
        target: pose of the tip in the planning frame, shape (3, 4).
        jacobian: filled; how the values move the tip, linear above angular, shape (6, group).
        error: filled; what is missing to the target, linear [m] above angular [rad], shape (6,).
        places: working memory, shape (joints + 1, 3, 4); the last one is the tip's pose.

    Returns:
        The length of the error.
    """
    count = len(chain.drivers)
    positions = np.empty(count)
    for number in range(count):
        driver = chain.drivers[number]
        positions[number] = chain.offsets[number]
        if driver >= 0:
            positions[number] += chain.gains[number] * values[driver]
    joint_placements(chain.tree, positions, places)
    tip = places[count]
    _multiply(places[count - 1], chain.tip, tip)
    for row in range(3):
        error[row] = target[row, 3] - tip[row, 3]
    rotation_vector(tip, target, error[3:])
    jacobian[:] = 0.0
    for number in range(count):
        driver, gain, place, axis = chain.drivers[number], chain.gains[number], places[number], chain.tree.axes[number]
        if driver < 0:
            continue
        x = place[0, 0] * axis[0] + place[0, 1] * axis[1] + place[0, 2] * axis[2]
        y = place[1, 0] * axis[0] + place[1, 1] * axis[1] + place[1, 2] * axis[2]
        z = place[2, 0] * axis[0] + place[2, 1] * axis[1] + place[2, 2] * axis[2]
        if chain.tree.prismatic[number]:
            jacobian[0, driver] += gain * x
            jacobian[1, driver] += gain * y
            jacobian[2, driver] += gain * z
        else:
            a, b, c = tip[0, 3] - place[0, 3], tip[1, 3] - place[1, 3], tip[2, 3] - place[2, 3]
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
def _damped_step(jacobian: Array, error: Array, damping: float, free: NDArray[np.bool_], step: Array,
                 square: Array) -> None:
    """Solves min |J step - error|^2 + damping |step|^2 over the free joints by a Cholesky factor of J J^T + damping."""
    width = jacobian.shape[1]
    for row in range(POSE_SIZE):
        for column in range(row + 1):
            value = damping if row == column else 0.0
            for joint in range(width):
                if free[joint]:
                    value += jacobian[row, joint] * jacobian[column, joint]
            for inner in range(column):
                value -= square[row, inner] * square[column, inner]
            square[row, column] = np.sqrt(max(value, 1e-30)) if row == column else value / square[column, column]
    solved = np.empty(POSE_SIZE)
    for row in range(POSE_SIZE):
        value = error[row]
        for inner in range(row):
            value -= square[row, inner] * solved[inner]
        solved[row] = value / square[row, row]
    for row in range(POSE_SIZE - 1, -1, -1):
        value = solved[row]
        for inner in range(row + 1, POSE_SIZE):
            value -= square[inner, row] * solved[inner]
        solved[row] = value / square[row, row]
    for joint in range(width):
        step[joint] = 0.0
        if free[joint]:
            for row in range(POSE_SIZE):
                step[joint] += jacobian[row, joint] * solved[row]


@njit(cache=True, nogil=True)
def converge(chain: Chain, values: Array, target: Array, lower: Array, upper: Array, tolerance: float,
             steps: int) -> bool:
    """Moves joint values, within bounds, until the tip is at the target; changes `values` in place.

    Args:
        lower, upper: bounds of the group's joints, shape (group,).
        tolerance: length of the pose error to get below.
        steps: how many steps to try.
    """
    width = len(values)
    jacobian, error, square = np.empty((POSE_SIZE, width)), np.empty(POSE_SIZE), np.zeros((POSE_SIZE, POSE_SIZE))
    places, step, free = np.empty((len(chain.drivers) + 1, 3, 4)), np.empty(width), np.empty(width, dtype=np.bool_)
    for _ in range(steps):
        size = pose_error(chain, values, target, jacobian, error, places)
        if size < tolerance:
            return True
        damping = min(1.0e-3, 0.1 * size * size) + 1.0e-14
        free[:] = True
        for _attempt in range(2):
            _damped_step(jacobian, error, damping, free, step, square)
            blocked = False
            for joint in range(width):
                if free[joint] and ((values[joint] <= lower[joint] and step[joint] < 0.0)
                                    or (values[joint] >= upper[joint] and step[joint] > 0.0)):
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
    return bool(pose_error(chain, values, target, jacobian, error, places) < tolerance)


@njit(cache=True, nogil=True)
def polish(chain: Chain, candidates: Array, target: Array, lower: Array, upper: Array, tolerance: float,
           furthest: float, steps: int) -> NDArray[np.bool_]:
    """Drives approximate solutions to the target, in place; says which arrived.

    Args:
        candidates: joint values, shape (k, group).
        furthest: pose error above which a candidate is not a solution at all.
    """
    count, width = candidates.shape
    arrived = np.zeros(count, dtype=np.bool_)
    jacobian, error = np.empty((POSE_SIZE, width)), np.empty(POSE_SIZE)
    places = np.empty((len(chain.drivers) + 1, 3, 4))
    for number in range(count):
        size = pose_error(chain, candidates[number], target, jacobian, error, places)
        if size < furthest:
            arrived[number] = size < tolerance or converge(chain, candidates[number], target, lower, upper, tolerance,
                                                           steps)
    return arrived


@njit(cache=True, nogil=True)
def search(chain: Chain, starts: Array, target: Array, lower: Array, upper: Array, tolerance: float, steps: int,
           most: int) -> NDArray[np.bool_]:
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
def approach_seed(chain: Chain, values: Array, seed: Array, target: Array, lower: Array, upper: Array,
                  tolerance: float, steps: int) -> None:
    """Moves a solution of a redundant chain nearer to the seed while the tip stays; changes `values` in place."""
    width = len(values)
    jacobian, error, square = np.empty((POSE_SIZE, width)), np.empty(POSE_SIZE), np.zeros((POSE_SIZE, POSE_SIZE))
    places, back = np.empty((len(chain.drivers) + 1, 3, 4)), np.empty(width)
    free = np.ones(width, dtype=np.bool_)
    for _ in range(steps):
        pose_error(chain, values, target, jacobian, error, places)
        wish = seed - values
        for row in range(POSE_SIZE):
            error[row] = 0.0
            for joint in range(width):
                error[row] += jacobian[row, joint] * wish[joint]
        _damped_step(jacobian, error, 1.0e-9, free, back, square)
        trial = values.copy()
        widest = 0.0
        for joint in range(width):
            move = wish[joint] - back[joint]
            widest = max(widest, abs(move))
            trial[joint] = min(max(values[joint] + move * min(1.0, 0.3 / max(abs(move), 1e-12)), lower[joint]),
                               upper[joint])
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
