# SPDX-License-Identifier: BSD-3-Clause
"""Arrays of the bodies in a scene: groups of links first, then other links, held objects and the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.bounding_geometry import (
    BoundingGeometry,
    bounding_geometry_of,
    stack_surfaces,
    transform_triangles,
)
from modular_framework_planning.collision_detection.collision_bodies import (
    PAIR_CACHE_SIZE,
    PlacedGeometry,
    WatchedPairs,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import SURFACE
from modular_framework_planning.collision_detection.kernels.compiled_triangles import Surfaces
from modular_framework_planning.contacts import LINK, WORLD, Body
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import MAX_CACHED_MODELS, LinkGeometry, RobotModel

GROUPING_CACHE_SIZE, SCENE_CACHE_SIZE = 16, 2
SMALL_EXCESS = 2.0e-3  # maximum excess of a surface that counts as exact [m]
Grouping = tuple[tuple[int, ...], ...]


class BodyArrays(NamedTuple):
    """Bodies and their bounding geometries; World documents the fields that both classes have.

    Attributes:
        inflation: Radius by which the surface of each body is inflated, shape (b,) [m].
        surface_excess: Maximum distance of each surface outside its body, shape (b,) [m].
        solid_excess: Maximum distance of each closed form outside its body, shape (b,) [m].
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
        groups: Indices of the link geometries that form one body each; these bodies come first.
        robot: Surfaces of the groups.
        scene: Surfaces of all other bodies.
        arrays: Arrays of the bodies.
        body_of_part: Body index of each geometry, -1 for a geometry without pairs.
    """

    groups: Grouping
    robot: Surfaces
    scene: Surfaces
    arrays: BodyArrays
    body_of_part: NDArray[np.int64]


def scene_bodies(
    model: RobotModel, parts: Sequence[PlacedGeometry], pairs: WatchedPairs, check_interrupt: Callable[[], None]
) -> SceneBodies:
    """Returns the bodies that occur in a watched pair.

    Args:
        model: Robot model.
        parts: Geometries of the scene, the model's links first.
        pairs: Watched pairs.
        check_interrupt: Function called between shapes; raises an exception to stop.
    """
    links, count = _links(model, pairs), len(model.link_geometries)
    is_in_pair, body_of_part = np.zeros(len(parts), dtype=bool), np.full(len(parts), -1)
    is_in_pair[pairs.parts] = True
    others = count + np.flatnonzero(is_in_pair[count:])
    body_of_part[:count], body_of_part[others] = (
        links.body_of_link,
        len(links.arrays.joints) + np.arange(len(others)),
    )
    shapes = []
    for index in others.tolist():
        shapes.append(bounding_geometry_of(parts[index]))
        check_interrupt()
    other_arrays = _single_bodies(shapes, [parts[index] for index in others.tolist()])
    has_triangles = np.array([shape.triangles is not None for shape in shapes], dtype=bool)
    has_surface = has_triangles & _need_surface(links, other_arrays, parts, others, pairs)
    with_surface = list(links.with_surface)
    for row in np.flatnonzero(has_surface).tolist():
        if shapes[row].surface is not None:  # builds the surface on first use
            with_surface.append(shapes[row])
        check_interrupt()
    surfaces, roots = _scene_surfaces(tuple(with_surface))
    _set_surfaces(other_arrays, has_surface, surfaces, roots[len(links.with_surface) :])
    arrays = BodyArrays(*(np.concatenate(both) for both in zip(links.arrays, other_arrays, strict=True)))
    return SceneBodies(links.groups, links.robot, surfaces, arrays, body_of_part)


class _Links(NamedTuple):
    """The links that occur in a pair: groups of links with surfaces, then links in closed form.

    Attributes:
        groups, robot, arrays: See SceneBodies.
        with_surface: Links in closed form; their surfaces come first in SceneBodies.scene.
        body_of_link: Body index of each link, -1 for none.
        is_inexact: Whether the surface excess of each link in closed form is above SMALL_EXCESS.
    """

    groups: Grouping
    robot: Surfaces
    arrays: BodyArrays
    with_surface: tuple[BoundingGeometry, ...]
    body_of_link: NDArray[np.int64]
    is_inexact: NDArray[np.bool_]


@lru_cache(maxsize=PAIR_CACHE_SIZE)
def _links(model: RobotModel, pairs: WatchedPairs) -> _Links:
    groups, geometries, shapes = _groups(model, pairs), model.link_geometries, _link_bounding_geometries(model)
    robot, group_arrays, body_of_link = link_groups(model, groups)
    is_in_pair = np.zeros(len(geometries), dtype=bool)
    is_in_pair[pairs.parts[pairs.parts < len(geometries)]] = True
    indices = np.flatnonzero(is_in_pair & (body_of_link < 0)).tolist()
    body_of_link, is_inexact = body_of_link.copy(), np.zeros(len(geometries), dtype=bool)
    body_of_link[indices] = len(groups) + np.arange(len(indices))
    singles = [shapes[index] for index in indices]
    arrays = _single_bodies(singles, [geometries[index] for index in indices])
    has_surface = np.array([shape.triangles is not None for shape in singles], dtype=bool)
    with_surface = tuple(shape for shape in singles if shape.triangles is not None)
    _set_surfaces(
        arrays, has_surface, *stack_surfaces([shape.surface for shape in with_surface if shape.surface is not None])
    )
    is_inexact[indices] = arrays.surface_excess > SMALL_EXCESS
    both = BodyArrays(*(np.concatenate(rows) for rows in zip(group_arrays, arrays, strict=True)))
    return _Links(groups, robot, both, with_surface, body_of_link, is_inexact)


@lru_cache(maxsize=MAX_CACHED_MODELS)
def _link_bounding_geometries(model: RobotModel) -> tuple[BoundingGeometry, ...]:
    """Returns the bounding geometry of every link shape; surfaces without a closed form are in their joints' frames."""
    result = []
    for item in model.link_geometries:
        part = PlacedGeometry(Body(item.link, LINK), item.joint_id, item.placement, item.shape, 0.0)
        shape = bounding_geometry_of(part)
        if shape.kind == SURFACE and shape.triangles is not None:
            shape = BoundingGeometry(
                partial(transform_triangles, shape.triangles(), item.placement * shape.offset),
                is_closed=shape.is_closed,
            )
        result.append(shape)
    return tuple(result)


