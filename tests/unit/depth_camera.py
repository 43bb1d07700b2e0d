# SPDX-License-Identifier: BSD-3-Clause
"""What a depth camera above a table sees of boxes, cylinders and spheres: each ray is cut with their equations."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

EYE = np.array([-0.1645, 0.375, 2.72])
AXES = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Axes of the optical frame in the world as columns: roll pi, yaw -pi/2, as the shipped camera."""


def turned(yaw: float) -> Array:
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


LYING = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Turns a cylinder along z into one along x."""


@dataclass(frozen=True)
class Box:
    size: tuple[float, float, float]
    centre: tuple[float, float, float]
    axes: Array = field(default_factory=lambda: np.eye(3))

    def hits(self, origin: Array, rays: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([(sign * np.array(self.size) / 2 - origin) / rays for sign in (-1.0, 1.0)])
        enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
        return np.where((enter <= leave) & (enter > 0.0), enter, np.inf)


@dataclass(frozen=True)
class Sphere:
    radius: float
    centre: tuple[float, float, float]
    axes: Array = field(default_factory=lambda: np.eye(3))

    def hits(self, origin: Array, rays: Array) -> Array:
        a, b, c = (rays**2).sum(axis=1), rays @ origin, origin @ origin - self.radius**2
        root = b**2 - a * c
        return np.where(root >= 0.0, (-b - np.sqrt(np.maximum(root, 0.0))) / a, np.inf)


@dataclass(frozen=True)
class Cylinder:
    radius: float
    height: float
    centre: tuple[float, float, float]
    axes: Array = field(default_factory=lambda: np.eye(3))

    def hits(self, origin: Array, rays: Array) -> Array:
        a = np.maximum((rays[:, :2] ** 2).sum(axis=1), 1e-12)
        b, c = rays[:, :2] @ origin[:2], origin[:2] @ origin[:2] - self.radius**2
        root = b**2 - a * c
        side = np.where(root >= 0.0, (-b - np.sqrt(np.maximum(root, 0.0))) / a, np.inf)
        found = np.where(np.abs(origin[2] + np.where(np.isfinite(side), side, 0.0) * rays[:, 2]) <= self.height / 2,
                         side, np.inf)  # fmt: skip
        for end in (-0.5, 0.5):
            with np.errstate(divide="ignore", invalid="ignore"):
                cap = (end * self.height - origin[2]) / rays[:, 2]
                inside = ((origin[:2] + cap[:, None] * rays[:, :2]) ** 2).sum(axis=1) <= self.radius**2
            found = np.where(inside & (cap > 0.0), np.minimum(found, cap), found)
        return found


Shape = Box | Sphere | Cylinder


def image(shapes: list[Shape], columns: int = 640, rows: int = 480, horizontal_fov: float = math.pi / 3) -> Array:
    """Points in the optical frame (rows, columns, 3) [m]; not numbers where nothing is."""
    focal = columns / (2 * math.tan(horizontal_fov / 2))
    u, v = np.meshgrid((np.arange(columns) - (columns - 1) / 2) / focal, (np.arange(rows) - (rows - 1) / 2) / focal)
    rays = np.stack([u.ravel(), v.ravel(), np.ones(u.size)], axis=1)
    depth = np.full(len(rays), np.inf)
    for shape in shapes:
        into = shape.axes.T @ AXES
        depth = np.minimum(depth, shape.hits(shape.axes.T @ (EYE - np.array(shape.centre)), rays @ into.T))
    depth[~np.isfinite(depth)] = np.nan
    return (rays * depth[:, None]).reshape(rows, columns, 3)


def in_world(points: Array) -> Array:
    """Points (..., 3) of the optical frame in the world."""
    return points @ AXES.T + EYE


def seen(shapes: list[Shape], noise_m: float = 0.0, seed: int = 0) -> Array:
    """All points in the world (n, 3) [m], NaN where nothing is seen, with noise along the rays."""
    points = image(shapes).reshape(-1, 3)
    noise = np.random.default_rng(seed).normal(0.0, noise_m, len(points)) if noise_m else np.zeros(len(points))
    return in_world(points * (1.0 + noise / np.linalg.norm(points, axis=1))[:, None])
