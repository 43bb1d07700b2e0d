# SPDX-License-Identifier: BSD-3-Clause
"""Collision shapes and their exact Coal geometry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import coal
import numpy as np

from modular_framework_planning.errors import GeometryError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_urdf.lengths import MAX_LENGTH_M

MAX_TRIANGLES = 2_000_000


def _require_positive(kind: str, **dimensions: float) -> None:
    for name, value in dimensions.items():
        if not 0.0 < value <= MAX_LENGTH_M:
            raise GeometryError(
                f"{kind}: {name} is {value} m; it must be above 0 m and at most "
                f"{MAX_LENGTH_M:g} m; use a plane for an infinite surface"
            )


class Shape:
    """A collision shape in its own frame; instances are immutable and compared by identity."""

    @cached_property
    def geometry(self) -> Any:
        """Coal geometry of the shape, built once."""
        return self._build()

    def _build(self) -> Any:
        raise TypeError(f"{type(self).__name__} is not a shape that can be built")

    @cached_property
    def bounding_sphere(self) -> tuple[Array, float]:
        """Centre and radius of a bounding sphere in the frame of the shape [m]."""
        self.geometry.computeLocalAABB()
        return np.array(self.geometry.aabb_center), float(self.geometry.aabb_radius)


@dataclass(frozen=True, eq=False)
class Box(Shape):
    """A box centred at the origin with edge lengths x, y, z [m]."""

    x: float
    y: float
    z: float

    def __post_init__(self) -> None:
        _require_positive("box", x=self.x, y=self.y, z=self.z)

    def _build(self) -> Any:
        return coal.Box(self.x, self.y, self.z)


@dataclass(frozen=True, eq=False)
class Sphere(Shape):
    """A sphere centred at the origin; radius [m]."""

    radius: float

    def __post_init__(self) -> None:
        _require_positive("sphere", radius=self.radius)

    def _build(self) -> Any:
        return coal.Sphere(self.radius)


@dataclass(frozen=True, eq=False)
class RoundShape(Shape):
    """A shape of revolution about the z axis, centred at half its height; height and radius [m]."""

    height: float
    radius: float

    def __post_init__(self) -> None:
        _require_positive(type(self).__name__.lower(), height=self.height, radius=self.radius)


class Cylinder(RoundShape):
    """A cylinder."""

    def _build(self) -> Any:
        return coal.Cylinder(self.radius, self.height)


class Capsule(RoundShape):
    """A cylinder with half spheres at both ends, which the height does not include."""

    def _build(self) -> Any:
        return coal.Capsule(self.radius, self.height)


class Cone(RoundShape):
    """A cone with the tip up."""

    def _build(self) -> Any:
        return coal.Cone(self.radius, self.height)


@dataclass(frozen=True, eq=False)
class Plane(Shape):
    """The infinite plane a*x + b*y + c*z + d = 0 [m]."""

    a: float
    b: float
    c: float
    d: float

    def __post_init__(self) -> None:
        values = np.array([self.a, self.b, self.c, self.d])
        if not np.isfinite(values).all() or np.linalg.norm(values[:3]) < 1e-9:
            raise GeometryError(
                f"plane: coefficients {values.tolist()} give no normal; a, b, c, d must be finite and a, b, c not all 0"
            )

    def _build(self) -> Any:
        normal = np.array([self.a, self.b, self.c])
        length = float(np.linalg.norm(normal))
        return coal.Plane(normal / length, -self.d / length)

    @cached_property
    def bounding_sphere(self) -> tuple[Array, float]:
        """Centre and infinite radius, because no sphere contains a plane."""
        return np.zeros(3), np.inf


@dataclass(frozen=True, eq=False)
class Mesh(Shape):
    """A triangle mesh: vertices of shape (n, 3) [m] and vertex indices of shape (m, 3)."""

    vertices: Array
    triangles: Any

    def __post_init__(self) -> None:
        count = len(self.triangles)
        if count == 0 or len(self.vertices) < 3:
            raise GeometryError(
                f"mesh: {len(self.vertices)} vertices and {count} triangles; "
                "at least 3 vertices and 1 triangle are needed"
            )
        if count > MAX_TRIANGLES:
            raise GeometryError(f"mesh: {count} triangles; at most {MAX_TRIANGLES} are allowed; simplify the mesh")
        if not (np.abs(self.vertices) <= MAX_LENGTH_M).all():
            raise GeometryError(
                f"mesh: a vertex is not finite or too far away; coordinates must be at most {MAX_LENGTH_M:g} m"
            )
        if int(np.min(self.triangles)) < 0 or int(np.max(self.triangles)) >= len(self.vertices):
            raise GeometryError(
                f"mesh: a triangle refers to vertex {int(np.max(self.triangles))}; allowed: 0..{len(self.vertices) - 1}"
            )

    def _build(self) -> Any:
        model = coal.BVHModelOBBRSS()
        model.beginModel(len(self.triangles), len(self.vertices))
        model.addVertices(np.asarray(self.vertices, dtype=float))
        model.addTriangles(np.asarray(self.triangles, dtype=np.int64))
        model.endModel()
        model.computeLocalAABB()
        return model

    @cached_property
    def bounding_sphere(self) -> tuple[Array, float]:
        """Bounding sphere without building Coal's BVH, which takes a second for 100,000 triangles."""
        points = np.asarray(self.vertices, dtype=float)
        centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        return centre, float(np.linalg.norm(points - centre, axis=1).max())
