# SPDX-License-Identifier: BSD-3-Clause
"""Puts the bodies of a scene into arrays: groups of links first, then other links, held objects and the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.bounding_geometry import (
    BoundingGeometry,
    bounding_geometry_of,
    moved,
    stacked,
)
from modular_framework_planning.collision_detection.collision_bodies import KEPT_PAIRS, PlacedGeometry, WatchedPairs
from modular_framework_planning.collision_detection.kernels.compiled_distance import SURFACE
from modular_framework_planning.collision_detection.kernels.compiled_triangles import Surfaces
from modular_framework_planning.contacts import LINK, WORLD, Body
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import MAX_CACHED_MODELS, LinkGeometry, RobotModel

KEPT_GROUPINGS, KEPT_SCENES = 16, 2
SMALL_EXCESS = 2.0e-3  # [m]; a surface that lies no further outside of its body stands for it
Grouping = tuple[tuple[int, ...], ...]


class BodyArrays(NamedTuple):
    """Bodies and their bounding geometries; what has the same name in World is explained there.

    Attributes:
        inflation: radius of a ball around each point of a body's surface that belongs to it [m]; shape (b,).
        surface_excess, solid_excess: how far surface and closed form lie outside of a body at most [m]; shape (b,).
    """

    joints: NDArray[np.int64]
    poses: Array
    roots: NDArray[np.int64]
    is_environment: NDArray[np.bool_]
    spheres: Array
    kinds: NDArray[np.int64]
    sizes: Array
    inflation: Array
    surface_excess: Array
    solid_excess: Array
    closed: NDArray[np.bool_]


class SceneBodies(NamedTuple):
    """The bodies of a scene.

    Attributes:
        groups: links of the model, by number, that are one body each; these bodies come first.
        robot, scene: surfaces of these bodies, and of all others.
        arrays: the bodies.
        of_part: body of each geometry of the scene, -1 where no pair has it.
    """

    groups: Grouping
    robot: Surfaces
    scene: Surfaces
    arrays: BodyArrays
    of_part: NDArray[np.int64]


def scene_bodies(
    model: RobotModel, parts: Sequence[PlacedGeometry], pairs: WatchedPairs, check_interrupt: Callable[[], None]
) -> SceneBodies:
    """Returns the bodies that are in a pair.

    Args:
        model: the robot.
        parts: geometries of the scene, the model's links first.
        pairs: the pairs to watch.
        check_interrupt: called between shapes; raises an exception to stop.
    """
    links, count = _links(model, pairs), len(model.link_geometries)
    is_in_pair, of_part = np.zeros(len(parts), dtype=bool), np.full(len(parts), -1)
    is_in_pair[pairs.parts] = True
    others = count + np.flatnonzero(is_in_pair[count:])
    of_part[:count], of_part[others] = links.of_link, len(links.arrays.joints) + np.arange(len(others))
    shapes = []
    for number in others.tolist():
        shapes.append(bounding_geometry_of(parts[number]))
        check_interrupt()
    of_others = _single_bodies(shapes, [parts[number] for number in others.tolist()])
    found, has_surface = list(links.with_surface), _need_surface(links, of_others, shapes, parts, others, pairs)
    for row in np.flatnonzero(has_surface).tolist():
        if shapes[row].surface is not None:  # which is built now, if it was not
            found.append(shapes[row])
        check_interrupt()
    surfaces, roots = _scene_surfaces(tuple(found))
    _set_surfaces(of_others, has_surface, surfaces, roots[len(links.with_surface) :])
    arrays = BodyArrays(*(np.concatenate(both) for both in zip(links.arrays, of_others, strict=True)))
    return SceneBodies(links.groups, links.robot, surfaces, arrays, of_part)


class _Links(NamedTuple):
    """The links that are in a pair: groups of links with surfaces, then links in closed form.

    Attributes:
        groups, robot, arrays: see SceneBodies.
        with_surface: the links in closed form whose surfaces come first among those of the scene.
        of_link: body of each link, -1 for none.
        is_inexact: whether the surface of each link in closed form lies outside of it by more than SMALL_EXCESS.
    """

    groups: Grouping
    robot: Surfaces
    arrays: BodyArrays
    with_surface: tuple[BoundingGeometry, ...]
    of_link: NDArray[np.int64]
    is_inexact: NDArray[np.bool_]


@lru_cache(maxsize=KEPT_PAIRS)
def _links(model: RobotModel, pairs: WatchedPairs) -> _Links:
    groups, geometries, shapes = _groups(model, pairs), model.link_geometries, _link_bounding_geometries(model)
    robot, of_groups, of_link = link_groups(model, groups)
    is_in_pair = np.zeros(len(geometries), dtype=bool)
    is_in_pair[pairs.parts[pairs.parts < len(geometries)]] = True
    numbers = np.flatnonzero(is_in_pair & (of_link < 0)).tolist()
    of_link, is_inexact = of_link.copy(), np.zeros(len(geometries), dtype=bool)
    of_link[numbers] = len(groups) + np.arange(len(numbers))
    singles = [shapes[number] for number in numbers]
    arrays = _single_bodies(singles, [geometries[number] for number in numbers])
    has_surface = np.array([shape.corners is not None for shape in singles], dtype=bool)
    with_surface = tuple(shape for shape in singles if shape.corners is not None)
    _set_surfaces(arrays, has_surface, *stacked([shape.surface for shape in with_surface if shape.surface is not None]))
    is_inexact[numbers] = arrays.surface_excess > SMALL_EXCESS
    both = BodyArrays(*(np.concatenate(rows) for rows in zip(of_groups, arrays, strict=True)))
    return _Links(groups, robot, both, with_surface, of_link, is_inexact)


@lru_cache(maxsize=MAX_CACHED_MODELS)
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


def _groups(model: RobotModel, pairs: WatchedPairs) -> Grouping:
    """Groups links that one joint moves, that have surfaces and are checked against the same bodies at one distance."""
    links, count = len(model.link_geometries), int(pairs.parts.max(initial=-1)) + 1
    first, second = pairs.parts.T
    partners = np.full((count, count), -1.0)  # the margin of a pair
    partners[first, second] = partners[second, first] = pairs.margins
    groups: dict[tuple[int, bytes], list[int]] = {}
    for number in np.flatnonzero((partners[:links] >= 0.0).any(axis=1)).tolist():
        shape = _link_bounding_geometries(model)[number]
        if shape.kind == SURFACE and shape.corners is not None:
            key = model.link_geometries[number].joint_id, partners[number].tobytes()
            groups.setdefault(key, []).append(number)
    return tuple(tuple(group) for group in groups.values())


@lru_cache(maxsize=KEPT_GROUPINGS)
def link_groups(model: RobotModel, groups: Grouping) -> tuple[Surfaces, BodyArrays, NDArray[np.int64]]:
    """Returns the surfaces of groups of links, a body for each group, and the body of each link, -1 for none."""
    surfaces, roots = _link_surfaces(model, groups)
    links, shapes, body_of_link = _link_bounding_geometries(model), [], np.full(len(model.link_geometries), -1)
    for number, group in enumerate(groups):
        body_of_link[list(group)] = number
        shapes.append(BoundingGeometry(None, is_closed=all(links[link].is_closed for link in group)))
    joints = [model.link_geometries[group[0]].joint_id - 1 for group in groups]
    arrays = _body_arrays(shapes, joints, is_environment=False)
    _set_surfaces(arrays, np.ones(len(groups), dtype=bool), surfaces, roots)
    return surfaces, arrays, body_of_link


def _body_arrays(shapes: Sequence[BoundingGeometry], joints: Sequence[int], is_environment: bool) -> BodyArrays:
    """Returns bodies in the frames of their joints, without surfaces."""
    columns = np.array([shape.numbers for shape in shapes], dtype=float).reshape(-1, 9).T.copy()
    kinds, x, y, z, inflation, surface_excess, solid_excess, closed, radii = columns
    spheres = np.zeros((len(shapes), 4))
    spheres[:, 3] = radii
    return BodyArrays(
        joints=np.array(joints, dtype=np.int64),
        poses=np.tile(np.eye(4)[:3], (len(shapes), 1, 1)),
        roots=np.full(len(shapes), -1),
        is_environment=np.full(len(shapes), is_environment),
        spheres=spheres,
        kinds=kinds.astype(np.int64),
        sizes=np.column_stack([x, y, z]),
        inflation=inflation,
        surface_excess=surface_excess,
        solid_excess=solid_excess,
        closed=closed > 0.0,
    )


def _single_bodies(shapes: Sequence[BoundingGeometry], items: Sequence[PlacedGeometry | LinkGeometry]) -> BodyArrays:
    """Returns a body for each geometry, at its place, without surfaces."""
    arrays = _body_arrays(shapes, [item.joint_id - 1 for item in items], is_environment=True)
    for row, (shape, item) in enumerate(zip(shapes, items, strict=True)):
        arrays.poses[row] = (item.placement * shape.offset).homogeneous[:3]
    return arrays


def _set_surfaces(arrays: BodyArrays, has_surface: NDArray[np.bool_], surfaces: Surfaces, roots: Sequence[int]) -> None:
    """Gives bodies their surfaces: roots in the order of these bodies, and the spheres around them."""
    arrays.roots[has_surface] = roots
    arrays.spheres[has_surface] = surfaces.spheres[list(roots)]
    arrays.spheres[has_surface, 3] += arrays.inflation[has_surface]


@lru_cache(maxsize=KEPT_SCENES)
def _scene_surfaces(shapes: tuple[BoundingGeometry, ...]) -> tuple[Surfaces, tuple[int, ...]]:
    """Surfaces of a scene in one set of arrays; cached, because consecutive plans mostly have the same ones."""
    together, roots = stacked([shape.surface for shape in shapes if shape.surface is not None])
    return together, tuple(roots)


def _need_surface(
    links: _Links,
    arrays: BodyArrays,
    shapes: Sequence[BoundingGeometry],
    parts: Sequence[PlacedGeometry],
    others: NDArray[np.int64],
    pairs: WatchedPairs,
) -> NDArray[np.bool_]:
    """Returns which held objects and bodies of the world are checked by their surface.

    A solid of the world against a body whose surface is (nearly) exact is checked in closed form. Its triangles would
    not be used, and building a tree over them takes longer than many plans.
    """
    is_world = np.array([parts[number].body.kind == WORLD for number in others.tolist()], dtype=bool)
    is_plain, is_inexact, is_needed = np.zeros((3, len(parts)), dtype=bool)
    is_plain[others] = is_world & (arrays.kinds != SURFACE) & (arrays.solid_excess == 0.0)
    is_inexact[: len(links.is_inexact)], is_inexact[others] = links.is_inexact, arrays.surface_excess > SMALL_EXCESS
    for number, other in (pairs.parts.T, pairs.parts.T[::-1]):
        is_needed[number[is_plain[number] & (is_inexact[other] | is_plain[other])]] = True
    has_surface = np.array([shape.corners is not None for shape in shapes], dtype=bool)
    return np.asarray((is_needed[others] | ~is_plain[others]) & has_surface)
