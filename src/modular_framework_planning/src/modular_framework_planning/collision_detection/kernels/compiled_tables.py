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
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import (
    Rotations,
    relative_pose,
    surfaces_stay_apart,
)
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements

MAX_CELLS = 12  # maximum number of cells per lookup


@njit(cache=True, nogil=True)
def _fill_cell(world: World, table: int, pair: int, row: int, column: int) -> None:
    """Writes APART to a table cell if two links are proven collision-free in the whole cell, otherwise NEAR.

    The links are placed at the centre of the cell; each joint then rotates by up to half the width of the cell.
    """
    first, second = world.pairs[pair, 0], world.pairs[pair, 1]
    if world.joints[first] < world.joints[second]:
        first, second = second, first  # the first link is the link farther from the base
    count = len(world.tree.parents)
    positions, placements = np.zeros(count), np.empty((count, 3, 4))
    inner_joint, outer_joint = world.table_joints[table, 0], world.table_joints[table, 1]
    width = 2.0 * np.pi / TABLE_CELLS
    positions[inner_joint] = (row + 0.5) * width
    axis_count = 1
    if outer_joint >= 0:
        positions[outer_joint] = (column + 0.5) * width
        axis_count = 2
    joint_placements(world.tree, positions, placements)
    bodies = len(world.joints)
    poses, centres = np.empty((bodies, 3, 4)), np.empty((bodies, 3))
    place_bodies(world, placements, poses, centres)
    relative, origins, axes = np.empty((3, 4)), np.empty((axis_count, 3)), np.empty((axis_count, 3))
    relative_pose(poses[first], poses[second], relative)
    for rotation in range(axis_count):
        joint = outer_joint if axis_count == 2 and rotation == 0 else inner_joint
        placement, axis, frame = placements[joint], world.tree.axes[joint], poses[second]
        for coordinate in range(3):
            origins[rotation, coordinate], axes[rotation, coordinate] = 0.0, 0.0
            for inner in range(3):
                origins[rotation, coordinate] += frame[inner, coordinate] * (placement[inner, 3] - frame[inner, 3])
                axes[rotation, coordinate] += frame[inner, coordinate] * (
                    placement[inner, 0] * axis[0] + placement[inner, 1] * axis[1] + placement[inner, 2] * axis[2]
                )
    max_angles = np.full(axis_count, 0.5 * width * (1.0 + 1e-9))
    rotations = Rotations(origins, axes, max_angles)
    apart = surfaces_stay_apart(world.robot, world.roots[first], world.robot, world.roots[second], relative, rotations)
    world.tables[table, row, column] = APART if apart else NEAR


@njit(cache=True, nogil=True)
def _cells(joint_ranges: Array, joint: int) -> tuple[int, int]:
    """Returns the index of the first cell in a joint's range, and the number of cells; (0, 1) if `joint` is -1."""
    if joint < 0:
        return 0, 1
    width = 2.0 * np.pi / TABLE_CELLS
    begin = int(np.floor(joint_ranges[0, joint] / width))
    return begin, int(np.floor(joint_ranges[1, joint] / width)) - begin + 1


@njit(cache=True, nogil=True)
def table_verdict(tables: NDArray[np.int8], table: int, table_joints: NDArray[np.int64], joint_ranges: Array) -> int:
    """Looks up the verdict on two links within joint ranges.

    APART: the links are proven collision-free. NEAR: no proof, or more than MAX_CELLS cells. UNKNOWN: a cell is not
    filled yet.

    Args:
        tables: Tables of all pairs, see World.
        table: Index of the table.
        table_joints: Joints of each table, -1 for none; shape (t, 2).
        joint_ranges: Minimum and maximum position of every joint, shape (2, joints) [rad or m].
    """
    first_row, rows = _cells(joint_ranges, table_joints[table, 0])
    first_column, columns = _cells(joint_ranges, table_joints[table, 1])
    if rows * columns > MAX_CELLS:
        return NEAR
    for row in range(first_row, first_row + rows):
        for column in range(first_column, first_column + columns):
            verdict = tables[table, row % TABLE_CELLS, column % TABLE_CELLS]
            if verdict != APART:
                return int(verdict)
    return APART


@njit(cache=True, nogil=True)
def fill_cells(world: World, pair: int, joint_ranges: Array) -> None:
    """Fills the unknown cells of a pair's table within joint ranges.

    Args:
        world: Bodies, pairs and tables.
        pair: Index of the pair.
        joint_ranges: Minimum and maximum joint positions, shape (2, joints) [rad or m].
    """
    table = world.table_of[pair]
    first_row, rows = _cells(joint_ranges, world.table_joints[table, 0])
    first_column, columns = _cells(joint_ranges, world.table_joints[table, 1])
    for row in range(first_row, first_row + rows):
        for column in range(first_column, first_column + columns):
            if world.tables[table, row % TABLE_CELLS, column % TABLE_CELLS] == UNKNOWN:
                _fill_cell(world, table, pair, row % TABLE_CELLS, column % TABLE_CELLS)
