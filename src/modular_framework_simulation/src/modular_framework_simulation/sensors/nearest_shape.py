# SPDX-License-Identifier: BSD-3-Clause
"""Finds the collision shape whose surface a point is nearest to: the engine names links, not shapes."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import load_mesh
from modular_framework_simulation.models.poses import Pose
from modular_framework_urdf.rotations import Vector3


def nearest_shape(placed: Sequence[tuple[Pose, specs.Geometry]], point: Vector3) -> int:
    """Returns the index of the shape whose surface is nearest; of a mesh that of its bounding box.

    Args:
        placed: Pose in the world and geometry of each.
        point: In the world [m].
    """
    distances = [abs(_distance(shape, (pose.inverse() @ Pose(point)).position)) for pose, shape in placed]
    return distances.index(min(distances))


def _distance(shape: specs.Geometry, point: Vector3) -> float:
    """Returns how far a point in the frame of a shape is from its surface [m]; negative inside."""
    x, y, z = point
    match shape:
        case specs.Box(size=(a, b, c)):
            return _box((abs(x) - a / 2, abs(y) - b / 2, abs(z) - c / 2))
        case specs.Cylinder(radius=radius, length=length):
            return _box((math.hypot(x, y) - radius, abs(z) - length / 2))
        case specs.Sphere(radius=radius):
            return math.hypot(x, y, z) - radius
        case specs.Plane(normal=(a, b, c)):
            return a * x + b * y + c * z
        case specs.Mesh():
            low, high = _bounds(shape)
            return _box(tuple(max(p - b, a - p) for p, a, b in zip(point, low, high, strict=True)))


def _box(beyond: Sequence[float]) -> float:
    """Returns the distance to a box from how far a point is beyond its sides along each axis."""
    return math.hypot(*(max(each, 0.0) for each in beyond)) + min(max(beyond), 0.0)


@functools.lru_cache(maxsize=256)
def _bounds(mesh: specs.Mesh) -> tuple[tuple[float, ...], tuple[float, ...]]:
    vertices = np.asarray(load_mesh(mesh).vertices)
    return tuple(vertices.min(axis=0).tolist()), tuple(vertices.max(axis=0).tolist())
