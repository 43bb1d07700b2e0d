# SPDX-License-Identifier: BSD-3-Clause
"""Convex solids of position constraint regions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from modular_framework_planning.errors import GeometryError
from modular_framework_planning.geometry.spatial import Array


class Solid(Protocol):
    """A convex solid around its origin; points are in the frame of the solid [m]."""

    @property
    def extent(self) -> float:
        """Maximum distance of a point of the solid from its origin [m]."""

    def sample(self, rng: np.random.Generator) -> Array:
        """Returns a point uniformly distributed in the solid."""


def _require_lengths(kind: str, **lengths: float) -> None:
    for name, value in lengths.items():
        if not np.isfinite(value) or value < 0.0:
            raise GeometryError(f"{kind}: {name} is {value}; it must be a finite length of at least 0 m")


@dataclass(frozen=True, slots=True)
class BoxSolid:
    """A box with edge lengths x, y, z, which may be 0 [m]."""

    x: float
    y: float
    z: float

    def __post_init__(self) -> None:
        _require_lengths("box", x=self.x, y=self.y, z=self.z)

    @property
    def extent(self) -> float:
        """Greatest distance of a point from the origin [m]."""
        return 0.5 * float(np.linalg.norm((self.x, self.y, self.z)))

    def sample(self, rng: np.random.Generator) -> Array:
        """Returns a random point of the box."""
        return rng.uniform(-0.5, 0.5, 3) * (self.x, self.y, self.z)


@dataclass(frozen=True, slots=True)
class SphereSolid:
    """A solid sphere; radius [m]."""

    radius: float

    def __post_init__(self) -> None:
        _require_lengths("sphere", radius=self.radius)

    @property
    def extent(self) -> float:
        """Greatest distance of a point from the origin [m]."""
        return self.radius

    def sample(self, rng: np.random.Generator) -> Array:
        """Returns a random point of the sphere."""
        direction = rng.normal(size=3)
        return direction * (self.radius * rng.uniform() ** (1.0 / 3.0) / float(np.linalg.norm(direction)))


@dataclass(frozen=True, slots=True)
class _RoundSolid:
    """A solid of revolution about the z axis, centred at half its height; height and radius [m]."""

    kind: ClassVar[str]
    height: float
    radius: float

    def __post_init__(self) -> None:
        _require_lengths(self.kind, height=self.height, radius=self.radius)

    @property
    def extent(self) -> float:
        """Greatest distance of a point from the origin [m]."""
        return float(np.hypot(0.5 * self.height, self.radius))


class CylinderSolid(_RoundSolid):
    """A cylinder."""

    kind = "cylinder"

    def sample(self, rng: np.random.Generator) -> Array:
        """Returns a random point of the cylinder."""
        angle, radius = rng.uniform(-np.pi, np.pi), self.radius * np.sqrt(rng.uniform())
        return np.array([radius * np.cos(angle), radius * np.sin(angle), self.height * rng.uniform(-0.5, 0.5)])


class ConeSolid(_RoundSolid):
    """A cone with the tip up and the base radius."""

    kind = "cone"

    def sample(self, rng: np.random.Generator) -> Array:
        """Returns a random point of the cone."""
        from_tip = rng.uniform() ** (1.0 / 3.0)
        angle, radius = rng.uniform(-np.pi, np.pi), self.radius * from_tip * np.sqrt(rng.uniform())
        return np.array([radius * np.cos(angle), radius * np.sin(angle), self.height * (0.5 - from_tip)])


class HullSolid:
    """The convex hull of a mesh (as in MoveIt, whose mesh regions are hulls).

    Attributes:
        faces: Outward unit normals and offsets [m], shape (n, 4); normal . point + offset < 0 for a point inside.
    """

    def __init__(self, vertices: Array) -> None:
        """Computes the hull.

        Args:
            vertices: Vertices of the mesh, shape (n, 3) [m].

        Raises:
            GeometryError: The vertices are fewer than four, not finite or coplanar.
        """
        from scipy.spatial import ConvexHull, QhullError  # imported here, because the import takes 0.3 s

        points = np.asarray(vertices, dtype=float).reshape(-1, 3)
        if not np.isfinite(points).all():
            raise GeometryError("mesh: a vertex is not finite; every coordinate must be finite")
        try:
            hull = ConvexHull(points)
        except (QhullError, ValueError) as error:
            raise GeometryError(f"mesh: its {len(points)} vertices enclose no volume; use a closed mesh") from error
        self._vertices = points[hull.vertices]
        self.faces = np.asarray(hull.equations)
        self._centroid = self._vertices.mean(axis=0)
        self._face_vertices = points[hull.simplices]
        volumes = np.abs(np.linalg.det(self._face_vertices - self._centroid))
        self._volume_fractions = volumes / volumes.sum()

    @property
    def extent(self) -> float:
        """Greatest distance of a point from the origin [m]."""
        return float(np.linalg.norm(self._vertices, axis=1).max())

    def sample(self, rng: np.random.Generator) -> Array:
        """Returns a random point of the hull, from a random tetrahedron between its centroid and a face."""
        face_vertices = self._face_vertices[rng.choice(len(self._volume_fractions), p=self._volume_fractions)]
        return rng.dirichlet(np.ones(4)) @ np.vstack([face_vertices, self._centroid])
