# SPDX-License-Identifier: BSD-3-Clause
"""Collision objects from primitives, planes and mesh files."""

from __future__ import annotations

from collections.abc import Sequence

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_msgs.msg import CollisionObject
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive

from modular_framework_urdf.mesh_reader import MeshError, read_mesh
from moveit_commander.exception import MoveItCommanderException


def existing(name: str) -> CollisionObject:
    """Returns an object that refers to an existing object of the scene."""
    return CollisionObject(id=name, operation=CollisionObject.ADD)


def primitive(name: str, pose: PoseStamped, kind: int, dimensions: Sequence[float]) -> CollisionObject:
    """Returns an object of one primitive.

    Args:
        name: Id of the object.
        pose: Pose of the primitive.
        kind: Type in shape_msgs/SolidPrimitive.
        dimensions: Dimensions in shape_msgs/SolidPrimitive [m].

    Raises:
        MoveItCommanderException: A dimension is not above 0.
    """
    sizes = [float(size) for size in dimensions]
    if any(not size > 0.0 for size in sizes):
        raise MoveItCommanderException(f"object '{name}': sizes {sizes} m; every size must be above 0")
    item = _empty(name, pose)
    item.primitives = [SolidPrimitive(kind, sizes)]
    return item


def plane(name: str, pose: PoseStamped, normal: Sequence[float], offset: float) -> CollisionObject:
    """Returns the plane normal . p + offset = 0 in the frame of the pose.

    Args:
        name: Id of the object.
        pose: Pose of the plane.
        normal: Normal vector of the plane.
        offset: Offset of the plane [m].
    """
    item = CollisionObject(header=pose.header, id=name, operation=CollisionObject.ADD)
    item.planes = [Plane([float(value) for value in (*normal, offset)])]
    item.plane_poses = [pose.pose]
    return item


def mesh(name: str, pose: PoseStamped, filename: str, scale: Sequence[float]) -> CollisionObject:
    """Returns an object with the triangles of a mesh file (STL, OBJ, PLY, DAE).

    Args:
        name: Id of the object.
        pose: Pose of the mesh.
        filename: Path or file:// URI of the mesh.
        scale: Scaling factors along x, y, z.

    Raises:
        MoveItCommanderException: The file is missing, incomplete, or contains no triangle.
    """
    try:
        loaded = read_mesh(str(filename).removeprefix("file://"), tuple(float(factor) for factor in scale))
    except MeshError as error:
        raise MoveItCommanderException(str(error)) from error
    shape = Mesh(
        triangles=[MeshTriangle(corners) for corners in loaded.triangles.tolist()],
        vertices=[Point(*vertex) for vertex in loaded.vertices.tolist()],
    )
    item = _empty(name, pose)
    item.meshes = [shape]
    return item


def _empty(name: str, pose: PoseStamped) -> CollisionObject:
    item = CollisionObject(header=pose.header, id=name, operation=CollisionObject.ADD)
    item.pose = Pose(pose.pose.position, _orientation_or_identity(pose.pose.orientation))
    return item


def _orientation_or_identity(orientation: Quaternion) -> Quaternion:
    """Returns the orientation, or the identity if all components are zero."""
    nonzero = any((orientation.x, orientation.y, orientation.z, orientation.w))
    return orientation if nonzero else Quaternion(0.0, 0.0, 0.0, 1.0)
