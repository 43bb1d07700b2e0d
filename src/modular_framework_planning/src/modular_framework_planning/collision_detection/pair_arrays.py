# SPDX-License-Identifier: BSD-3-Clause
"""Arrays of the pairs of bodies to check, shared by scenes that differ only in poses and sizes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.body_arrays import (
    GROUPING_CACHE_SIZE,
    SMALL_EXCESS,
    BodyArrays,
    Grouping,
    SceneBodies,
    link_groups,
)
from modular_framework_planning.collision_detection.collision_bodies import PAIR_CACHE_SIZE, WatchedPairs
from modular_framework_planning.collision_detection.kernels.compiled_collision import TABLE_CELLS, UNKNOWN
from modular_framework_planning.collision_detection.kernels.compiled_distance import SURFACE
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.chain_model import whole_tree
from modular_framework_planning.kinematics.compiled_kinematics import Tree
from modular_framework_planning.robot_model.robot_model import RobotModel


@dataclass(frozen=True, slots=True, eq=False)
class PairArrays:
    """Pairs of bodies; World documents the fields that both classes have.

    Attributes:
        members: Indices of the watched pairs that each pair represents.
        uncompiled: Indices of watched pairs without bounding geometry, which need the exact check at every state.
    """

    pairs: NDArray[np.int64]
    margins: Array
    excess: Array
    tables: NDArray[np.int8]
    table_joints: NDArray[np.int64]
    table_of: NDArray[np.int64]
    common_joints: NDArray[np.int64]
    members: PairMembers
    uncompiled: tuple[int, ...]


class PairMembers:
    """Indices of the watched pairs that each pair of the arrays represents."""

    def __init__(self, rows: NDArray[np.int64], indices: NDArray[np.int64]) -> None:
        """Stores the relation between pairs of the arrays and watched pairs.

        Args:
            rows: Pair of the arrays for each watched pair, -1 for none.
            indices: Watched pairs sorted by row, without pairs that have no row.
        """
        self._rows, self._indices = rows, indices
        self._ends = np.cumsum(np.bincount(rows[indices])) if len(indices) else np.zeros(0, np.int64)

    def row_of(self, index: int) -> int:
        """Returns the pair of the arrays that represents a watched pair."""
        return int(self._rows[index])

    def __getitem__(self, row: int) -> tuple[int, ...]:
        return tuple(self._indices[self._ends[row - 1] if row else 0 : self._ends[row]].tolist())


class _Bodies(NamedTuple):
    """The fields of BodyArrays that the pairs depend on, as floats of shape (b,)."""

    joints: Array
    has_surface: Array
    is_solid: Array
    inflation: Array
    surface_excess: Array
    solid_excess: Array


def pair_arrays(model: RobotModel, bodies: SceneBodies, pairs: WatchedPairs) -> PairArrays:
    """Returns the arrays of the pairs; checks fill the tables, all other arrays are constant.

    Args:
        model: Robot model.
        bodies: Bodies that occur in the pairs.
        pairs: Watched pairs.
    """
    arrays = bodies.arrays
    has_surface = arrays.roots >= 0
    rows = [  # in the order of _Bodies
        arrays.joints,
        has_surface,
        arrays.kinds != SURFACE,
        np.where(has_surface, arrays.inflation, 0.0),
        np.where(has_surface, arrays.surface_excess, 0.0),
        arrays.solid_excess,
    ]
    return _pair_arrays(
        model, bodies.groups, pairs, bodies.body_of_part.tobytes(), np.array(rows, dtype=float).tobytes()
    )


@lru_cache(maxsize=PAIR_CACHE_SIZE)
def _pair_arrays(
    model: RobotModel, groups: Grouping, pairs: WatchedPairs, body_of_part: bytes, rows: bytes
) -> PairArrays:
    bodies = _Bodies(*np.frombuffer(rows).reshape(len(_Bodies._fields), -1))
    ordered, is_compiled = _ordered_pairs(bodies, np.frombuffer(body_of_part, dtype=np.int64)[pairs.parts])
    firsts, kinds = _distinct(ordered, pairs.margins, is_compiled)
    both = ordered[firsts]
    first, second = both.T
    margins = pairs.margins[firsts] + bodies.inflation[first]
    margins += np.where(bodies.is_solid[second] > 0.0, 0.0, bodies.inflation[second])
    keys = _table_keys(model, groups, both, margins)
    table_of = np.full(len(both), -1)
    table_of[list(keys)] = np.arange(len(keys))
    tables, table_joints = _tables(model, groups, tuple(keys.values()))
    indices = np.argsort(kinds, kind="stable")[np.count_nonzero(~is_compiled) :]
    return PairArrays(
        pairs=both,
        margins=margins,
        excess=_excess(bodies, both),
        tables=tables,
        table_joints=table_joints,
        table_of=table_of,
        common_joints=_common_joints(whole_tree(model).parents, *bodies.joints[both.T].astype(np.int64)),
        members=PairMembers(kinds, indices),
        uncompiled=tuple(np.flatnonzero(~is_compiled).tolist()),
    )


def _common_joints(
    parents: NDArray[np.int64], first: NDArray[np.int64], second: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Returns the lowest common ancestor of each pair of joints, -1 for none; parents have the smaller indices."""
    while (first != second).any():
        first, second = (
            np.where(first > second, parents[first], first),
            np.where(second > first, parents[second], second),
        )
    return first


