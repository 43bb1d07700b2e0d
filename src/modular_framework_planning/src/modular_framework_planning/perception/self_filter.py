# SPDX-License-Identifier: BSD-3-Clause
"""Finds the points of a depth sensor that lie on the robot or on objects the scene already has.

Every shape is covered by a convex region: a ball cut by half-spaces. A region is padded by moving its planes outwards,
so it holds at least what the padded shape holds; a mesh is covered by its convex hull.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np

from modular_framework_planning.geometry.shapes import Plane
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.octomap.compiled_voxels import within_regions
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

ROUND_SIDES = 24
DEPTH_NOISE = 0.125 / (525.0 * 0.075)  # [1/m]; a disparity step of 1/8 pixel over focal length [pixel] and baseline [m]

MAX_PLANES = 64  # of a region; a hull with more is covered by planes that touch it, less than 3 % larger where round


def _even_directions(count: int) -> Array:
    """Unit vectors spread over the sphere along a spiral (count, 3), and both directions of each axis."""
    heights = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    angles = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    widths = np.sqrt(1.0 - heights**2)
    spiral = np.column_stack([widths * np.cos(angles), widths * np.sin(angles), heights])
    return np.vstack([np.eye(3), -np.eye(3), spiral])


DIRECTIONS = _even_directions(MAX_PLANES - 6)


@dataclass(frozen=True, slots=True)
class Region:
    """A convex region in the frame of a body: a ball around `center` [m] cut by half-spaces n.x + d <= 0.

    Attributes:
        planes: unit normal and d [m] of each half-space (m, 4).
    """

    center: Array
    radius: float
    planes: Array


@dataclass(frozen=True, slots=True)
class SelfFilter:
    """Regions of all bodies in one frame, padded and scaled.

    Attributes:
        balls: centre and radius of each region's ball (k, 4) [m].
        planes: half-spaces of all regions (m, 4).
        starts: where the planes of each region begin (k + 1,).
    """

    balls: Array
    planes: Array
    starts: Any

    def hides(self, points: Array, origin: Array, shadow: float = 0.0) -> Any:
        """Returns which points (n, 3) [m] lie in a region, or up to `shadow` [m] behind one as seen from `origin`."""
        return within_regions(
            np.ascontiguousarray(points, dtype=float),
            np.asarray(origin, dtype=float),
            shadow,
            self.balls,
            self.planes,
            self.starts,
        )


class RegionCache:
    """Builds the region of a Coal geometry once."""

    def __init__(self) -> None:
        self._regions: dict[int, tuple[Any, Region]] = {}

    def __len__(self) -> int:
        """Returns how many regions are kept."""
        return len(self._regions)

    def region(self, geometry: Any) -> Region:
        """Returns the region that covers a geometry."""
        known = self._regions.get(id(geometry))
        if known is None:
            known = self._regions[id(geometry)] = (geometry, _region_of(geometry))
        return known[1]

    def keep_only(self, geometries: Iterable[Any]) -> None:
        """Forgets geometries that are no longer in use."""
        wanted = {id(item) for item in geometries}
        self._regions = {key: value for key, value in list(self._regions.items()) if key in wanted}


FilterMaker = Callable[[RegionCache, Sequence[tuple[Any, Transform]], Array], SelfFilter]


def _region_of(geometry: Any) -> Region:
    middle = np.zeros(3)
    match geometry:
        case coal.Box():
            half = np.array(geometry.halfSide)
            planes = np.concatenate([np.column_stack([sign * np.eye(3), -half]) for sign in (1.0, -1.0)])
            return Region(middle, float(np.linalg.norm(half)), planes)
        case coal.Sphere():
            return Region(middle, float(geometry.radius), np.empty((0, 4)))
        case coal.Capsule():
            radius, half_length = float(geometry.radius), float(geometry.halfLength)
            return Region(middle, radius + half_length, _round_planes(radius, half_length + radius, 0.0))
        case coal.Cylinder():
            radius, half_length = float(geometry.radius), float(geometry.halfLength)
            return Region(middle, float(np.hypot(radius, half_length)), _round_planes(radius, half_length, 0.0))
        case coal.Cone():
            radius, half_length = float(geometry.radius), float(geometry.halfLength)
            slope = radius / (2.0 * half_length)
            return Region(middle, float(np.hypot(radius, half_length)), _round_planes(radius / 2.0, half_length, slope))
        case _:
            return _hull_region(
                np.array(geometry.vertices()) if hasattr(geometry, "vertices") else np.array(geometry.points())
            )


def _round_planes(radius: float, half_length: float, slope: float) -> Array:
    """Planes that touch a cylinder (slope 0) or a cone; `radius` is that at half height, the slope that towards z."""
    angles = 2.0 * np.pi * np.arange(ROUND_SIDES) / ROUND_SIDES
    sides = np.column_stack(
        [np.cos(angles), np.sin(angles), np.full(ROUND_SIDES, slope), np.full(ROUND_SIDES, -radius)]
    ) / np.hypot(1.0, slope)
    return np.vstack([sides, [0.0, 0.0, 1.0, -half_length], [0.0, 0.0, -1.0, -half_length]])


def _hull_region(vertices: Array) -> Region:
    from scipy.spatial import ConvexHull, QhullError  # 0.3 s of import, for octomaps only

    low, high = vertices.min(axis=0), vertices.max(axis=0)
    center = (low + high) / 2.0
    radius = float(np.linalg.norm(vertices - center, axis=1).max())
    try:
        planes = np.unique(np.round(ConvexHull(vertices).equations, 9), axis=0)
    except QhullError:  # a flat mesh
        planes = np.empty((0, 4))
    if not 4 <= len(planes) <= MAX_PLANES:
        planes = np.column_stack([DIRECTIONS, -(vertices @ DIRECTIONS.T).max(axis=0)])
    return Region(center, radius, planes)


def bodies_in_scene(scene: PlanningScene, positions: Array) -> list[tuple[Any, Transform]]:
    """Returns the Coal geometry and the pose in the planning frame of every body of the scene that a sensor can see.

    These are links at the given joint positions [rad or m], held objects and world objects; planes, which have no
    inside, and the octomap itself are left out.
    """
    links = scene.model.link_transforms(positions)
    frames = scene.model.pin_model.frames
    bodies = [
        (item.geometry, links[item.link] * frames[item.frame_id].placement.inverse() * item.placement)
        for item in scene.model.link_geometries
    ]
    things = [(links[held.link] * held.body.pose, held.body.shapes) for held in scene.attached.values()]
    things += [(body.pose, body.shapes) for body in scene.objects.values()]
    return bodies + [
        (shape.geometry, pose * shape_pose)
        for pose, shapes in things
        for shape, shape_pose in shapes
        if not isinstance(shape, Plane | Octree)
    ]


def self_filter_of(
    cache: RegionCache, bodies: Sequence[tuple[Any, Transform]], scale: float, padding: float
) -> SelfFilter:
    """Returns the filter of bodies whose shapes are scaled about their centre and padded [m]."""
    return _assembled([(cache.region(geometry), pose, scale, padding) for geometry, pose in bodies])


def depth_self_filter(
    cache: RegionCache, bodies: Sequence[tuple[Any, Transform]], origin: Array, scale: float, padding: float
) -> SelfFilter:
    """Returns the filter for a depth camera at `origin`: padding plus `scale` times the camera's noise at the body."""
    items = []
    for geometry, pose in bodies:
        region = cache.region(geometry)
        furthest = float(np.linalg.norm(pose.act(region.center) - origin)) + region.radius
        items.append((region, pose, 1.0, padding + scale * DEPTH_NOISE * furthest**2))
    return _assembled(items)


def _assembled(items: Sequence[tuple[Region, Transform, float, float]]) -> SelfFilter:
    balls, planes, counts = [], [], [0]
    for region, pose, scale, padding in items:
        normals = region.planes[:, :3] @ pose.rotation.T
        heights = scale * (region.planes[:, 3] + region.planes[:, :3] @ region.center) - padding
        center = pose.act(region.center)
        balls.append([*center, scale * region.radius + padding])
        planes.append(np.column_stack([normals, heights - normals @ center]))
        counts.append(len(normals))
    return SelfFilter(np.array(balls).reshape(-1, 4), np.vstack([np.empty((0, 4)), *planes]), np.cumsum(counts))
