# SPDX-License-Identifier: BSD-3-Clause
"""Puts the pairs of bodies to check into arrays; scenes that differ only in poses and sizes share them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.body_arrays import (
    KEPT_GROUPINGS,
    SMALL_EXCESS,
    BodyArrays,
    Grouping,
    SceneBodies,
    link_groups,
)
from modular_framework_planning.collision_detection.collision_bodies import KEPT_PAIRS, WatchedPairs
from modular_framework_planning.collision_detection.kernels.compiled_collision import CELLS, FIELD, UNKNOWN
from modular_framework_planning.collision_detection.kernels.compiled_distance import SURFACE
from modular_framework_planning.collision_detection.kernels.compiled_reaches import meeting_joints
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.chain_model import whole_tree
from modular_framework_planning.kinematics.compiled_kinematics import Tree
from modular_framework_planning.robot_model.robot_model import RobotModel


@dataclass(frozen=True, slots=True, eq=False)
class PairArrays:
    """Pairs of bodies; what has the same name in World is explained there.

    Attributes:
        solids: bodies of the world that the distance field holds.
        members: for every pair, the watched pairs (by number) that it represents.
        uncompiled: watched pairs that have no bounding geometry and need the exact check at every state.
    """

    pairs: NDArray[np.int64]
    margins: Array
    excess: Array
    tables: NDArray[np.int8]
    table_joints: NDArray[np.int64]
    table_of: NDArray[np.int64]
    watched: NDArray[np.int64]
    represented: NDArray[np.int64]
    meets: NDArray[np.int64]
    solids: NDArray[np.int64]
    members: Represented
    uncompiled: tuple[int, ...]


class Represented:
    """The watched pairs that each pair of the arrays represents, by number."""

    def __init__(self, rows: NDArray[np.int64], numbers: NDArray[np.int64], joined: NDArray[np.int64]) -> None:
        """Stores which they are.

        Args:
            rows: pair of the arrays for each watched pair, -1 for none.
            numbers: of the watched pairs by their rows, those without a row left out.
            joined: the rows that each row at the end stands for, shape (f, n).
        """
        self._rows, self._numbers, self._joined = rows, numbers, joined
        self._ends = np.cumsum(np.bincount(rows[numbers])) if len(numbers) else np.zeros(0, np.int64)

    def row_of(self, number: int) -> int:
        """Returns the single pair of the arrays that represents a watched pair."""
        return int(self._rows[number])

    def __getitem__(self, row: int) -> tuple[int, ...]:
        if row >= len(self._ends):
            return tuple(number for single in self._joined[row - len(self._ends)].tolist() for number in self[single])
        return tuple(self._numbers[self._ends[row - 1] if row else 0 : self._ends[row]].tolist())


class _Bodies(NamedTuple):
    """What of the bodies the pairs depend on, see BodyArrays: all numbers, shape (b,) each."""

    joints: Array
    has_surface: Array
    is_solid: Array
    inflation: Array
    surface_excess: Array
    solid_excess: Array


def pair_arrays(model: RobotModel, bodies: SceneBodies, pairs: WatchedPairs) -> PairArrays:
    """Returns the pairs; none of the arrays may be changed, but the tables are filled while checking.

    Args:
        model: the robot.
        bodies: that are in the pairs.
        pairs: the pairs to watch.
    """
    arrays = bodies.arrays
    has_surface = arrays.roots >= 0
    rows = [  # of _Bodies
        arrays.joints,
        has_surface,
        arrays.kinds != SURFACE,
        np.where(has_surface, arrays.inflation, 0.0),
        np.where(has_surface, arrays.surface_excess, 0.0),
        arrays.solid_excess,
    ]
    return _pair_arrays(model, bodies.groups, pairs, bodies.of_part.tobytes(), np.array(rows, dtype=float).tobytes())


@lru_cache(maxsize=KEPT_PAIRS)
def _pair_arrays(model: RobotModel, groups: Grouping, pairs: WatchedPairs, of_part: bytes, rows: bytes) -> PairArrays:
    bodies = _Bodies(*np.frombuffer(rows).reshape(len(_Bodies._fields), -1))
    ordered, is_compiled = _ordered(bodies, np.frombuffer(of_part, dtype=np.int64)[pairs.parts])
    firsts, kinds = _distinct(ordered, pairs.margins, is_compiled)
    both = ordered[firsts]
    first, second = both.T
    margins = pairs.margins[firsts] + bodies.inflation[first]
    margins += np.where(bodies.is_solid[second] > 0.0, 0.0, bodies.inflation[second])
    keys = _table_keys(model, groups, both, margins)
    table_of = np.full(len(both), -1)
    table_of[list(keys)] = np.arange(len(keys))
    tables, table_joints = _tables(model, groups, tuple(keys.values()))
    excess = _excess(bodies, both)
    solids, represented = _field_pairs(bodies, both, margins, excess)
    with_field = np.column_stack([first[represented[:, 0]], np.full(len(represented), FIELD)])
    both = np.concatenate([both, with_field])
    is_watched = np.ones(len(both), dtype=bool)
    is_watched[represented] = False
    numbers = np.argsort(kinds, kind="stable")[np.count_nonzero(~is_compiled) :]
    return PairArrays(
        pairs=both,
        margins=np.concatenate([margins, margins[represented[:, 0]]]),
        excess=np.concatenate([excess, excess[represented].max(axis=1)]),
        tables=tables,
        table_joints=table_joints,
        table_of=np.concatenate([table_of, np.full(len(represented), -1)]),
        watched=np.flatnonzero(is_watched),
        represented=represented,
        meets=meeting_joints(both, bodies.joints.astype(np.int64), whole_tree(model).parents),
        solids=solids,
        members=Represented(kinds, numbers, represented),
        uncompiled=tuple(np.flatnonzero(~is_compiled).tolist()),
    )


def _ordered(bodies: _Bodies, both: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Orders the two bodies of pairs such that the first one has a surface, the second a closed form if possible.

    Args:
        bodies: of the scene.
        both: two of them by number for each pair, shape (n, 2).

    Returns:
        The ordered pairs, and whether there is such an order.
    """
    has_surface, is_solid = bodies.has_surface > 0.0, bodies.is_solid > 0.0
    excess = _excess(bodies, both), _excess(bodies, both[:, ::-1])
    valid, rank = [], []
    for (first, second), outside in zip((both.T, both.T[::-1]), excess, strict=True):
        valid.append(has_surface[first] & (has_surface[second] | is_solid[second]))
        rank.append(2 * (outside <= SMALL_EXCESS) + is_solid[second])
    is_better = (rank[1] > rank[0]) | ((rank[1] == rank[0]) & (excess[1] < excess[0]))
    turned = valid[1] & (is_better | ~valid[0])
    return np.where(turned[:, None], both[:, ::-1], both), valid[0] | valid[1]


