# SPDX-License-Identifier: BSD-3-Clause
"""Lookup tables of collision-free joint ranges for pairs of links; cells are computed on first use."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    APART,
    NEAR,
    TABLE_CELLS,
    UNKNOWN,
    World,
    place_bodies,
    relative_pose,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import Rotations, surfaces_stay_apart
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements

MAX_CELLS = 12  # maximum number of cells per lookup


@njit(cache=True, nogil=True)
def _fill_cell(world: World, table: int, pair: int, row: int, column: int) -> None:
    """Determines whether two links are collision-free in an entire cell of their table."""
    first, second = world.pairs[pair, 0], world.pairs[pair, 1]
    if world.joints[first] < world.joints[second]:
        first, second = second, first  # the first link moves relative to the second
    count = len(world.tree.parents)
    positions, placements = np.zeros(count), np.empty((count, 3, 4))
    near, far = world.table_joints[table, 0], world.table_joints[table, 1]
    width = 2.0 * np.pi / TABLE_CELLS
    positions[near] = (row + 0.5) * width
    axis_count = 1
    if far >= 0:
        positions[far] = (column + 0.5) * width
        axis_count = 2
    joint_placements(world.tree, positions, placements)
    bodies = len(world.joints)
    poses, centres = np.empty((bodies, 3, 4)), np.empty((bodies, 3))
    place_bodies(world, placements, poses, centres)
    relative, origins, axes = np.empty((3, 4)), np.empty((axis_count, 3)), np.empty((axis_count, 3))
    relative_pose(poses[first], poses[second], relative)
    for rotation in range(axis_count):
        joint = far if axis_count == 2 and rotation == 0 else near
        placement, axis, base = placements[joint], world.tree.axes[joint], poses[second]
        for coordinate in range(3):
            origins[rotation, coordinate], axes[rotation, coordinate] = 0.0, 0.0
            for inner in range(3):
                origins[rotation, coordinate] += base[inner, coordinate] * (placement[inner, 3] - base[inner, 3])
                axes[rotation, coordinate] += base[inner, coordinate] * (
                    placement[inner, 0] * axis[0] + placement[inner, 1] * axis[1] + placement[inner, 2] * axis[2]
                )
    max_angles = np.full(axis_count, 0.5 * width * (1.0 + 1e-9))
    apart = surfaces_stay_apart(
        world.robot,
        world.roots[first],
        world.robot,
        world.roots[second],
        relative,
        Rotations(origins, axes, max_angles),
    )
    world.tables[table, row, column] = APART if apart else NEAR


@njit(cache=True, nogil=True)
def _cells(joint_ranges: Array, joint: int) -> tuple[int, int]:
    """Returns the first cell in a joint's range, and the number of cells; `joint_ranges` as in table_verdict."""
    if joint < 0:
        return 0, 1
    width = 2.0 * np.pi / TABLE_CELLS
    begin = int(np.floor(joint_ranges[0, joint] / width))
    return begin, int(np.floor(joint_ranges[1, joint] / width)) - begin + 1


@njit(cache=True, nogil=True)
def table_verdict(tables: NDArray[np.int8], table: int, joints: NDArray[np.int64], joint_ranges: Array) -> int:
    """Looks up whether two links are collision-free within joint ranges.

    APART is proven. NEAR can also mean too many cells to look up; UNKNOWN means that a cell is not yet filled.

    Args:
        tables: All tables, see World.
        table: Index of the table.
        joints: Joints of every table, -1 for none; shape (t, 2).
        joint_ranges: Minimum and maximum position of every joint, shape (2, joints) [rad or m].
    """
    row, rows = _cells(joint_ranges, joints[table, 0])
    column, columns = _cells(joint_ranges, joints[table, 1])
    if rows * columns > MAX_CELLS:
        return NEAR
    for i in range(row, row + rows):
        for j in range(column, column + columns):
            if tables[table, i % TABLE_CELLS, j % TABLE_CELLS] != APART:
                return int(tables[table, i % TABLE_CELLS, j % TABLE_CELLS])
    return APART


@njit(cache=True, nogil=True)
def fill_cells(world: World, pair: int, joint_ranges: Array) -> None:
    """Fills the unknown cells of a pair's table within joint ranges; see table_verdict.

    Args:
        world: Bodies, pairs and tables.
        pair: Index of the pair.
        joint_ranges: Minimum and maximum joint positions, shape (2, joints) [rad or m].
    """
    table = world.table_of[pair]
    row, rows = _cells(joint_ranges, world.table_joints[table, 0])
    column, columns = _cells(joint_ranges, world.table_joints[table, 1])
    for i in range(row, row + rows):
        for j in range(column, column + columns):
            if world.tables[table, i % TABLE_CELLS, j % TABLE_CELLS] == UNKNOWN:
                _fill_cell(world, table, pair, i % TABLE_CELLS, j % TABLE_CELLS)
