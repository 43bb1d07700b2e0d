# SPDX-License-Identifier: BSD-3-Clause
"""Samples points on the surfaces of shapes, so that one grasp search handles all shapes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SPACING_M = 0.004
MAX_POINTS_PER_SIDE = 60


@dataclass(frozen=True, slots=True)
class Surface:
    """Points on a surface.

    Attributes:
        points: Positions, shape (n, 3) [m].
        normals: Outward unit normals, shape (n, 3).
        volume: Enclosed volume [m^3].
        centroid: Centre of the volume, shape (3,) [m].
        axes: Unit vectors along the symmetry or principal axes of the shape, shape (k, 3).
    """

    points: Array
    normals: Array
    volume: float
    centroid: Array
    axes: Array

    def transformed(self, rotation: Array, translation: Array) -> Surface:
        """Returns the surface after a rotation, shape (3, 3), and a translation, shape (3,) [m]."""
        return Surface(
            self.points @ rotation.T + translation,
            self.normals @ rotation.T,
            self.volume,
            rotation @ self.centroid + translation,
            self.axes @ rotation.T,
        )


def _edge_steps(length: float) -> Array:
    count = int(min(MAX_POINTS_PER_SIDE, max(2, math.ceil(length / SPACING_M) + 1)))
    return np.linspace(-length / 2, length / 2, count)


def box(size: Sequence[float]) -> Surface:
    """Samples a box.

    Args:
        size: Lengths along x, y, z [m], all positive.
    """
    lengths = [float(value) for value in size]
    points, normals = [], []
    for axis in range(3):
        other_axes = [other for other in range(3) if other != axis]
        u, v = np.meshgrid(_edge_steps(lengths[other_axes[0]]), _edge_steps(lengths[other_axes[1]]))
        for sign in (-1.0, 1.0):
            face = np.zeros((u.size, 3))
            face[:, other_axes[0]], face[:, other_axes[1]] = u.ravel(), v.ravel()
            face[:, axis] = sign * lengths[axis] / 2
            normal = np.zeros((u.size, 3))
            normal[:, axis] = sign
            points.append(face)
            normals.append(normal)
    return Surface(np.vstack(points), np.vstack(normals), math.prod(lengths), np.zeros(3), np.eye(3))


def cylinder(height: float, radius: float, top_radius: float | None = None) -> Surface:
    """Samples a cylinder along z around the origin, or a cone if the top radius differs.

    Args:
        height: Length along z [m].
        radius: Radius at the bottom [m].
        top_radius: Radius at the top [m]; None for a cylinder.
    """
    top = radius if top_radius is None else top_radius
    count = int(min(180, max(24, math.ceil(2 * math.pi * max(radius, top) / SPACING_M))))
    angles = np.linspace(0.0, 2 * math.pi, count, endpoint=False)
    levels = _edge_steps(height)
    a, z = (grid.ravel() for grid in np.meshgrid(angles, levels))
    r = radius + (top - radius) * (z / height + 0.5)
    slope = (radius - top) / height
    side = np.column_stack([r * np.cos(a), r * np.sin(a), z])
    side_normals = np.column_stack([np.cos(a), np.sin(a), np.full_like(a, slope)])
    side_normals /= np.linalg.norm(side_normals, axis=1, keepdims=True)
    points, normals = [side], [side_normals]
    for end, end_radius in ((-0.5, radius), (0.5, top)):
        rings = np.linspace(0.0, end_radius, max(2, math.ceil(end_radius / SPACING_M)), endpoint=False)
        ra, rr = (grid.ravel() for grid in np.meshgrid(angles[::2], rings))
        points.append(np.column_stack([rr * np.cos(ra), rr * np.sin(ra), np.full_like(ra, end * height)]))
        normals.append(np.tile([0.0, 0.0, math.copysign(1.0, end)], (ra.size, 1)))
    volume = math.pi * height * (radius**2 + radius * top + top**2) / 3
    centre_z = height * ((radius**2 + 2 * radius * top + 3 * top**2) / (4 * (radius**2 + radius * top + top**2)) - 0.5)
    return Surface(
        np.vstack(points), np.vstack(normals), volume, np.array([0.0, 0.0, centre_z]), np.array([[0.0, 0.0, 1.0]])
    )


def sphere(radius: float) -> Surface:
    """Samples a sphere around the origin on a Fibonacci lattice.

    Args:
        radius: Radius [m].
    """
    count = int(min(6000, max(500, 4 * math.pi * radius**2 / SPACING_M**2)))
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    angle = math.pi * (1.0 + math.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - z**2)
    normals = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])
    return Surface(radius * normals, normals, 4 / 3 * math.pi * radius**3, np.zeros(3), np.zeros((0, 3)))


def mesh(vertices: Array, triangles: npt.NDArray[np.int64]) -> Surface:
    """Samples a triangle mesh.

    Args:
        vertices: Vertices, shape (n, 3) [m].
        triangles: Vertex indices, counter-clockwise seen from outside, shape (m, 3).
    """
    corners = vertices[triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_areas = np.linalg.norm(cross, axis=1)
    keep = double_areas > 1e-12
    corners, cross, double_areas = corners[keep], cross[keep], double_areas[keep]
    unit = cross / double_areas[:, None]
    signed = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    volume = float(signed.sum())
    if volume < 0.0:
        unit, signed, volume = -unit, -signed, -volume
    extent = float(np.prod(np.ptp(vertices, axis=0)))
    closed = volume > 0.01 * extent
    centroid = (
        (signed[:, None] * corners.sum(axis=1) / 4.0).sum(axis=0) / volume
        if closed
        else ((vertices.min(axis=0) + vertices.max(axis=0)) / 2)
    )
    points, normals = [], []
    for triangle, normal, double_area in zip(corners, unit, double_areas, strict=True):
        count = int(min(40, max(1, math.ceil(math.sqrt(double_area) / SPACING_M))))
        steps = [(i + 1 / 3, j + 1 / 3) for i in range(count) for j in range(count - i)]
        uv = np.array(steps) / count
        points.append(triangle[0] + uv[:, :1] * (triangle[1] - triangle[0]) + uv[:, 1:] * (triangle[2] - triangle[0]))
        points.append(triangle)
        normals.append(np.tile(normal, (len(steps) + 3, 1)))
    stacked = np.vstack(points)
    _, _, axes = np.linalg.svd(stacked - stacked.mean(axis=0), full_matrices=False)
    return Surface(stacked, np.vstack(normals), volume if closed else extent, centroid, axes)


def join_surfaces(surfaces: Sequence[Surface]) -> Surface:
    """Joins the surfaces of the parts of one object."""
    volumes = np.array([surface.volume for surface in surfaces])
    centroid = (volumes[:, None] * np.array([surface.centroid for surface in surfaces])).sum(axis=0) / volumes.sum()
    return Surface(
        np.vstack([surface.points for surface in surfaces]),
        np.vstack([surface.normals for surface in surfaces]),
        float(volumes.sum()),
        centroid,
        np.vstack([surface.axes for surface in surfaces]),
    )
