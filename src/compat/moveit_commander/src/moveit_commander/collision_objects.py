# SPDX-License-Identifier: BSD-3-Clause
"""Builds collision objects: primitives, planes and meshes from files."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_msgs.msg import CollisionObject
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive

from moveit_commander.exception import MoveItCommanderException


def existing(name: str) -> CollisionObject:
    """Stands for an object that is in the scene already."""
    return CollisionObject(id=name, operation=CollisionObject.ADD)


def primitive(name: str, pose: PoseStamped, kind: int, dimensions: Sequence[float]) -> CollisionObject:
    """An object of one primitive; `kind` and `dimensions` [m] as in shape_msgs/SolidPrimitive."""
    sizes = [float(size) for size in dimensions]
    if any(not size > 0.0 for size in sizes):
        raise MoveItCommanderException(f"object '{name}': sizes {sizes} m; every size must be above 0")
    item = _empty(name, pose)
    item.primitives = [SolidPrimitive(kind, sizes)]
    return item


def plane(name: str, pose: PoseStamped, normal: Sequence[float], offset: float) -> CollisionObject:
    """The plane normal . p + offset = 0 in the frame of the pose [m]."""
    item = CollisionObject(header=pose.header, id=name, operation=CollisionObject.ADD)
    item.planes = [Plane([float(value) for value in (*normal, offset)])]
    item.plane_poses = [pose.pose]
    return item


def mesh(name: str, pose: PoseStamped, filename: str, scale: Sequence[float]) -> CollisionObject:
    """The triangles of a mesh file (STL, OBJ, PLY, DAE, ...), scaled along x, y, z.

    Raises:
        MoveItCommanderException: the file is not there, cannot be read, or holds no triangle.
    """
    loaded = _load(filename)
    if not len(getattr(loaded, "faces", ())):
        raise MoveItCommanderException(f"There are no faces in the mesh {filename}; a file with triangles is needed")
    shape = Mesh(triangles=[MeshTriangle([int(corner) for corner in face]) for face in loaded.faces])
    shape.vertices = [Point(*(float(value) * float(factor) for value, factor in zip(vertex, scale, strict=True)))
                      for vertex in loaded.vertices]
    item = _empty(name, pose)
    item.meshes = [shape]
    return item


def _load(filename: str) -> Any:
    import trimesh

    path = Path(str(filename).removeprefix("file://"))
    if not path.is_file():
        raise MoveItCommanderException(f"mesh file {path} does not exist; give a path of this machine")
    try:
        return trimesh.load(path, force="mesh")
    except Exception as error:  # noqa: BLE001 - each format's reader raises what it likes
        raise MoveItCommanderException(f"mesh file {path} cannot be read: {error}; STL, OBJ and PLY can") from error


def _empty(name: str, pose: PoseStamped) -> CollisionObject:
    item = CollisionObject(header=pose.header, id=name, operation=CollisionObject.ADD)
    item.pose = Pose(pose.pose.position, _turn(pose.pose.orientation))
    return item


def _turn(orientation: Quaternion) -> Quaternion:
    """An orientation that was left all 0 means: not turned."""
    turned = any((orientation.x, orientation.y, orientation.z, orientation.w))
    return orientation if turned else Quaternion(0.0, 0.0, 0.0, 1.0)
