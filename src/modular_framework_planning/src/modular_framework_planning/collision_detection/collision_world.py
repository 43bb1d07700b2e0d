# SPDX-License-Identifier: BSD-3-Clause
"""Puts the bodies of a scene and the pairs to check into the arrays that compiled collision checks work on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.bounding_geometry import (
    BoundingGeometry,
    bounding_geometry_of,
    moved,
    stacked,
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
from modular_framework_planning.collision_detection.kernels.compiled_spheres import boxes_around, meeting_joints
from modular_framework_planning.collision_detection.kernels.compiled_triangles import Surfaces
from modular_framework_planning.collision_detection.reaches import farthest_end
from modular_framework_planning.collision_detection.sphere_covers import (
    Layers,
    balls_inside,
    empty_covers,
    extents_of,
    heap_of,
    single_sphere,
)
from modular_framework_planning.contacts import LINK, WORLD, Body
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.chain_model import tree_of
from modular_framework_planning.kinematics.compiled_kinematics import Tree
from modular_framework_planning.robot_model.robot_model import RobotModel

KEPT_MODELS, KEPT_GROUPINGS, KEPT_SCENES = 4, 16, 2
SMALL_EXCESS = 2.0e-3  # [m]; a surface that lies no further outside of its body stands for it
FIELD_CELLS = 64  # of the field along each axis
FIELD_REACH_M = 2.5  # from the origin of the planning frame to the sides of the field at most
Grouping = tuple[tuple[int, ...], ...]


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


@dataclass(frozen=True, slots=True, eq=False)
class _Member:
    """One body of the arrays.

    Attributes:
        shape: its bounding geometry.
        joint: index of the joint that moves it, -1 for the world.
        pose: in the joint's frame, shape (3, 4).
        root: node at which its surface begins, -1 for none.
        is_environment: whether the surface is in the arrays of the scene and not in those of the robot.
        sphere: centre in the body's frame and radius [m] of a sphere around it.
    """

    shape: BoundingGeometry
    joint: int
    pose: Array
    root: int
    is_environment: bool
    sphere: Array


@lru_cache(maxsize=KEPT_MODELS)
def _tree(model: RobotModel) -> Tree:
    return tree_of(model)


@lru_cache(maxsize=KEPT_MODELS)
def _link_bounding_geometries(model: RobotModel) -> tuple[BoundingGeometry, ...]:
    """Bounding geometries of all links' shapes; surfaces without a closed form are moved into their joints' frames."""
    result = []
    for item in model.link_geometries:
        part = PlacedGeometry(Body(item.link, LINK), item.joint_id, item.placement, item.shape, 0.0)
        shape = bounding_geometry_of(part)
        if shape.kind == SURFACE and shape.corners is not None:
            shape = BoundingGeometry(
                partial(moved, shape.corners(), item.placement * shape.offset), is_closed=shape.is_closed
            )
        result.append(shape)
    return tuple(result)


def _link_surfaces(model: RobotModel, groups: Grouping) -> tuple[Surfaces, tuple[int, ...]]:
    """Surfaces of groups of links that share a joint, and the root of each group."""
    shapes = _link_bounding_geometries(model)
    flat = [shapes[number].surface for group in groups for number in group]
    surfaces, roots = stacked([item for item in flat if item is not None])
    spheres, boxes, links = list(surfaces.spheres), list(surfaces.boxes), list(surfaces.links)
    result, begin = [], 0
    for group in groups:
        result.append(_joined(spheres, boxes, links, roots[begin : begin + len(group)]))
        begin += len(group)
    return Surfaces(
        np.array(spheres).reshape(-1, 4),
        np.array(boxes).reshape(-1, 15),
        np.array(links, dtype=np.int32).reshape(-1, 2),
        surfaces.triangles,
    ), tuple(result)


def _joined(spheres: list[Array], boxes: list[Array], links: list[Array], roots: Sequence[int]) -> int:
    """Appends nodes above some roots; returns the topmost."""
    if len(roots) == 1:
        return roots[0]
    centres = np.array([spheres[root][:3] for root in roots])
    order = [roots[number] for number in np.argsort(centres[:, np.argmax(np.ptp(centres, axis=0))])]
    low, high = (_joined(spheres, boxes, links, part) for part in (order[: len(order) // 2], order[len(order) // 2 :]))
    one, two = spheres[low], spheres[high]
    gap = float(np.linalg.norm(two[:3] - one[:3]))
    radius = max(one[3], two[3], 0.5 * (gap + one[3] + two[3]))
    share = 0.5 if gap < 1e-12 else min(max((radius - one[3]) / gap, 0.0), 1.0)
    centre = one[:3] + share * (two[:3] - one[:3])
    reach = max(float(np.linalg.norm(item[:3] - centre)) + item[3] for item in (one, two))
    spheres.append(np.array([*centre, reach]))
    boxes.append(np.array([*centre, *np.eye(3).ravel(), reach, reach, reach]))
    links.append(np.array([low, high]))
    return len(spheres) - 1


def _groups(model: RobotModel, parts: Sequence[PlacedGeometry], pairs: WatchedPairs) -> Grouping:
    """Groups links that one joint moves, that have surfaces and are checked against the same bodies at one distance."""
    links, (first, second) = len(model.link_geometries), pairs.parts.T
    partners = np.full((len(parts), len(parts)), -1.0)  # the margin of a pair
    partners[first, second] = partners[second, first] = pairs.margins
    groups: dict[tuple[int, bytes], list[int]] = {}
    for number in np.flatnonzero((partners[:links] >= 0.0).any(axis=1)).tolist():
        shape = _link_bounding_geometries(model)[number]
        if shape.kind == SURFACE and shape.corners is not None:
            groups.setdefault((parts[number].joint_id, partners[number].tobytes()), []).append(number)
    return tuple(tuple(group) for group in groups.values())


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
    groups = _groups(model, parts, pairs)
    robot, joined, member_of_link = _link_members(model, groups)
    members, member_of = list(joined), dict(member_of_link)
    scene = _add_others(model, parts, pairs, members, member_of, check_interrupt)
    of_part = np.zeros(len(parts), dtype=np.int64)
    of_part[list(member_of.keys())] = list(member_of.values())
    ordered, is_compiled = _ordered(members, of_part[pairs.parts])
    firsts, rows = _distinct(ordered, pairs.margins, is_compiled)
    world = _arrays(model, members, robot, scene, ordered[firsts], pairs.margins[firsts])
    tabled = np.flatnonzero(~world.is_environment[world.pairs].any(axis=1))
    keys = _table_keys(model, groups, world.pairs[tabled].tobytes(), world.margins[tabled].tobytes())
    table_of = np.full(len(firsts), -1)
    has_table = np.array([key is not None for key in keys], dtype=bool)
    table_of[tabled[has_table]] = np.arange(np.count_nonzero(has_table))
    tables, joints = _tables(model, groups, tuple(key for key in keys if key is not None))
    world = _with_field(world._replace(tables=tables, table_joints=joints, table_of=table_of))
    world = _with_covers(model, groups, members, layers, world)
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
    _, distance = np.unique(margins, return_inverse=True)
    codes = (ordered[:, 0] * (ordered.max(initial=0) + 1) + ordered[:, 1]) * (distance.max(initial=0) + 1) + distance
    _, first, kinds = np.unique(codes[chosen], return_index=True, return_inverse=True)
    order = np.argsort(first)
    ranks = np.empty_like(order)
    ranks[order] = np.arange(len(order))
    rows[chosen] = ranks[kinds]
    return chosen[first[order]], rows


@lru_cache(maxsize=KEPT_GROUPINGS)
def _link_members(model: RobotModel, groups: Grouping) -> tuple[Surfaces, tuple[_Member, ...], dict[int, int]]:
    """Returns the surfaces of groups of links, a body for each group, and which one each link is part of."""
    members, member_of = [], {}
    robot, roots = _link_surfaces(model, groups)
    for group, root in zip(groups, roots, strict=True):
        closed = all(_link_bounding_geometries(model)[number].is_closed for number in group)
        joint, shape = model.link_geometries[group[0]].joint_id - 1, BoundingGeometry(None, is_closed=closed)
        members.append(_Member(shape, joint, np.eye(4)[:3], root, False, robot.spheres[root]))
        member_of.update(dict.fromkeys(group, len(members) - 1))
    return robot, tuple(members), member_of


def _add_others(
    model: RobotModel,
    parts: Sequence[PlacedGeometry],
    pairs: WatchedPairs,
    members: list[_Member],
    member_of: dict[int, int],
    check_interrupt: Callable[[], None],
) -> Surfaces:
    """Appends links in closed form, held objects and the world; returns the surfaces they need."""
    links = _link_bounding_geometries(model)
    others = [number for number in np.unique(pairs.parts).tolist() if number not in member_of]
    shapes = []
    for number in others:
        shapes.append(links[number] if number < len(links) else bounding_geometry_of(parts[number]))
        check_interrupt()
    wanted = _with_surface(dict(zip(others, shapes, strict=True)), parts, pairs)
    found = []
    for number, shape in zip(others, shapes, strict=True):
        if number in wanted and shape.surface is not None:
            found.append(shape)
            check_interrupt()
    surfaces, roots = _scene_surfaces(tuple(found))
    remaining = iter(roots)
    for number, shape in zip(others, shapes, strict=True):
        root = next(remaining) if number in wanted and shape.corners is not None else -1
        sphere = (
            np.array([0.0, 0.0, 0.0, shape.radius])
            if root < 0
            else (surfaces.spheres[root] + [0, 0, 0, shape.inflation_radius])
        )
        pose = (parts[number].placement * shape.offset).homogeneous[:3]
        member_of[number] = len(members)
        members.append(_Member(shape, parts[number].joint_id - 1, pose, root, True, sphere))
    return surfaces


@lru_cache(maxsize=KEPT_SCENES)
def _scene_surfaces(shapes: tuple[BoundingGeometry, ...]) -> tuple[Surfaces, tuple[int, ...]]:
    """Surfaces of a scene in one set of arrays; cached, because consecutive plans mostly have the same ones."""
    together, roots = stacked([shape.surface for shape in shapes if shape.surface is not None])
    return together, tuple(roots)


def _with_surface(
    shapes: Mapping[int, BoundingGeometry], parts: Sequence[PlacedGeometry], pairs: WatchedPairs
) -> set[int]:
    """Returns which bodies are checked by their surface.

    A solid of the world against a body whose surface is (nearly) exact is checked in closed form. Its triangles would
    not be used, and building a tree over them takes longer than many plans.
    """
    is_plain, is_inexact = np.zeros(len(parts), dtype=bool), np.zeros(len(parts), dtype=bool)
    for number, shape in shapes.items():
        is_plain[number] = parts[number].body.kind == WORLD and shape.kind != SURFACE and shape.solid_excess == 0.0
        is_inexact[number] = shape.surface_excess > SMALL_EXCESS
    needed = np.zeros(len(parts), dtype=bool)
    for number, other in (pairs.parts.T, pairs.parts.T[::-1]):
        needed[number[is_plain[number] & (is_inexact[other] | is_plain[other])]] = True
    return {number for number in shapes if needed[number] or not is_plain[number]}


def _ordered(members: Sequence[_Member], both: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Orders the two bodies of pairs such that the first one has a surface, the second a closed form if possible.

    Args:
        members: the bodies.
        both: two of them by number for each pair, shape (n, 2).

    Returns:
        The ordered pairs, and whether there is such an order.
    """
    has_surface = np.array([item.root >= 0 for item in members], dtype=bool)
    is_solid = np.array([item.shape.kind != SURFACE for item in members], dtype=bool)
    excess = _excess(members, both), _excess(members, both[:, ::-1])
    valid, rank = [], []
    for (first, second), outside in zip((both.T, both.T[::-1]), excess, strict=True):
        valid.append(has_surface[first] & (has_surface[second] | is_solid[second]))
        rank.append(2 * (outside <= SMALL_EXCESS) + is_solid[second])
    is_better = (rank[1] > rank[0]) | ((rank[1] == rank[0]) & (excess[1] < excess[0]))
    turned = valid[1] & (is_better | ~valid[0])
    return np.where(turned[:, None], both[:, ::-1], both), valid[0] | valid[1]


