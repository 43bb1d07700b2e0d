# SPDX-License-Identifier: BSD-3-Clause
"""Puts the bodies of a scene and the pairs to check into the arrays that compiled collision checks work on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.body_arrays import (
    KEPT_GROUPINGS,
    KEPT_MODELS,
    SMALL_EXCESS,
    BodyArrays,
    Grouping,
    SceneBodies,
    link_groups,
    scene_bodies,
)
from modular_framework_planning.collision_detection.collision_bodies import PlacedGeometry, WatchedPairs
from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    CELLS,
    CHECK_COUNTS,
    FIELD,
    UNKNOWN,
    Covers,
    World,
    arguments,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import SURFACE
from modular_framework_planning.collision_detection.kernels.compiled_distance_field import KEPT, DistanceField
from modular_framework_planning.collision_detection.kernels.compiled_spheres import (
    boxes_around,
    fill_heaps,
    meeting_joints,
)
from modular_framework_planning.collision_detection.reaches import farthest_end
from modular_framework_planning.collision_detection.sphere_covers import (
    Layers,
    balls_inside,
    empty_covers,
    extents_of,
    heap_of,
)
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.chain_model import tree_of
from modular_framework_planning.kinematics.compiled_kinematics import Tree
from modular_framework_planning.robot_model.robot_model import RobotModel

FIELD_CELLS = 64  # of the field along each axis
FIELD_REACH_M = 2.5  # from the origin of the planning frame to the sides of the field at most


@dataclass(frozen=True, slots=True, eq=False)
class CompiledWorld:
    """The arrays of a scene.

    Attributes:
        arguments: the world as compiled functions take it.
        members: for every pair of the arrays, the watched pairs (by number) that it represents.
        uncompiled: watched pairs that have no bounding geometry and need the exact check at every state.
    """

    world: World
    arguments: tuple[NDArray[Any], ...]
    members: Represented
    uncompiled: tuple[int, ...]


@lru_cache(maxsize=KEPT_MODELS)
def _tree(model: RobotModel) -> Tree:
    return tree_of(model)


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


def _never_interrupt() -> None:
    """Never interrupts."""


def compile_world(
    model: RobotModel,
    parts: Sequence[PlacedGeometry],
    pairs: WatchedPairs,
    layers: Layers,
    check_interrupt: Callable[[], None] = _never_interrupt,
) -> CompiledWorld:
    """Builds the arrays; what is built for a shape is cached as long as the shape exists.

    Args:
        model: the robot.
        parts: geometries of the scene, the model's links first.
        pairs: the pairs to watch; those that no joint moves should not be among them.
        layers: the spheres to use.
        check_interrupt: called between shapes; raises an exception to stop.
    """
    bodies = scene_bodies(model, parts, pairs, check_interrupt)
    ordered, is_compiled = _ordered(bodies.arrays, bodies.of_part[pairs.parts])
    firsts, rows = _distinct(ordered, pairs.margins, is_compiled)
    world = _arrays(model, bodies, ordered[firsts], pairs.margins[firsts])
    tabled = np.flatnonzero(~world.is_environment[world.pairs].any(axis=1))
    keys = _table_keys(model, bodies.groups, world.pairs[tabled].tobytes(), world.margins[tabled].tobytes())
    table_of = np.full(len(firsts), -1)
    has_table = np.array([key is not None for key in keys], dtype=bool)
    table_of[tabled[has_table]] = np.arange(np.count_nonzero(has_table))
    tables, joints = _tables(model, bodies.groups, tuple(key for key in keys if key is not None))
    world = _with_field(world._replace(tables=tables, table_joints=joints, table_of=table_of))
    world = _with_covers(model, bodies, layers, world)
    numbers = np.argsort(rows, kind="stable")[np.count_nonzero(~is_compiled) :]
    represented = Represented(rows, numbers, world.represented)
    return CompiledWorld(world, arguments(world), represented, tuple(np.flatnonzero(~is_compiled).tolist()))


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
    levels = np.unique(margins)
    bodies = ordered.max(initial=0) + 1
    codes = (ordered[chosen, 0] * bodies + ordered[chosen, 1]) * len(levels) + np.searchsorted(levels, margins[chosen])
    first_of = np.empty(bodies * bodies * len(levels), dtype=np.int64)
    first_of[codes[::-1]] = np.arange(len(codes))[::-1]  # of equal codes, the first one is written last
    firsts = first_of[codes]
    is_first = firsts == np.arange(len(codes))
    rows[chosen] = (np.cumsum(is_first) - 1)[firsts]
    return chosen[is_first], rows


def _ordered(bodies: BodyArrays, both: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Orders the two bodies of pairs such that the first one has a surface, the second a closed form if possible.

    Args:
        bodies: of the scene.
        both: two of them by number for each pair, shape (n, 2).

    Returns:
        The ordered pairs, and whether there is such an order.
    """
    has_surface, is_solid = bodies.roots >= 0, bodies.kinds != SURFACE
    excess = _excess(bodies, both), _excess(bodies, both[:, ::-1])
    valid, rank = [], []
    for (first, second), outside in zip((both.T, both.T[::-1]), excess, strict=True):
        valid.append(has_surface[first] & (has_surface[second] | is_solid[second]))
        rank.append(2 * (outside <= SMALL_EXCESS) + is_solid[second])
    is_better = (rank[1] > rank[0]) | ((rank[1] == rank[0]) & (excess[1] < excess[0]))
    turned = valid[1] & (is_better | ~valid[0])
    return np.where(turned[:, None], both[:, ::-1], both), valid[0] | valid[1]