def _excess(bodies: _Bodies, both: NDArray[np.int64]) -> Array:
    """Returns how far the surface of the first and the closed form or surface of the second body lie outside [m]."""
    other = np.where(bodies.is_solid > 0.0, bodies.solid_excess, bodies.surface_excess)
    return np.asarray(bodies.surface_excess[both[:, 0]] + other[both[:, 1]])


def _distinct(
    ordered: NDArray[np.int64], margins: Array, is_compiled: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Joins pairs of the same bodies at the same distance.

    Args:
        ordered: the two bodies of each pair, shape (n, 2).
        margins: distance they must keep [m], shape (n,).
        is_compiled: whether a pair counts, shape (n,).

    Returns:
        The first pair of each kind, in their order, and the number of each pair's kind, -1 where it does not count.
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
    """Returns the keys of the tables of pairs of groups of links, by the numbers of those pairs that have one."""
    _, bodies, _ = link_groups(model, groups)
    keys = {}
    for number in np.flatnonzero((both < len(groups)).all(axis=1) & (margins == 0.0)).tolist():
        key = _table_key(whole_tree(model), bodies, *both[number].tolist())
        if key is not None:
            keys[number] = key
    return keys


def _table_key(tree: Tree, bodies: BodyArrays, first: int, second: int) -> tuple[int, ...] | None:
    """Returns roots and joints (one or two) of two bodies of which one moves the other, or None."""
    if bodies.joints[first] > bodies.joints[second]:
        first, second = second, first
    between: list[int] = []
    base, joint = int(bodies.joints[first]), int(bodies.joints[second])
    while joint > base and len(between) < 3:
        between.append(joint)
        joint = int(tree.parents[joint])
    if joint != base or not 1 <= len(between) <= 2 or tree.prismatic[between].any():
        return None
    return int(bodies.roots[first]), int(bodies.roots[second]), *between[::-1]


@lru_cache(maxsize=KEPT_GROUPINGS)
def _tables(
    model: RobotModel, groups: Grouping, keys: tuple[tuple[int, ...], ...]
) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """Tables (all unknown at first) of pairs of links.

    They hold in every scene: `model` and `groups` only say for which robot and bodies they are kept.
    """
    joints = np.array([(*key[2:], -1)[:2] for key in keys], dtype=np.int64).reshape(-1, 2)
    return np.full((len(keys), CELLS, CELLS), UNKNOWN, dtype=np.int8), joints


def _field_pairs(
    bodies: _Bodies, both: NDArray[np.int64], margins: Array, excess: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Chooses solids of the world for the distance field, against which most moving bodies are checked.

    Args:
        bodies: of the scene.
        both: the two bodies of each pair, shape (n, 2).
        margins: distance they must keep [m], shape (n,).
        excess: see World, shape (n,).

    Returns:
        The bodies in the field, and the pairs with all of them for each body that is checked against it, one row each.
    """
    is_plain = (bodies.joints < 0.0) & (bodies.is_solid > 0.0)
    chosen_pairs = np.flatnonzero(is_plain[both[:, 1]] & np.isfinite(excess))
    moving_of, solid_of = both[chosen_pairs].T
    pair_of = np.full((len(is_plain), len(is_plain)), -1)
    pair_of[moving_of, solid_of] = chosen_pairs
    solids, moving = np.flatnonzero(is_plain), np.array(list(dict.fromkeys(moving_of.tolist())), dtype=np.int64)
    counts = Counter(row.tobytes() for row in pair_of[np.ix_(moving, solids)] >= 0)  # of the same solids
    most = max(counts, key=lambda row: (counts[row] * sum(row), row), default=bytes(len(solids)))
    solids = solids[np.frombuffer(most, dtype=bool)]
    numbers = pair_of[np.ix_(moving, solids)]
    is_joined = (numbers >= 0).all(axis=1) & (margins[numbers] == margins[numbers[:, :1]]).all(axis=1)
    if len(solids) < 2 or not is_joined.any():
        return solids[:0], np.zeros((0, 1), dtype=np.int64)
    return solids, numbers[is_joined]
