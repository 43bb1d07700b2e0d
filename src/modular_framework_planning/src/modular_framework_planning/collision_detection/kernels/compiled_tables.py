# SPDX-License-Identifier: BSD-3-Clause
"""Tables over two joints of whether a pair of links stays apart; cells are filled on first use and never change."""

from __future__ import annotations

import numpy as np
from numba import njit

from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    APART,
    CELLS,
    NEAR,
    UNKNOWN,
    place_bodies,
    relative_pose,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import Turns, surfaces_stay_apart
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements

MOST_CELLS = 12  # looked up for one stretch of a path


@njit(cache=True, nogil=True)
def _fill_cell(world, table, pair, row, column):  # type: ignore[no-untyped-def]
    """Finds out whether two links stay apart all through a cell of their table."""
    first, second = world.pairs[pair, 0], world.pairs[pair, 1]
    if world.joints[first] < world.joints[second]:
        first, second = second, first  # the first one is the one that moves, seen from the other
    count = len(world.tree.parents)
    positions, placements = np.zeros(count), np.empty((count, 3, 4))
    near, far = world.table_joints[table, 0], world.table_joints[table, 1]
    width = 2.0 * np.pi / CELLS
    positions[near] = (row + 0.5) * width
    turns = 1
    if far >= 0:
        positions[far] = (column + 0.5) * width
        turns = 2
    joint_placements(world.tree, positions, placements)
    bodies = len(world.joints)
    poses, centres = np.empty((bodies, 3, 4)), np.empty((bodies, 3))
    place_bodies(world, placements, poses, centres)
    relative, origins, axes = np.empty((3, 4)), np.empty((turns, 3)), np.empty((turns, 3))
    relative_pose(poses[first], poses[second], relative)
    for turn in range(turns):
        joint = far if turns == 2 and turn == 0 else near
        placement, axis, base = placements[joint], world.tree.axes[joint], poses[second]
        for line in range(3):
            origins[turn, line], axes[turn, line] = 0.0, 0.0
            for inner in range(3):
                origins[turn, line] += base[inner, line] * (placement[inner, 3] - base[inner, 3])
                axes[turn, line] += base[inner, line] * (
                    placement[inner, 0] * axis[0] + placement[inner, 1] * axis[1] + placement[inner, 2] * axis[2]
                )
    change = np.full(turns, 0.5 * width * (1.0 + 1e-9))
    apart = surfaces_stay_apart(
        world.robot, world.roots[first], world.robot, world.roots[second], relative, Turns(origins, axes, change)
    )
    world.tables[table, row, column] = APART if apart else NEAR


@njit(cache=True, nogil=True)
def _cells(reach, joint):  # type: ignore[no-untyped-def]
    """Returns the first cell of a stretch between the positions reach (2, joints) of a joint, and how many."""
    if joint < 0:
        return 0, 1
    width = 2.0 * np.pi / CELLS
    begin = int(np.floor(reach[0, joint] / width))
    return begin, int(np.floor(reach[1, joint] / width)) - begin + 1


@njit(cache=True, nogil=True)
def table_answer(tables, table, joints, reach):  # type: ignore[no-untyped-def]
    """Returns what the table of a pair says about its links while joints stay within `reach`.

    APART is certain; NEAR also stands for too many cells to look up, UNKNOWN for a cell still to fill.

    Args:
        tables: all tables.
        table: the one to look into.
        joints: the joints of every table, shape (tables, 2), -1 for none.
        reach: least and largest position of every joint, shape (2, joints).
    """
    row, rows = _cells(reach, joints[table, 0])
    column, columns = _cells(reach, joints[table, 1])
    if rows * columns > MOST_CELLS:
        return NEAR
    for i in range(row, row + rows):
        for j in range(column, column + columns):
            if tables[table, i % CELLS, j % CELLS] != APART:
                return int(tables[table, i % CELLS, j % CELLS])
    return APART


@njit(cache=True, nogil=True)
def fill_cells(world, pair, reach):  # type: ignore[no-untyped-def]
    """Fills the cells of a pair's table that lie within `reach`, see table_answer."""
    table = world.table_of[pair]
    row, rows = _cells(reach, world.table_joints[table, 0])
    column, columns = _cells(reach, world.table_joints[table, 1])
    for i in range(row, row + rows):
        for j in range(column, column + columns):
            if world.tables[table, i % CELLS, j % CELLS] == UNKNOWN:
                _fill_cell(world, table, pair, i % CELLS, j % CELLS)
