# SPDX-License-Identifier: BSD-3-Clause
"""Bounding geometries for the compiled collision checks.

Every Coal geometry is enclosed by a triangle surface, a closed-form solid, or both. A hit on an enclosure larger than
the body is inconclusive; the exact check decides.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import coal
import numpy as np
import pinocchio as pin

from modular_framework_planning.collision_detection.collision_bodies import PlacedGeometry
from modular_framework_planning.collision_detection.kernels.compiled_distance import (
    BOX,
    CAPSULE,
    CONE,
    CYLINDER,
    HALF_SPACE,
    PLANE,
    SPHERE,
    SURFACE,
)
from modular_framework_planning.collision_detection.kernels.compiled_triangles import (
    Surfaces,
    build_sphere_tree,
    cut_long_edges,
)
from modular_framework_planning.geometry.shapes import Box, Capsule, Cone, Cylinder, Mesh, Shape, Sphere
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.octomap.octree import Octree

MAX_EDGE_M, MAX_EDGE_FRACTION = 0.02, 0.05  # longer triangle edges are split; fraction of the surface's extent
PRISM_SIDES = 64  # the prism exceeds a cylinder of 1 m radius by at most 1.2 mm
_lock = threading.Lock()


@dataclass(frozen=True, eq=False)
class BoundingGeometry:
    """The bounding geometry of one body, in the frame of the body's geometry.

    Attributes:
        triangles: Function that returns the vertices of the surface triangles, shape (m, 9) [m]; None for no surface.
        inflation_radius: Radius by which the surface is inflated [m].
        surface_excess: Maximum distance of the inflated surface outside the geometry [m]; infinite if unknown.
        kind: Type of the closed form; SURFACE for none.
        size: Three parameters of the closed form, see solid_distance.
        solid_excess: Maximum distance of the closed form outside the geometry [m].
        offset: Pose of surface and closed form in the geometry's frame.
        is_closed: Whether the surface has an inside.
    """

    triangles: Callable[[], Array] | None
    inflation_radius: float = 0.0
    surface_excess: float = 0.0
    kind: int = SURFACE
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    solid_excess: float = 0.0
    offset: Transform = field(default_factory=pin.SE3.Identity)
    is_closed: bool = False

    @cached_property
    def surface(self) -> Surfaces | None:
        """Sphere tree over the triangles; built on first use, because most solids are checked in closed form."""
        return None if self.triangles is None else _surface(self.triangles())

    @cached_property
    def array_row(self) -> tuple[float, ...]:
        """Kind, three size parameters, inflation radius, surface excess, solid excess, is_closed, bounding radius."""
        excess = self.surface_excess, self.solid_excess
        return (self.kind, *self.size, self.inflation_radius, *excess, self.is_closed, self.radius)

    @property
    def radius(self) -> float:
        """Radius of the bounding sphere around the closed form's origin [m]; infinite without a closed form."""
        x, y, z = self.size
        match self.kind:
            case _ if self.kind == BOX:
                return math.sqrt(x * x + y * y + z * z)
            case _ if self.kind in (CYLINDER, CONE):
                return math.hypot(x, y)
            case _ if self.kind in (SPHERE, CAPSULE):
                return x + y
        return np.inf


_cache: WeakKeyDictionary[Shape, BoundingGeometry] = WeakKeyDictionary()


def bounding_geometry_of(part: PlacedGeometry) -> BoundingGeometry:
    """Returns the bounding geometry of a body's geometry, cached per shape."""
    with _lock:
        cached = _cache.get(part.source)
        if cached is None:
            cached = _cache[part.source] = _build(part.source)
        return cached


def _build(source: Shape) -> BoundingGeometry:
    match source:
        case Octree():
            points = np.tile(source.centers, 3)
            voxel_radius = source.resolution * np.sqrt(0.75)
            return BoundingGeometry(lambda: points, voxel_radius, voxel_radius - 0.5 * source.resolution)
        case Mesh():
            vertices = np.asarray(source.vertices, dtype=float)
            faces = np.asarray(source.triangles, dtype=np.int64)
            return BoundingGeometry(lambda: vertices[faces].reshape(-1, 9), is_closed=_is_closed(vertices, faces))
        case Box():
            x, y, z = 0.5 * source.x, 0.5 * source.y, 0.5 * source.z
            return BoundingGeometry(lambda: _box_triangles(x, y, z), kind=BOX, size=(x, y, z))
        case Sphere(radius):
            return BoundingGeometry(lambda: np.zeros((1, 9)), radius, kind=SPHERE, size=(radius, 0.0, 0.0))
        case Capsule(height, radius):
            half = 0.5 * height
            return BoundingGeometry(
                lambda: np.array([[0, 0, -half, 0, 0, half, 0, 0, half]], dtype=float),
                radius,
                kind=CAPSULE,
                size=(radius, half, 0.0),
            )
        case Cylinder(height, radius):
            half = 0.5 * height
            return BoundingGeometry(
                lambda: _prism_triangles(radius, radius, half),
                surface_excess=_prism_excess(radius),
                kind=CYLINDER,
                size=(radius, half, 0.0),
            )
        case Cone(height, radius):
            half = 0.5 * height
            return BoundingGeometry(
                lambda: _prism_triangles(radius, 0.0, half),
                surface_excess=_prism_excess(radius),
                kind=CONE,
                size=(radius, half, 0.0),
            )
    geometry = source.geometry
    if not isinstance(geometry, coal.Plane | coal.Halfspace):
        return _bounding_box(geometry)
    normal = np.array(geometry.n, dtype=float)
    return BoundingGeometry(
        None,
        kind=PLANE if isinstance(geometry, coal.Plane) else HALF_SPACE,
        size=(float(normal[0]), float(normal[1]), float(normal[2])),
        offset=pin.SE3(np.eye(3), normal * float(geometry.d)),
    )


