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
from modular_framework_planning.collision_detection.collision_bodies import PlacedGeometry, WatchedPairs
from modular_framework_planning.collision_detection.kernels.compiled_distance import SURFACE
from modular_framework_planning.collision_detection.kernels.compiled_triangles import Surfaces
from modular_framework_planning.contacts import LINK, WORLD, Body
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.robot_model.robot_model import RobotModel

KEPT_MODELS, KEPT_GROUPINGS, KEPT_SCENES = 4, 16, 2
SMALL_EXCESS = 2.0e-3  # [m]; a surface that lies no further outside of its body stands for it
Grouping = tuple[tuple[int, ...], ...]


class BodyArrays(NamedTuple):
    """Bodies and their bounding geometries; what has the same name in World is explained there.

    Attributes:
        inflation: radius of a ball around each point of a body's surface that belongs to it [m]; shape (b,).
        surface_excess, solid_excess: how far surface and closed form lie outside of a body at most [m]; shape (b,).
        inner_radii: of the largest ball around the origin of the closed form that lies inside [m], 0 where none is
            known; shape (b,).
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
    inner_radii: Array


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
    groups = _groups(model, parts, pairs)
    robot, of_groups, body_of_link = link_groups(model, groups)
    is_in_pair, of_part = np.zeros(len(parts), dtype=bool), np.full(len(parts), -1)
    is_in_pair[pairs.parts] = True
    of_part[: len(body_of_link)] = body_of_link
    others = np.flatnonzero(is_in_pair & (of_part < 0))
    of_part[others] = len(groups) + np.arange(len(others))
    scene, of_others = _other_bodies(model, parts, others.tolist(), pairs, check_interrupt)
    arrays = BodyArrays(*(np.concatenate(both) for both in zip(of_groups, of_others, strict=True)))
    return SceneBodies(groups, robot, scene, arrays, of_part)


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
    arrays.roots[:], arrays.spheres[:] = roots, surfaces.spheres[list(roots)]
    return surfaces, arrays, body_of_link


def _other_bodies(
    model: RobotModel,
    parts: Sequence[PlacedGeometry],
    others: Sequence[int],
    pairs: WatchedPairs,
    check_interrupt: Callable[[], None],
) -> tuple[Surfaces, BodyArrays]:
    """Returns links in closed form, held objects and the world, and the surfaces they need."""
    links, shapes = _link_bounding_geometries(model), []
    for number in others:
        shapes.append(links[number] if number < len(links) else bounding_geometry_of(parts[number]))
        check_interrupt()
    arrays = _body_arrays(shapes, [parts[number].joint_id - 1 for number in others], is_environment=True)
    found, has_surface = [], _need_surface(arrays, shapes, parts, others, pairs)
    for number in np.flatnonzero(has_surface).tolist():
        if shapes[number].surface is not None:
            found.append(shapes[number])
        check_interrupt()
    surfaces, roots = _scene_surfaces(tuple(found))
    arrays.roots[has_surface] = roots
    arrays.spheres[has_surface] = surfaces.spheres[list(roots)]
    arrays.spheres[has_surface, 3] += arrays.inflation[has_surface]
    count = sum(number < len(links) for number in others)
    arrays.poses[:count] = _link_poses(model)[list(others[:count])]
    for row in range(count, len(others)):
        arrays.poses[row] = _pose(parts[others[row]].placement, shapes[row])
    return surfaces, arrays


def _body_arrays(shapes: Sequence[BoundingGeometry], joints: Sequence[int], is_environment: bool) -> BodyArrays:
    """Returns bodies in the frames of their joints, without surfaces."""
    numbers = np.concatenate([np.zeros(0), *(shape.numbers for shape in shapes)]).reshape(-1, 10)
    spheres = np.zeros((len(shapes), 4))
    spheres[:, 3] = numbers[:, 8]
    return BodyArrays(
        joints=np.array(joints, dtype=np.int64),
        poses=np.tile(np.eye(4)[:3], (len(shapes), 1, 1)),
        roots=np.full(len(shapes), -1),
        is_environment=np.full(len(shapes), is_environment),
        spheres=spheres,
        kinds=numbers[:, 0].astype(np.int64),
        sizes=numbers[:, 1:4].copy(),
        inflation=numbers[:, 4].copy(),
        surface_excess=numbers[:, 5].copy(),
        solid_excess=numbers[:, 6].copy(),
        closed=numbers[:, 7] > 0.0,
        inner_radii=numbers[:, 9].copy(),
    )


@lru_cache(maxsize=KEPT_MODELS)
def _link_poses(model: RobotModel) -> Array:
    """Poses of all links' bounding geometries in their joints' frames, shape (links, 3, 4)."""
    shapes = _link_bounding_geometries(model)
    poses = [_pose(item.placement, shape) for item, shape in zip(model.link_geometries, shapes, strict=True)]
    return np.array(poses).reshape(-1, 3, 4)


def _pose(placement: Transform, shape: BoundingGeometry) -> Array:
    return np.asarray((placement * shape.offset).homogeneous[:3])


@lru_cache(maxsize=KEPT_SCENES)
def _scene_surfaces(shapes: tuple[BoundingGeometry, ...]) -> tuple[Surfaces, tuple[int, ...]]:
    """Surfaces of a scene in one set of arrays; cached, because consecutive plans mostly have the same ones."""
    together, roots = stacked([shape.surface for shape in shapes if shape.surface is not None])
    return together, tuple(roots)


def _need_surface(
    arrays: BodyArrays,
    shapes: Sequence[BoundingGeometry],
    parts: Sequence[PlacedGeometry],
    others: Sequence[int],
    pairs: WatchedPairs,
) -> NDArray[np.bool_]:
    """Returns which bodies are checked by their surface.

    A solid of the world against a body whose surface is (nearly) exact is checked in closed form. Its triangles would
    not be used, and building a tree over them takes longer than many plans.
    """
    chosen = list(others)
    is_world = np.array([parts[number].body.kind == WORLD for number in others], dtype=bool)
    is_plain, is_inexact, needed = np.zeros((3, len(parts)), dtype=bool)
    is_plain[chosen] = is_world & (arrays.kinds != SURFACE) & (arrays.solid_excess == 0.0)
    is_inexact[chosen] = arrays.surface_excess > SMALL_EXCESS
    for number, other in (pairs.parts.T, pairs.parts.T[::-1]):
        needed[number[is_plain[number] & (is_inexact[other] | is_plain[other])]] = True
    has_surface = np.array([shape.corners is not None for shape in shapes], dtype=bool)
    return np.asarray((needed[chosen] | ~is_plain[chosen]) & has_surface)
