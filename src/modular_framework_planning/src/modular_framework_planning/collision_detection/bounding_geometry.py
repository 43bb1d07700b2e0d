# SPDX-License-Identifier: BSD-3-Clause
"""Makes the bounding geometries that compiled checks work on.

Whatever Coal geometry a body has, it gets a surface of triangles, a solid in closed form, or both. Either
encloses the body; where it is larger than the body, a hit is not final and the exact check decides.
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

LONGEST_EDGE, LONGEST_SHARE = 0.02, 0.05  # [m], and as a share of a surface's extent; longer triangles are cut
SIDES = 64  # of the prism around a cylinder or cone: 1.2 mm too wide at 1 m radius
_lock = threading.Lock()


@dataclass(frozen=True, eq=False)
class BoundingGeometry:
    """The bounding geometry of one body, in the frame of the body's geometry.

    Attributes:
        corners: gives the corners of the surface's triangles, shape (m, 9) [m]; None for no surface.
        inflation_radius: radius of a ball around every point of the surface that belongs to it [m].
        surface_excess: how far the inflated surface lies outside of the geometry at most [m]; infinite if not known.
        kind, size: closed form, SURFACE for none.
        solid_excess: how far the closed form lies outside of the geometry at most [m].
        offset: pose of both in the geometry's frame.
        is_closed: whether the surface has an inside.
    """

    corners: Callable[[], Array] | None
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
        return None if self.corners is None else _surface(self.corners())

    @cached_property
    def numbers(self) -> tuple[float, ...]:
        """Kind, three sizes, inflation, excess of surface and closed form, is closed, radius."""
        excess = self.surface_excess, self.solid_excess
        return (self.kind, *self.size, self.inflation_radius, *excess, self.is_closed, self.radius)

    @property
    def radius(self) -> float:
        """Radius of a ball around the closed form's origin that holds it [m]; infinite without a closed form."""
        x, y, z = self.size
        match self.kind:
            case _ if self.kind == BOX:
                return math.sqrt(x * x + y * y + z * z)
            case _ if self.kind in (CYLINDER, CONE):
                return math.hypot(x, y)
            case _ if self.kind in (SPHERE, CAPSULE):
                return x + y
        return np.inf


_of_shapes: WeakKeyDictionary[Shape, BoundingGeometry] = WeakKeyDictionary()


def bounding_geometry_of(part: PlacedGeometry) -> BoundingGeometry:
    """Returns the bounding geometry of a body's geometry; that of a shape is made once."""
    with _lock:
        found = _of_shapes.get(part.source)
        if found is None:
            found = _of_shapes[part.source] = _make(part.source)
        return found


def _make(source: Shape) -> BoundingGeometry:
    match source:
        case Octree():
            points = np.tile(source.centers, 3)
            around = source.resolution * np.sqrt(0.75)  # radius of the ball around a voxel
            return BoundingGeometry(lambda: points, around, around - 0.5 * source.resolution)
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
    corners = triangles.reshape(-1, 3)
    extent = float(np.linalg.norm(np.ptp(corners, axis=0)))
    triangles = cut_long_edges(triangles, max(LONGEST_EDGE, LONGEST_SHARE * extent))
    spheres, boxes, links = build_sphere_tree(triangles)
    return Surfaces(spheres, boxes, links, triangles)


def _is_closed(vertices: Array, faces: Any) -> bool:
    """Whether every edge is passed as often in one direction as in the other: then the surface has an inside."""
    order = np.lexsort(np.round(vertices, 7).T)
    ranked = np.round(vertices[order], 7)
    ranks = np.concatenate([[0], np.cumsum((np.diff(ranked, axis=0) != 0.0).any(axis=1))])
    corners = np.empty(len(vertices), dtype=np.int64)
    corners[order] = ranks
    faces = corners[faces]
    starts, ends = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    size = int(faces.max()) + 1
    return bool(np.array_equal(np.sort(starts * size + ends), np.sort(ends * size + starts)))


def _box_triangles(x: float, y: float, z: float) -> Array:
    result = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
            face = np.insert(corners, axis, sign, axis=1) * (x, y, z)
            result += [face[[0, 1, 2]], face[[0, 2, 3]]]
    return np.array(result).reshape(-1, 9)


def _prism_triangles(below: float, above: float, half: float) -> Array:
    """A prism (or pyramid) around a cylinder (or cone) along z with the given radii at both ends."""
    angles = np.arange(SIDES + 1) * 2.0 * np.pi / SIDES
    rim = np.column_stack([np.cos(angles), np.sin(angles)]) / np.cos(np.pi / SIDES)
    result = []
    for here, there in zip(rim[:-1], rim[1:], strict=True):
        a, b, c, d = (
            [*(point * radius), z] for z, radius in ((-half, below), (half, above)) for point in (here, there)
        )
        result += [[a, b, [0, 0, -half]], [a, b, d], [a, d, c]]
        if above > 0.0:
            result.append([c, d, [0, 0, half]])
    return np.array(result, dtype=float).reshape(-1, 9)


def _prism_excess(radius: float) -> float:
    """Returns how far the prism around a cylinder (or cone) lies outside of it at most [m]."""
    return radius * (1.0 / float(np.cos(np.pi / SIDES)) - 1.0)


def moved(triangles: Array, pose: Transform) -> Array:
    """Returns triangles (m, 9) in the frame in which their own frame has the given pose."""
    corners = triangles.reshape(-1, 3) @ pose.rotation.T + pose.translation
    return np.ascontiguousarray(corners.reshape(-1, 9))


def stacked(surfaces: Sequence[Surfaces]) -> tuple[Surfaces, list[int]]:
    """Returns surfaces in one set of arrays and the root node of each."""
    nodes = np.cumsum([0, *(len(item.spheres) for item in surfaces)])
    faces = np.cumsum([0, *(len(item.triangles) for item in surfaces)])
    links = [
        np.where(item.links[:, :1] < 0, [[-1, 0]] + item.links * [[0, 1]] + [[0, face]], item.links + node)
        for item, node, face in zip(surfaces, nodes, faces, strict=False)
    ]
    if not surfaces:
        return Surfaces(np.zeros((0, 4)), np.zeros((0, 15)), np.zeros((0, 2), np.int32), np.zeros((0, 9))), []
    return Surfaces(
        np.concatenate([item.spheres for item in surfaces]),
        np.concatenate([item.boxes for item in surfaces]),
        np.ascontiguousarray(np.concatenate(links), dtype=np.int32),
        np.concatenate([item.triangles for item in surfaces]),
    ), nodes[:-1].tolist()
