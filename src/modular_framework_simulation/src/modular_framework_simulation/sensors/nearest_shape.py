# SPDX-License-Identifier: BSD-3-Clause
"""Finds the collision shape nearest to a contact point, because the engine reports links instead of shapes."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import load_mesh
from modular_framework_simulation.models.poses import Pose
from modular_framework_urdf.rotations import Vector3


def nearest_shape(posed_shapes: Sequence[tuple[Pose, specs.Geometry]], point: Vector3) -> int:
    """Returns the index of the shape whose surface is nearest to a point; the bounding box represents a mesh.

    Args:
        posed_shapes: Shapes with their poses in the world frame.
        point: Point in the world frame [m].
    """
    distances = [abs(_distance(shape, (pose.inverse() @ Pose(point)).position)) for pose, shape in posed_shapes]
    return distances.index(min(distances))


def _distance(shape: specs.Geometry, point: Vector3) -> float:
    """Returns the signed distance of a point to the surface of a shape [m], negative inside the shape.

    Args:
        shape: The shape.
        point: Point in the frame of the shape [m].
    """
    x, y, z = point
    match shape:
        case specs.Box(size=(a, b, c)):
            return _box_distance((abs(x) - a / 2, abs(y) - b / 2, abs(z) - c / 2))
        case specs.Cylinder(radius=radius, length=length):
            return _box_distance((math.hypot(x, y) - radius, abs(z) - length / 2))
        case specs.Sphere(radius=radius):
            return math.hypot(x, y, z) - radius
        case specs.Plane(normal=(a, b, c)):
            return a * x + b * y + c * z
        case specs.Mesh():
            low, high = _bounds(shape)
            return _box_distance(tuple(max(p - b, a - p) for p, a, b in zip(point, low, high, strict=True)))


def _box_distance(face_distances: Sequence[float]) -> float:
    """Returns the signed distance to a box from the signed distances to its faces along each axis."""
    return math.hypot(*(max(each, 0.0) for each in face_distances)) + min(max(face_distances), 0.0)


@functools.lru_cache(maxsize=256)
def _bounds(mesh: specs.Mesh) -> tuple[tuple[float, ...], tuple[float, ...]]:
    vertices = np.asarray(load_mesh(mesh).vertices)
    return tuple(vertices.min(axis=0).tolist()), tuple(vertices.max(axis=0).tolist())
