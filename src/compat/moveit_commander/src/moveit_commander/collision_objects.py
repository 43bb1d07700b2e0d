# SPDX-License-Identifier: BSD-3-Clause
"""Builds collision objects: primitives, planes and meshes from files."""

from __future__ import annotations

from collections.abc import Sequence

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_msgs.msg import CollisionObject
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive

from modular_framework_urdf.mesh_reader import MeshError, read_mesh
from moveit_commander.exception import MoveItCommanderException


def existing(name: str) -> CollisionObject:
    """Returns an object that refers to one that is in the scene already."""
    return CollisionObject(id=name, operation=CollisionObject.ADD)


def primitive(name: str, pose: PoseStamped, kind: int, dimensions: Sequence[float]) -> CollisionObject:
    """Returns an object of one primitive; `kind` and `dimensions` [m] as in shape_msgs/SolidPrimitive."""
    sizes = [float(size) for size in dimensions]
    if any(not size > 0.0 for size in sizes):
        raise MoveItCommanderException(f"object '{name}': sizes {sizes} m; every size must be above 0")
    item = _empty(name, pose)
    item.primitives = [SolidPrimitive(kind, sizes)]
    return item


def plane(name: str, pose: PoseStamped, normal: Sequence[float], offset: float) -> CollisionObject:
    """Returns the plane normal . p + offset = 0 in the frame of the pose [m]."""
    item = CollisionObject(header=pose.header, id=name, operation=CollisionObject.ADD)
    item.planes = [Plane([float(value) for value in (*normal, offset)])]
    item.plane_poses = [pose.pose]
    return item


def mesh(name: str, pose: PoseStamped, filename: str, scale: Sequence[float]) -> CollisionObject:
    """Returns the triangles of a mesh file (STL, OBJ, PLY, DAE), scaled along x, y, z.

    Raises:
        MoveItCommanderException: the file is not there, cannot be read whole, or holds no triangle.
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
    item.pose = Pose(pose.pose.position, _turn(pose.pose.orientation))
    return item


def _turn(orientation: Quaternion) -> Quaternion:
    """Returns an orientation; all zeros means the identity."""
    turned = any((orientation.x, orientation.y, orientation.z, orientation.w))
    return orientation if turned else Quaternion(0.0, 0.0, 0.0, 1.0)
