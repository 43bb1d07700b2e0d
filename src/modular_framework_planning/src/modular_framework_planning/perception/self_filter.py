# SPDX-License-Identifier: BSD-3-Clause
"""Self filter: finds the points of a depth sensor that lie on the robot or on known objects.

Every shape is enclosed by a convex region, the intersection of a sphere and half-spaces; a mesh by its convex hull.
Moving the planes outwards pads a region, which then contains at least the padded shape.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np

from modular_framework_planning.geometry.shapes import Plane
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.octomap.compiled_voxels import points_in_regions
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

ROUND_SIDES = 24
DEPTH_NOISE = 0.125 / (525.0 * 0.075)  # [1/m]; disparity step of 1/8 pixel over focal length [pixel] and baseline [m]

MAX_PLANES = 64  # larger hulls are replaced by tangent planes in fixed directions (at most 3 % larger for a sphere)


def _even_directions(count: int) -> Array:
    """Returns unit vectors in both directions of each axis, and `count` unit vectors on a spiral over the sphere."""
    heights = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    angles = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    widths = np.sqrt(1.0 - heights**2)
    spiral = np.column_stack([widths * np.cos(angles), widths * np.sin(angles), heights])
    return np.vstack([np.eye(3), -np.eye(3), spiral])


DIRECTIONS = _even_directions(MAX_PLANES - 6)


@dataclass(frozen=True, slots=True)
class Region:
    """A convex region in the frame of a body: a sphere intersected with half-spaces n.x + d <= 0.

    Attributes:
        center: Centre of the sphere, shape (3,) [m].
        radius: Radius of the sphere [m].
        planes: Unit normal n and offset d [m] of each half-space, shape (m, 4).
    """

    center: Array
    radius: float
    planes: Array


@dataclass(frozen=True, slots=True)
class SelfFilter:
    """Padded and scaled regions of all bodies in one frame.

    Attributes:
        spheres: Centre and radius of each region's sphere, shape (k, 4) [m].
        planes: Half-spaces of all regions, shape (m, 4).
        starts: Index of each region's first plane, and the total; shape (k + 1,).
    """

    spheres: Array
    planes: Array
    starts: Any

    def hides(self, points: Array, origin: Array, shadow: float = 0.0) -> Any:
        """Returns whether each point lies in a region or in a region's shadow, shape (n,).

        Args:
            points: Points, shape (n, 3) [m].
            origin: Position of the sensor, shape (3,) [m].
            shadow: Length of the shadow behind a region, as seen from the sensor [m].
        """
        return points_in_regions(
            np.ascontiguousarray(points, dtype=float),
            np.asarray(origin, dtype=float),
            shadow,
            self.spheres,
            self.planes,
            self.starts,
        )


class RegionCache:
    """Cache of regions by Coal geometry."""

    def __init__(self) -> None:
        self._regions: dict[int, tuple[Any, Region]] = {}

    def __len__(self) -> int:
        """Returns the number of cached regions."""
        return len(self._regions)

    def region(self, geometry: Any) -> Region:
        """Returns the region that encloses a geometry."""
        cached = self._regions.get(id(geometry))
        if cached is None:
            cached = self._regions[id(geometry)] = (geometry, _region_of(geometry))
        return cached[1]

    def keep_only(self, geometries: Iterable[Any]) -> None:
        """Drops the regions of all other geometries."""
        kept_ids = {id(item) for item in geometries}
        self._regions = {key: value for key, value in list(self._regions.items()) if key in kept_ids}


FilterMaker = Callable[[RegionCache, Sequence[tuple[Any, Transform]], Array], SelfFilter]


def _region_of(geometry: Any) -> Region:
    origin = np.zeros(3)
    match geometry:
        case coal.Box():
            half = np.array(geometry.halfSide)
            planes = np.concatenate([np.column_stack([sign * np.eye(3), -half]) for sign in (1.0, -1.0)])
            return Region(origin, float(np.linalg.norm(half)), planes)
        case coal.Sphere():
            return Region(origin, float(geometry.radius), np.empty((0, 4)))
        case coal.Capsule():
            radius, half_length = float(geometry.radius), float(geometry.halfLength)
            return Region(origin, radius + half_length, _round_planes(radius, half_length + radius, 0.0))
        case coal.Cylinder():
            radius, half_length = float(geometry.radius), float(geometry.halfLength)
            return Region(origin, float(np.hypot(radius, half_length)), _round_planes(radius, half_length, 0.0))
        case coal.Cone():
            radius, half_length = float(geometry.radius), float(geometry.halfLength)
            slope = radius / (2.0 * half_length)
            return Region(origin, float(np.hypot(radius, half_length)), _round_planes(radius / 2.0, half_length, slope))
        case _:
            return _hull_region(
                np.array(geometry.vertices()) if hasattr(geometry, "vertices") else np.array(geometry.points())
            )


def _round_planes(radius: float, half_length: float, slope: float) -> Array:
    """Returns tangent planes of a cylinder (slope 0) or cone, with `radius` at half height [m]."""
    angles = 2.0 * np.pi * np.arange(ROUND_SIDES) / ROUND_SIDES
    sides = np.column_stack(
        [np.cos(angles), np.sin(angles), np.full(ROUND_SIDES, slope), np.full(ROUND_SIDES, -radius)]
    ) / np.hypot(1.0, slope)
    return np.vstack([sides, [0.0, 0.0, 1.0, -half_length], [0.0, 0.0, -1.0, -half_length]])


def _hull_region(vertices: Array) -> Region:
    from scipy.spatial import ConvexHull, QhullError  # takes 0.3 s to import and is needed for octomaps only

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
    """Returns Coal geometries and their poses in the planning frame for the self filter.

    The bodies are links at the given joint positions [rad or m], held objects and world objects. Planes and the octomap
    are left out.
    """
    links = scene.model.link_transforms(positions)
    frames = scene.model.pin_model.frames
    bodies = [
        (item.geometry, links[item.link] * frames[item.frame_id].placement.inverse() * item.placement)
        for item in scene.model.link_geometries
    ]
    objects = [(links[held.link] * held.body.pose, held.body.shapes) for held in scene.attached.values()]
    objects += [(body.pose, body.shapes) for body in scene.objects.values()]
    return bodies + [
        (shape.geometry, pose * shape_pose)
        for pose, shapes in objects
        for shape, shape_pose in shapes
        if not isinstance(shape, Plane | Octree)
    ]


def self_filter_of(
    cache: RegionCache, bodies: Sequence[tuple[Any, Transform]], scale: float, padding: float
) -> SelfFilter:
    """Returns the filter for a point cloud.

    Args:
        cache: Cache of regions.
        bodies: Coal geometries and their poses.
        scale: Scale of each shape about its centre.
        padding: Padding of each shape [m].
    """
    return _assemble([(cache.region(geometry), pose, scale, padding) for geometry, pose in bodies])


def depth_self_filter(
    cache: RegionCache, bodies: Sequence[tuple[Any, Transform]], origin: Array, scale: float, padding: float
) -> SelfFilter:
    """Returns the filter for a depth image, padded by the camera's depth noise at each body.

    Args:
        cache: Cache of regions.
        bodies: Coal geometries and their poses.
        origin: Position of the camera, shape (3,) [m].
        scale: Factor on the depth noise.
        padding: Additional padding of each shape [m].
    """
    items = []
    for geometry, pose in bodies:
        region = cache.region(geometry)
        max_distance = float(np.linalg.norm(pose.act(region.center) - origin)) + region.radius
        items.append((region, pose, 1.0, padding + scale * DEPTH_NOISE * max_distance**2))
    return _assemble(items)


def _assemble(items: Sequence[tuple[Region, Transform, float, float]]) -> SelfFilter:
    spheres, planes, counts = [], [], [0]
    for region, pose, scale, padding in items:
        normals = region.planes[:, :3] @ pose.rotation.T
        heights = scale * (region.planes[:, 3] + region.planes[:, :3] @ region.center) - padding
        center = pose.act(region.center)
        spheres.append([*center, scale * region.radius + padding])
        planes.append(np.column_stack([normals, heights - normals @ center]))
        counts.append(len(normals))
    return SelfFilter(np.array(spheres).reshape(-1, 4), np.vstack([np.empty((0, 4)), *planes]), np.cumsum(counts))
