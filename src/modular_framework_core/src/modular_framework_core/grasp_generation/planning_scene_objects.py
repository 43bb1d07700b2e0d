# SPDX-License-Identifier: BSD-3-Clause
"""Converts collision objects of the planning scene to surfaces and solids in the planning frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from modular_framework_core.grasp_generation import solid_meshes, surface_points
from modular_framework_core.grasp_generation.surface_points import Surface
from modular_framework_urdf.mesh_reader import TriangleMesh


class SceneObjectError(ValueError):
    """A collision object has an invalid part; the text names the part."""


@dataclass(frozen=True)
class SceneObject:
    """Object of the planning scene.

    Attributes:
        name: Id of the object.
        surface: Points on the surface, in the planning frame.
        solids: Parts as closed meshes in the planning frame; empty if only the surface is known.
    """

    name: str
    surface: Surface
    solids: tuple[TriangleMesh, ...] = ()

    @cached_property
    def centre(self) -> npt.NDArray[np.float64]:
        """Centre of the bounding box in the planning frame, shape (3,) [m]."""
        return (self.surface.points.min(axis=0) + self.surface.points.max(axis=0)) / 2

    @property
    def bottom(self) -> float:
        """Minimum z in the planning frame [m]."""
        return float(self.surface.points[:, 2].min())


@dataclass(frozen=True, slots=True)
class CropBox:
    """Search volume for objects: an axis-aligned box in the planning frame.

    Attributes:
        low: Minimum x, y, z [m].
        high: Maximum x, y, z [m].
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def holds(self, point: npt.NDArray[np.float64]) -> bool:
        """Returns whether a point of shape (3,) is inside the box."""
        return bool(np.all(point >= self.low) and np.all(point <= self.high))


def rotation_matrix(quaternion: Any) -> npt.NDArray[np.float64]:
    """Returns the rotation matrix of a quaternion message; a quaternion of zeros is the identity."""
    values = np.array([quaternion.x, quaternion.y, quaternion.z, quaternion.w])
    return Rotation.from_quat(values).as_matrix() if values.any() else np.eye(3)


def _translation(position: Any) -> npt.NDArray[np.float64]:
    return np.array([position.x, position.y, position.z])


@dataclass(frozen=True, slots=True)
class _ScenePart:
    """Part of an object: points on the surface, and the mesh."""

    surface: Surface
    solid: TriangleMesh

    def at_pose(self, pose: Any) -> _ScenePart:
        rotation, translation = rotation_matrix(pose.orientation), _translation(pose.position)
        return _ScenePart(
            self.surface.transformed(rotation, translation), solid_meshes.move_mesh(self.solid, rotation, translation)
        )


def _primitive(primitive: Any, where: str) -> _ScenePart:
    sizes = list(primitive.dimensions)
    if not sizes or min(sizes) <= 0.0:
        raise SceneObjectError(f"{where} has the dimensions {sizes}; all must be positive")
    match primitive.type, len(sizes):
        case (1, 3):
            return _ScenePart(surface_points.box(sizes), solid_meshes.box(sizes))
        case (2, 1):
            return _ScenePart(surface_points.sphere(sizes[0]), solid_meshes.sphere(sizes[0]))
        case (3, 2):
            return _ScenePart(surface_points.cylinder(sizes[0], sizes[1]), solid_meshes.cylinder(sizes[0], sizes[1]))
        case (4, 2):
            return _ScenePart(surface_points.cylinder(sizes[0], sizes[1], 0.0), solid_meshes.cone(sizes[0], sizes[1]))
        case _:
            raise SceneObjectError(
                f"{where} has type {primitive.type} with {len(sizes)} dimensions; allowed: box "
                "(3), sphere (1), cylinder (2), cone (2)"
            )


def scene_object(message: Any) -> SceneObject | None:
    """Converts a moveit_msgs/CollisionObject.

    Args:
        message: Message; the poses of the parts are relative to the pose of the object.

    Returns:
        The object; None if it has no solid part, such as a plane.

    Raises:
        SceneObjectError: A part is invalid.
    """
    parts = [
        _primitive(shape, f"object '{message.id}', primitive {number}").at_pose(pose)
        for number, (shape, pose) in enumerate(zip(message.primitives, message.primitive_poses, strict=True))
    ]
    for shape, pose in zip(message.meshes, message.mesh_poses, strict=True):
        vertices = np.array([[p.x, p.y, p.z] for p in shape.vertices], dtype=float).reshape(-1, 3)
        triangles = np.array([t.vertex_indices for t in shape.triangles], dtype=np.int64).reshape(-1, 3)
        if not len(triangles) or triangles.max() >= len(vertices):
            raise SceneObjectError(
                f"object '{message.id}' has a mesh of {len(vertices)} vertices and {len(triangles)} "
                "triangles; a mesh needs triangles, and vertices for all indices"
            )
        solid = solid_meshes.outward(TriangleMesh(vertices, triangles))
        parts.append(_ScenePart(surface_points.mesh(vertices, triangles), solid).at_pose(pose))
    if not parts:
        return None
    placed = [part.at_pose(message.pose) for part in parts]
    surface = surface_points.join_surfaces([part.surface for part in placed])
    return SceneObject(message.id, surface, tuple(part.solid for part in placed))