def _ordered_pairs(bodies: _Bodies, both: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Orders each pair so that the first body has a surface and the second, if possible, a closed form.

    Args:
        bodies: Bodies of the scene.
        both: Indices of the two bodies of each pair, shape (n, 2).

    Returns:
        The ordered pairs, and whether each pair has a valid order.
    """
    has_surface, is_solid = bodies.has_surface > 0.0, bodies.is_solid > 0.0
    excess = _excess(bodies, both), _excess(bodies, both[:, ::-1])
    valid, rank = [], []
    for (first, second), outside in zip((both.T, both.T[::-1]), excess, strict=True):
        valid.append(has_surface[first] & (has_surface[second] | is_solid[second]))
        rank.append(2 * (outside <= SMALL_EXCESS) + is_solid[second])
    is_better = (rank[1] > rank[0]) | ((rank[1] == rank[0]) & (excess[1] < excess[0]))
    is_swapped = valid[1] & (is_better | ~valid[0])
    return np.where(is_swapped[:, None], both[:, ::-1], both), valid[0] | valid[1]


def _excess(bodies: _Bodies, both: NDArray[np.int64]) -> Array:
    """Returns the excess of each pair [m]: the first body's surface plus the second's closed form, else surface."""
    other = np.where(bodies.is_solid > 0.0, bodies.solid_excess, bodies.surface_excess)
    return np.asarray(bodies.surface_excess[both[:, 0]] + other[both[:, 1]])


def _distinct(
    ordered: NDArray[np.int64], margins: Array, is_compiled: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Joins pairs of the same bodies with the same margin into one kind.

    Args:
        ordered: Indices of the two bodies of each pair, shape (n, 2).
        margins: Minimum distances, shape (n,) [m].
        is_compiled: Whether each pair takes part, shape (n,).

    Returns:
        The first pair of each kind, in ascending order, and the kind of each pair, -1 for pairs left out.
    """
    chosen, rows = np.flatnonzero(is_compiled), np.full(len(ordered), -1)
    _, distance = np.unique(margins, return_inverse=True)
    codes = (ordered[:, 0] * (ordered.max(initial=0) + 1) + ordered[:, 1]) * (distance.max(initial=0) + 1) + distance
    _, first, kinds = np.unique(codes[chosen], return_index=True, return_inverse=True)
    order = np.argsort(first)
    ranks = np.empty_like(order)
    ranks[order] = np.arange(len(order))
    rows[chosen] = ranks[kinds]
    return chosen[first[order]], rows


def _table_keys(
    model: RobotModel, groups: Grouping, both: NDArray[np.int64], margins: Array
) -> dict[int, tuple[int, ...]]:
    """Returns the table keys of pairs of link groups, by pair index; pairs without a table are left out."""
    bodies = link_groups(model, groups).bodies
    keys = {}
    for index in np.flatnonzero((both < len(groups)).all(axis=1) & (margins == 0.0)).tolist():
        key = _table_key(whole_tree(model), bodies, *both[index].tolist())
        if key is not None:
            keys[index] = key
    return keys


def _table_key(tree: Tree, bodies: BodyArrays, first: int, second: int) -> tuple[int, ...] | None:
    """Returns the two root nodes and the one or two revolute joints between two bodies, or None without a table."""
    if bodies.joints[first] > bodies.joints[second]:
        first, second = second, first
    joints_between: list[int] = []
    base, joint = int(bodies.joints[first]), int(bodies.joints[second])
    while joint > base and len(joints_between) < 3:
        joints_between.append(joint)
        joint = int(tree.parents[joint])
    if joint != base or not 1 <= len(joints_between) <= 2 or tree.prismatic[joints_between].any():
        return None
    return int(bodies.roots[first]), int(bodies.roots[second]), *joints_between[::-1]


@lru_cache(maxsize=GROUPING_CACHE_SIZE)
def _tables(
    model: RobotModel, groups: Grouping, keys: tuple[tuple[int, ...], ...]
) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """Returns new tables, all cells unknown, and the joints of each table.

    Tables are valid in every scene; `model` and `groups` are only part of the cache key.
    """
    joints = np.array([(*key[2:], -1)[:2] for key in keys], dtype=np.int64).reshape(-1, 2)
    return np.full((len(keys), TABLE_CELLS, TABLE_CELLS), UNKNOWN, dtype=np.int8), joints