def _excess(members: Sequence[_Member], both: NDArray[np.int64]) -> Array:
    """Returns how far the surface of the first and the closed form or surface of the second body lie outside [m]."""
    surface = np.array([item.shape.surface_excess for item in members], dtype=float)
    other = np.array(
        [item.shape.surface_excess if item.shape.kind == SURFACE else item.shape.solid_excess for item in members],
        dtype=float,
    )
    return np.asarray(surface[both[:, 0]] + other[both[:, 1]])


@lru_cache(maxsize=KEPT_GROUPINGS)
def _table_keys(
    model: RobotModel, groups: Grouping, pairs: bytes, margins: bytes
) -> tuple[tuple[int, ...] | None, ...]:
    """Returns the keys of pairs of groups of links; cached, because consecutive plans mostly have the same ones."""
    _, members, _ = _link_members(model, groups)
    both = np.frombuffer(pairs, dtype=np.int64).reshape(-1, 2).tolist()
    return tuple(
        None if margin > 0.0 else _table_key(_tree(model), members[first], members[second])
        for (first, second), margin in zip(both, np.frombuffer(margins).tolist(), strict=True)
    )


def _table_key(tree: Tree, first: _Member, second: _Member) -> tuple[int, ...] | None:
    """Returns roots and joints (one or two) of two bodies of which one moves the other, or None."""
    if first.joint > second.joint:
        first, second = second, first
    between: list[int] = []
    joint = second.joint
    while joint > first.joint and len(between) < 3:
        between.append(joint)
        joint = int(tree.parents[joint])
    if joint != first.joint or not 1 <= len(between) <= 2 or tree.prismatic[between].any():
        return None
    return first.root, second.root, *between[::-1]


