# SPDX-License-Identifier: BSD-3-Clause
"""Extents of a model's collision shapes: along a direction, and as a bounding box."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import load_mesh
from modular_framework_simulation.models.poses import Pose
from modular_framework_urdf.rotations import Vector3, rotate_vector

PLANE_REACH_M = 1000.0
"""Extent that replaces the infinite extent of a plane [m]."""
_AXES: tuple[Vector3, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_MIN_ALONG_NORMAL = 1.0 - 1e-9
"""Minimum cosine between a direction and the normal of a plane for which the plane is finite."""


def bounding_box(model: specs.Model) -> tuple[Vector3, Vector3] | None:
    """Returns the smallest and largest corner of the collision shapes in the model frame [m]; None without shapes.

    The joints of the model are at 0.

    Args:
        model: Description of the model.
    """
    if not any(link.collisions for link in model.links):
        return None
    low_x, low_y, low_z = (-reach(model, (-x, -y, -z)) for x, y, z in _AXES)
    high_x, high_y, high_z = (reach(model, axis) for axis in _AXES)
    return (low_x, low_y, low_z), (high_x, high_y, high_z)


def reach(model: specs.Model, direction: Vector3) -> float:
    """Returns the largest coordinate of the collision shapes along a direction, with the joints at 0 [m].

    Args:
        model: Description of a model with collision shapes.
        direction: Unit vector in the model frame.
    """
    return max(_reach_of(shape, pose, direction) for shape, pose in _shapes(model))


def _shapes(model: specs.Model) -> Iterable[tuple[specs.Geometry, Pose]]:
    for link in model.links:
        for collision in link.collisions:
            yield collision.geometry, link.pose @ collision.pose


def _reach_of(shape: specs.Geometry, pose: Pose, direction: Vector3) -> float:
    x, y, z = rotate_vector(pose.inverse().quaternion, direction)
    match shape:
        case specs.Sphere():
            extent = shape.radius
        case specs.Box():
            extent = sum(abs(part) * size / 2 for part, size in zip((x, y, z), shape.size, strict=True))
        case specs.Cylinder():
            extent = abs(z) * shape.length / 2 + shape.radius * math.hypot(x, y)
        case specs.Mesh():
            extent = float(np.max(np.asarray(load_mesh(shape).vertices) @ np.array((x, y, z))))
        case specs.Plane():
            along = sum(a * b for a, b in zip((x, y, z), shape.normal, strict=True))
            extent = 0.0 if along >= _MIN_ALONG_NORMAL else PLANE_REACH_M
    return sum(a * b for a, b in zip(pose.position, direction, strict=True)) + extent