def _link_surfaces(model: RobotModel, groups: Grouping) -> tuple[Surfaces, tuple[int, ...]]:
    """Returns the surfaces of groups of links that share a joint, and the root node of each group."""
    shapes = _link_bounding_geometries(model)
    flat = [shapes[index].surface for group in groups for index in group]
    surfaces, roots = stack_surfaces([item for item in flat if item is not None])
    spheres, boxes, children = list(surfaces.spheres), list(surfaces.boxes), list(surfaces.children)
    result, begin = [], 0
    for group in groups:
        result.append(_join_trees(spheres, boxes, children, roots[begin : begin + len(group)]))
        begin += len(group)
    return Surfaces(
        np.array(spheres).reshape(-1, 4),
        np.array(boxes).reshape(-1, 15),
        np.array(children, dtype=np.int32).reshape(-1, 2),
        surfaces.triangles,
    ), tuple(result)


def _join_trees(spheres: list[Array], boxes: list[Array], children: list[Array], roots: Sequence[int]) -> int:
    """Joins trees under new nodes and returns the new root."""
    if len(roots) == 1:
        return roots[0]
    centres = np.array([spheres[root][:3] for root in roots])
    order = [roots[index] for index in np.argsort(centres[:, np.argmax(np.ptp(centres, axis=0))])]
    low, high = (
        _join_trees(spheres, boxes, children, half) for half in (order[: len(order) // 2], order[len(order) // 2 :])
    )
    first, second = spheres[low], spheres[high]
    centre_distance = float(np.linalg.norm(second[:3] - first[:3]))
    radius = max(first[3], second[3], 0.5 * (centre_distance + first[3] + second[3]))
    fraction = 0.5 if centre_distance < 1e-12 else min(max((radius - first[3]) / centre_distance, 0.0), 1.0)
    centre = first[:3] + fraction * (second[:3] - first[:3])
    reach = max(float(np.linalg.norm(item[:3] - centre)) + item[3] for item in (first, second))
    spheres.append(np.array([*centre, reach]))
    boxes.append(np.array([*centre, *np.eye(3).ravel(), reach, reach, reach]))
    children.append(np.array([low, high]))
    return len(spheres) - 1


def _groups(model: RobotModel, pairs: WatchedPairs) -> Grouping:
    """Groups surfaces that one joint moves and that have the same partners at the same margins."""
    links, count = len(model.link_geometries), int(pairs.parts.max(initial=-1)) + 1
    first, second = pairs.parts.T
    pair_margins = np.full((count, count), -1.0)
    pair_margins[first, second] = pair_margins[second, first] = pairs.margins
    groups: dict[tuple[int, bytes], list[int]] = {}
    for index in np.flatnonzero((pair_margins[:links] >= 0.0).any(axis=1)).tolist():
        shape = _link_bounding_geometries(model)[index]
        if shape.kind == SURFACE and shape.triangles is not None:
            key = model.link_geometries[index].joint_id, pair_margins[index].tobytes()
            groups.setdefault(key, []).append(index)
    return tuple(tuple(group) for group in groups.values())


class LinkGroups(NamedTuple):
    """Groups of links.

    Attributes:
        surfaces: Surfaces of the groups.
        bodies: A body for each group.
        body_of_link: Body index of each link, -1 for none.
    """

    surfaces: Surfaces
    bodies: BodyArrays
    body_of_link: NDArray[np.int64]


@lru_cache(maxsize=GROUPING_CACHE_SIZE)
def link_groups(model: RobotModel, groups: Grouping) -> LinkGroups:
    """Returns the surfaces and bodies of groups of links."""
    surfaces, roots = _link_surfaces(model, groups)
    links, shapes, body_of_link = _link_bounding_geometries(model), [], np.full(len(model.link_geometries), -1)
    for body, group in enumerate(groups):
        body_of_link[list(group)] = body
        shapes.append(BoundingGeometry(None, is_closed=all(links[link].is_closed for link in group)))
    joints = [model.link_geometries[group[0]].joint_id - 1 for group in groups]
    arrays = _body_arrays(shapes, joints, is_environment=False)
    _set_surfaces(arrays, np.ones(len(groups), dtype=bool), surfaces, roots)
    return LinkGroups(surfaces, arrays, body_of_link)


def _body_arrays(shapes: Sequence[BoundingGeometry], joints: Sequence[int], is_environment: bool) -> BodyArrays:
    """Returns bodies without surfaces, posed at the origins of their joints' frames."""
    columns = np.array([shape.array_row for shape in shapes], dtype=float).reshape(-1, 9).T.copy()
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
    """Returns a body without surface for each geometry, at the geometry's pose."""
    arrays = _body_arrays(shapes, [item.joint_id - 1 for item in items], is_environment=True)
    for row, (shape, item) in enumerate(zip(shapes, items, strict=True)):
        arrays.poses[row] = (item.placement * shape.offset).homogeneous[:3]
    return arrays


def _set_surfaces(arrays: BodyArrays, has_surface: NDArray[np.bool_], surfaces: Surfaces, roots: Sequence[int]) -> None:
    """Assigns surfaces to bodies."""
    arrays.roots[has_surface] = roots
    arrays.spheres[has_surface] = surfaces.spheres[list(roots)]
    arrays.spheres[has_surface, 3] += arrays.inflation[has_surface]


@lru_cache(maxsize=SCENE_CACHE_SIZE)
def _scene_surfaces(shapes: tuple[BoundingGeometry, ...]) -> tuple[Surfaces, tuple[int, ...]]:
    """Returns all surfaces of a scene in one set of arrays; consecutive plans mostly share them."""
    surfaces, roots = stack_surfaces([shape.surface for shape in shapes if shape.surface is not None])
    return surfaces, tuple(roots)


def _need_surface(
    links: _Links,
    arrays: BodyArrays,
    parts: Sequence[PlacedGeometry],
    others: NDArray[np.int64],
    pairs: WatchedPairs,
) -> NDArray[np.bool_]:
    """Returns whether each held object and body of the world with triangles needs a surface.

    A solid of the world is checked in closed form against bodies with a (nearly) exact surface. Its triangles would
    not be used, and building a tree over triangles takes longer than many plans.
    """
    is_world = np.array([parts[index].body.kind == WORLD for index in others.tolist()], dtype=bool)
    is_plain, is_inexact, is_needed = np.zeros((3, len(parts)), dtype=bool)
    is_plain[others] = is_world & (arrays.kinds != SURFACE) & (arrays.solid_excess == 0.0)
    is_inexact[: len(links.is_inexact)], is_inexact[others] = links.is_inexact, arrays.surface_excess > SMALL_EXCESS
    for part, other in (pairs.parts.T, pairs.parts.T[::-1]):
        is_needed[part[is_plain[part] & (is_inexact[other] | is_plain[other])]] = True
    return np.asarray(is_needed[others] | ~is_plain[others])