@lru_cache(maxsize=KEPT_GROUPINGS)
def _tables(
    model: RobotModel, groups: Grouping, keys: tuple[tuple[int, ...], ...]
) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """Tables (all unknown at first) of pairs of links.

    They hold in every scene: `model` and `groups` only say for which robot and bodies they are kept.
    """
    joints = np.array([(*key[2:], -1)[:2] for key in keys], dtype=np.int64).reshape(-1, 2)
    return np.full((len(keys), CELLS, CELLS), UNKNOWN, dtype=np.int8), joints


def _arrays(
    model: RobotModel,
    members: Sequence[_Member],
    robot: Surfaces,
    scene: Surfaces,
    pairs: NDArray[np.int64],
    margins: Array,
) -> World:
    inflation = np.array([item.shape.inflation_radius for item in members], dtype=float)
    kinds = np.array([item.shape.kind for item in members], dtype=np.int64)
    first, second = pairs.T
    return World(
        tree=_tree(model),
        joints=np.array([item.joint for item in members], dtype=np.int64),
        poses=np.array([item.pose for item in members], dtype=float).reshape(-1, 3, 4),
        roots=np.array([item.root for item in members], dtype=np.int64),
        is_environment=np.array([item.is_environment for item in members], dtype=bool),
        kinds=kinds,
        sizes=np.array([item.shape.size for item in members], dtype=float).reshape(-1, 3),
        spheres=np.array([item.sphere for item in members], dtype=float).reshape(-1, 4),
        closed=np.array([item.shape.is_closed for item in members], dtype=bool),
        robot=robot,
        scene=scene,
        pairs=pairs,
        margins=margins + inflation[first] + np.where(kinds[second] == SURFACE, inflation[second], 0.0),
        excess=_excess(members, pairs),
        tables=np.zeros((0, CELLS, CELLS), dtype=np.int8),
        table_joints=np.zeros((0, 2), dtype=np.int64),
        table_of=np.full(len(pairs), -1, dtype=np.int64),
        watched=np.arange(len(pairs)),
        represented=np.zeros((0, 0), dtype=np.int64),
        counts=np.zeros(CHECK_COUNTS, dtype=np.int64),
        refusals=np.zeros(len(pairs), dtype=np.int64),
        field=_field(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 4)), 0.0),
        covers=empty_covers(Layers(0, 0), len(_tree(model).parents), len(members), len(pairs)),
    )