def _excess(bodies: BodyArrays, both: NDArray[np.int64]) -> Array:
    """Returns how far the surface of the first and the closed form or surface of the second body lie outside [m]."""
    other = np.where(bodies.kinds == SURFACE, bodies.surface_excess, bodies.solid_excess)
    return np.asarray(bodies.surface_excess[both[:, 0]] + other[both[:, 1]])


@lru_cache(maxsize=KEPT_GROUPINGS)
def _table_keys(
    model: RobotModel, groups: Grouping, pairs: bytes, margins: bytes
) -> tuple[tuple[int, ...] | None, ...]:
    """Returns the keys of pairs of groups of links; cached, because consecutive plans mostly have the same ones."""
    _, bodies, _ = link_groups(model, groups)
    both = np.frombuffer(pairs, dtype=np.int64).reshape(-1, 2).tolist()
    return tuple(
        None if margin > 0.0 else _table_key(_tree(model), bodies, *pair)
        for pair, margin in zip(both, np.frombuffer(margins).tolist(), strict=True)
    )


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


def _arrays(model: RobotModel, bodies: SceneBodies, pairs: NDArray[np.int64], margins: Array) -> World:
    arrays, (first, second) = bodies.arrays, pairs.T
    inflation, kinds = arrays.inflation, arrays.kinds
    return World(
        tree=_tree(model),
        joints=arrays.joints,
        poses=arrays.poses,
        roots=arrays.roots,
        is_environment=arrays.is_environment,
        kinds=kinds,
        sizes=arrays.sizes,
        spheres=arrays.spheres,
        closed=arrays.closed,
        robot=bodies.robot,
        scene=bodies.scene,
        pairs=pairs,
        margins=margins + inflation[first] + np.where(kinds[second] == SURFACE, inflation[second], 0.0),
        excess=_excess(arrays, pairs),
        tables=np.zeros((0, CELLS, CELLS), dtype=np.int8),
        table_joints=np.zeros((0, 2), dtype=np.int64),
        table_of=np.full(len(pairs), -1, dtype=np.int64),
        watched=np.arange(len(pairs)),
        represented=np.zeros((0, 0), dtype=np.int64),
        counts=np.zeros(CHECK_COUNTS, dtype=np.int64),
        refusals=np.zeros(len(pairs), dtype=np.int64),
        field=_field(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 4)), 0.0),
        covers=empty_covers(Layers(0, 0), len(_tree(model).parents), len(kinds), len(pairs)),
    )