def _bounding_box(geometry: Any) -> BoundingGeometry:
    geometry.computeLocalAABB()
    low, high = np.array(geometry.aabb_local.min_), np.array(geometry.aabb_local.max_)
    x, y, z = (float(value) for value in 0.5 * (high - low))
    middle = 0.5 * (low + high)
    return BoundingGeometry(
        lambda: _box_triangles(x, y, z),
        surface_excess=np.inf,
        kind=BOX,
        size=(x, y, z),
        solid_excess=np.inf,
        offset=pin.SE3(np.eye(3), middle),
    )


def _surface(triangles: Array) -> Surfaces:
    triangles = np.ascontiguousarray(triangles, dtype=float)
    vertices = triangles.reshape(-1, 3)
    extent = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    triangles = cut_long_edges(triangles, max(MAX_EDGE_M, MAX_EDGE_FRACTION * extent))
    spheres, boxes, children = build_sphere_tree(triangles)
    return Surfaces(spheres, boxes, children, triangles)


def _is_closed(vertices: Array, faces: Any) -> bool:
    """Whether the surface is closed: every edge must occur equally often in both directions."""
    order = np.lexsort(np.round(vertices, 7).T)
    ranked = np.round(vertices[order], 7)
    ranks = np.concatenate([[0], np.cumsum((np.diff(ranked, axis=0) != 0.0).any(axis=1))])
    vertex_ids = np.empty(len(vertices), dtype=np.int64)
    vertex_ids[order] = ranks
    faces = vertex_ids[faces]
    starts, ends = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    size = int(faces.max()) + 1
    return bool(np.array_equal(np.sort(starts * size + ends), np.sort(ends * size + starts)))


def _box_triangles(x: float, y: float, z: float) -> Array:
    result = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
            face = np.insert(square, axis, sign, axis=1) * (x, y, z)
            result += [face[[0, 1, 2]], face[[0, 2, 3]]]
    return np.array(result).reshape(-1, 9)


def _prism_triangles(bottom_radius: float, top_radius: float, half: float) -> Array:
    """Returns a prism (or pyramid) around a cylinder (or cone) along z, `half` [m] to either side of the origin."""
    angles = np.arange(PRISM_SIDES + 1) * 2.0 * np.pi / PRISM_SIDES
    rim = np.column_stack([np.cos(angles), np.sin(angles)]) / np.cos(np.pi / PRISM_SIDES)
    result = []
    for start, end in zip(rim[:-1], rim[1:], strict=True):
        a, b, c, d = (
            [*(point * radius), z]
            for z, radius in ((-half, bottom_radius), (half, top_radius))
            for point in (start, end)
        )
        result += [[a, b, [0, 0, -half]], [a, b, d], [a, d, c]]
        if top_radius > 0.0:
            result.append([c, d, [0, 0, half]])
    return np.array(result, dtype=float).reshape(-1, 9)


def _prism_excess(radius: float) -> float:
    """Returns the maximum distance of the prism outside its cylinder (or cone) [m]."""
    return radius * (1.0 / float(np.cos(np.pi / PRISM_SIDES)) - 1.0)


def transform_triangles(triangles: Array, pose: Transform) -> Array:
    """Returns triangles, shape (m, 9), moved by a pose."""
    vertices = triangles.reshape(-1, 3) @ pose.rotation.T + pose.translation
    return np.ascontiguousarray(vertices.reshape(-1, 9))


def stack_surfaces(surfaces: Sequence[Surfaces]) -> tuple[Surfaces, list[int]]:
    """Returns the surfaces in one set of arrays, and the root node of each."""
    nodes = np.cumsum([0, *(len(item.spheres) for item in surfaces)])
    faces = np.cumsum([0, *(len(item.triangles) for item in surfaces)])
    children = [
        np.where(item.children[:, :1] < 0, [[-1, 0]] + item.children * [[0, 1]] + [[0, face]], item.children + node)
        for item, node, face in zip(surfaces, nodes, faces, strict=False)
    ]
    if not surfaces:
        return Surfaces(np.zeros((0, 4)), np.zeros((0, 15)), np.zeros((0, 2), np.int32), np.zeros((0, 9))), []
    return Surfaces(
        np.concatenate([item.spheres for item in surfaces]),
        np.concatenate([item.boxes for item in surfaces]),
        np.ascontiguousarray(np.concatenate(children), dtype=np.int32),
        np.concatenate([item.triangles for item in surfaces]),
    ), nodes[:-1].tolist()