def _with_field(world: World) -> World:
    """Lets one pair with the field stand for the pairs of a body with all solids of the world."""
    is_plain = (world.joints < 0) & (world.kinds != SURFACE)
    solid_pairs = np.flatnonzero(is_plain[world.pairs[:, 1]] & np.isfinite(world.excess))
    bodies, solids_of = world.pairs[solid_pairs].T
    pair_of = np.full((len(world.joints), len(world.joints)), -1)
    pair_of[bodies, solids_of] = solid_pairs
    partners: dict[int, list[int]] = {}
    for body, solid in zip(bodies.tolist(), solids_of.tolist(), strict=True):
        partners.setdefault(body, []).append(solid)
    counts: Counter[tuple[int, ...]] = Counter(tuple(sorted(solids)) for solids in partners.values())
    chosen = np.array(max(counts, key=lambda item: (counts[item] * len(item), item), default=()), dtype=np.int64)
    if len(chosen) < 2:
        return world
    moving = np.array(list(partners))
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


def _with_covers(
    model: RobotModel, groups: Grouping, members: Sequence[_Member], layers: Layers, world: World
) -> World:
    """Adds spheres around the moving bodies and balls inside of them."""
    covers = empty_covers(layers, len(world.tree.parents), len(members), len(world.pairs))
    links = _link_covers(model, groups, layers)
    count = len(links.spheres)
    covers.spheres[:count], covers.balls[:count], covers.extents[:count] = links.spheres, links.balls, links.extents
    for number in range(count, len(members)):
        item = members[number]
        if item.joint < 0:
            continue
        if layers.balls:
            covers.balls[number, 0] = *item.pose[:, 3], item.shape.inner_radius
        if layers.nodes:
            covers.spheres[number] = (
                single_sphere(item.sphere, item.pose, layers.nodes)
                if item.root < 0
                else heap_of(world.scene, item.root, item.pose, layers.nodes, item.shape.inflation_radius)
            )
            covers.extents[number] = extents_of(covers.spheres[number : number + 1])[0]
    meets = meeting_joints(world.pairs, world.joints, world.tree.parents)
    boxes = boxes_around(world.field.kinds, world.field.sizes, world.field.poses)
    return world._replace(covers=covers._replace(lengths=links.lengths, meets=meets, boxes=boxes))


@lru_cache(maxsize=KEPT_GROUPINGS)
def _link_covers(model: RobotModel, groups: Grouping, layers: Layers) -> Covers:
    """Spheres around groups of links and balls inside of them, and the lengths of the joints."""
    surfaces, members, _ = _link_members(model, groups)
    covers = empty_covers(layers, 0, len(members), 0)
    for number, item in enumerate(members):
        if layers.nodes:
            covers.spheres[number] = heap_of(surfaces, item.root, item.pose, layers.nodes)
    if layers.balls:
        covers.balls[:] = _link_balls(model, groups, layers.balls)
    lengths = np.linalg.norm(_tree(model).placements[:, :, 3], axis=1)
    return covers._replace(extents=extents_of(covers.spheres), lengths=lengths)


@lru_cache(maxsize=KEPT_GROUPINGS)
def _link_balls(model: RobotModel, groups: Grouping, most: int) -> Array:
    """Balls inside of groups of links, shape (groups, most, 4)."""
    surfaces, members, _ = _link_members(model, groups)
    closed = [
        balls_inside(surfaces, item.root, most) if item.shape.is_closed else np.zeros((most, 4)) for item in members
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