def _with_field(world: World) -> World:
    """Lets one pair with the field stand for the pairs of a body with all solids of the world."""
    is_plain = (world.joints < 0) & (world.kinds != SURFACE)
    solid_pairs = np.flatnonzero(is_plain[world.pairs[:, 1]] & np.isfinite(world.excess))
    bodies, solids_of = world.pairs[solid_pairs].T
    pair_of = np.full((len(world.joints), len(world.joints)), -1)
    pair_of[bodies, solids_of] = solid_pairs
    solids, moving = np.flatnonzero(is_plain), np.array(list(dict.fromkeys(bodies.tolist())), dtype=np.int64)
    partners = [row.tobytes() for row in pair_of[np.ix_(moving, solids)] >= 0]  # of each body among the solids
    counts = Counter(partners)
    most = max(counts, key=lambda row: (counts[row] * sum(row), row), default=b"")
    chosen = solids[np.frombuffer(most, dtype=bool)] if most else solids[:0]
    if len(chosen) < 2:
        return world
    numbers = pair_of[np.ix_(moving, chosen)]
    margins = world.margins[numbers]
    is_joined = (numbers >= 0).all(axis=1) & (margins == margins[:, :1]).all(axis=1)
    if not is_joined.any():
        return world
    rows = np.column_stack([moving[is_joined], np.full(np.count_nonzero(is_joined), FIELD)])
    count, represented = len(world.pairs), numbers[is_joined]
    field = _field(
        world.kinds[chosen], world.sizes[chosen], world.poses[chosen], min(farthest_end(world), FIELD_REACH_M)
    )
    is_watched = np.ones(count, dtype=bool)
    is_watched[represented] = False
    return world._replace(
        pairs=np.concatenate([world.pairs, rows]),
        margins=np.concatenate([world.margins, world.margins[represented[:, 0]]]),
        excess=np.concatenate([world.excess, world.excess[represented].max(axis=1)]),
        table_of=np.concatenate([world.table_of, np.full(len(rows), -1)]),
        watched=np.concatenate([np.flatnonzero(is_watched), count + np.arange(len(rows))]),
        represented=represented,
        refusals=np.zeros(count + len(rows), dtype=np.int64),
        field=field,
    )


def _with_covers(model: RobotModel, bodies: SceneBodies, layers: Layers, world: World) -> World:
    """Adds spheres around the moving bodies and balls inside of them."""
    arrays, count = bodies.arrays, len(bodies.groups)
    covers = empty_covers(layers, len(world.tree.parents), len(arrays.joints), len(world.pairs))
    links = _link_covers(model, bodies.groups, layers)
    covers.spheres[:count], covers.balls[:count] = links.spheres, links.balls
    moving = count + np.flatnonzero(arrays.joints[count:] >= 0)
    if layers.balls:
        covers.balls[moving, 0, :3], covers.balls[moving, 0, 3] = arrays.poses[moving, :, 3], arrays.inner_radii[moving]
    if layers.nodes:
        fill_heaps(world.scene, arrays.roots, arrays.poses, arrays.spheres, arrays.inflation, moving, covers.spheres)
    return world._replace(
        covers=covers._replace(
            extents=extents_of(covers.spheres),
            lengths=links.lengths,
            meets=meeting_joints(world.pairs, world.joints, world.tree.parents),
            boxes=boxes_around(world.field.kinds, world.field.sizes, world.field.poses),
        )
    )


@lru_cache(maxsize=KEPT_GROUPINGS)
def _link_covers(model: RobotModel, groups: Grouping, layers: Layers) -> Covers:
    """Spheres around groups of links and balls inside of them, and the lengths of the joints."""
    surfaces, bodies, _ = link_groups(model, groups)
    covers = empty_covers(layers, 0, len(groups), 0)
    for number, root in enumerate(bodies.roots.tolist() if layers.nodes else ()):
        covers.spheres[number] = heap_of(surfaces, root, layers.nodes)
    if layers.balls:
        covers.balls[:] = _link_balls(model, groups, layers.balls)
    lengths = np.linalg.norm(_tree(model).placements[:, :, 3], axis=1)
    return covers._replace(lengths=lengths)


@lru_cache(maxsize=KEPT_GROUPINGS)
def _link_balls(model: RobotModel, groups: Grouping, most: int) -> Array:
    """Balls inside of groups of links, shape (groups, most, 4)."""
    surfaces, bodies, _ = link_groups(model, groups)
    closed = [
        balls_inside(surfaces, root, most) if is_closed else np.zeros((most, 4))
        for root, is_closed in zip(bodies.roots.tolist(), bodies.closed, strict=True)
    ]
    return np.array(closed).reshape(-1, most, 4)


def _field(kinds: NDArray[np.int64], sizes: Array, poses: Array, reach: float) -> DistanceField:
    """Returns an empty field, `reach` [m] to every side of the origin of the planning frame."""
    cells = (FIELD_CELLS if len(kinds) else 0,) * 3
    kept = min(len(kinds), KEPT)
    return DistanceField(
        kinds,
        sizes,
        poses,
        np.array([-reach, -reach, -reach, 2.0 * reach / FIELD_CELLS]),
        np.zeros(cells, dtype=bool),
        np.empty((*cells, kept), dtype=np.int32),
        np.empty((*cells, kept)),
    )
