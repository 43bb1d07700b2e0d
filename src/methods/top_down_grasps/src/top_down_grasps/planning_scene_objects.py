# SPDX-License-Identifier: BSD-3-Clause
"""Converts collision objects of the planning scene to surfaces in the planning frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from top_down_grasps import surface_points
from top_down_grasps.surface_points import Surface

BOX, SPHERE, CYLINDER, CONE = 1, 2, 3, 4


class SceneObjectError(ValueError):
    """A collision object cannot be understood; the text says which part."""


@dataclass(frozen=True, slots=True)
class SceneObject:
    """An object of the planning scene.

    Attributes:
        name: Id of the object.
        surface: Its surface in the planning frame.
    """

    name: str
    surface: Surface

    @property
    def centre(self) -> npt.NDArray[np.float64]:
        """Centre of the bounding box in the planning frame (3,) [m]."""
        return (self.surface.points.min(axis=0) + self.surface.points.max(axis=0)) / 2

    @property
    def bottom(self) -> float:
        """Lowest z in the planning frame [m]."""
        return float(self.surface.points[:, 2].min())


@dataclass(frozen=True, slots=True)
class CropBox:
    """The search volume for objects: a box along the axes of the planning frame.

    Attributes:
        low: Smallest x, y, z [m].
        high: Greatest x, y, z [m].
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def holds(self, point: npt.NDArray[np.float64]) -> bool:
        """Returns whether a point (3,) is inside."""
        return bool(np.all(point >= self.low) and np.all(point <= self.high))


def is_named(object_id: str, wanted: str) -> bool:
    """Returns whether an object id belongs to a model, or is the id itself; an empty name matches all."""
    return not wanted or object_id == wanted or object_id.startswith(f"{wanted}__")


def rotation_matrix(quaternion: Any) -> npt.NDArray[np.float64]:
    """Returns the rotation matrix of a quaternion message; an unset one (all zero) is no rotation."""
    values = np.array([quaternion.x, quaternion.y, quaternion.z, quaternion.w])
    return np.eye(3) if values @ values < 1e-12 else Rotation.from_quat(values).as_matrix()


def _translation(position: Any) -> npt.NDArray[np.float64]:
    return np.array([position.x, position.y, position.z])


def _placed(surface: Surface, pose: Any) -> Surface:
    return surface.moved(rotation_matrix(pose.orientation), _translation(pose.position))


def _primitive(primitive: Any, where: str) -> Surface:
    sizes = list(primitive.dimensions)
    if not sizes or min(sizes) <= 0.0:
        raise SceneObjectError(f"{where} has the dimensions {sizes}; all must be positive")
    match primitive.type, len(sizes):
        case (1, 3):
            return surface_points.box(sizes)
        case (2, 1):
            return surface_points.sphere(sizes[0])
        case (3, 2):
            return surface_points.cylinder(sizes[0], sizes[1])
        case (4, 2):
            return surface_points.cylinder(sizes[0], sizes[1], 0.0)
        case _:
            raise SceneObjectError(
                f"{where} has type {primitive.type} with {len(sizes)} dimensions; allowed are box "
                "(3), sphere (1), cylinder (2) and cone (2)"
            )


def scene_object(message: Any) -> SceneObject | None:
    """Converts a moveit_msgs/CollisionObject.

    Args:
        message: The object; its parts are placed relative to its own pose.

    Returns:
        The object; None when it has no solid part (a plane).

    Raises:
        SceneObjectError: A part cannot be understood.
    """
    parts = [
        _placed(_primitive(shape, f"object '{message.id}', primitive {number}"), pose)
        for number, (shape, pose) in enumerate(zip(message.primitives, message.primitive_poses, strict=True))
    ]
    for shape, pose in zip(message.meshes, message.mesh_poses, strict=True):
        vertices = np.array([[p.x, p.y, p.z] for p in shape.vertices], dtype=float).reshape(-1, 3)
        triangles = np.array([t.vertex_indices for t in shape.triangles], dtype=np.int64).reshape(-1, 3)
        if not len(triangles) or triangles.max() >= len(vertices):
            raise SceneObjectError(
                f"object '{message.id}' has a mesh of {len(vertices)} vertices and {len(triangles)} "
                "triangles that does not hold together"
            )
        parts.append(_placed(surface_points.mesh(vertices, triangles), pose))
    return SceneObject(message.id, _placed(surface_points.joined(parts), message.pose)) if parts else None
