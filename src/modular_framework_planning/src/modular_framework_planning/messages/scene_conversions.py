# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of objects, attached objects, collision matrices and frames between messages and scenes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from geometry_msgs.msg import Point, TransformStamped
from moveit_msgs.msg import AllowedCollisionEntry, AttachedCollisionObject, CollisionObject, ObjectColor
from shape_msgs.msg import Mesh as MeshMessage
from shape_msgs.msg import MeshTriangle, SolidPrimitive
from shape_msgs.msg import Plane as PlaneMessage

from modular_framework_planning.errors import ErrorCode, GeometryError, UnknownNameError
from modular_framework_planning.geometry.shapes import Box, Cone, Cylinder, Mesh, Plane, Shape, Sphere
from modular_framework_planning.geometry.spatial import Transform, make_transform, quaternion_or_identity
from modular_framework_planning.messages.poses import pose_message
from modular_framework_planning.planning_scene import planning_scene as core
from modular_framework_planning.planning_scene.allowed_collisions import AllowedCollisionMatrix, matrix_from_rows
from modular_framework_planning.planning_scene.planning_scene import OCTOMAP_ID, PlanningScene


def _transform(pose: Any, field_name: str) -> Transform:
    p, q = pose.position, pose.orientation
    return make_transform((p.x, p.y, p.z), quaternion_or_identity((q.x, q.y, q.z, q.w), field_name), field_name)


def _is_unset(pose: Any) -> bool:
    p, q = pose.position, pose.orientation
    return all(value == 0.0 for value in (p.x, p.y, p.z, q.x, q.y, q.z, q.w))


def _primitive(message: Any, field_name: str) -> Shape:
    kinds: dict[int, tuple[type[Any], int]] = {
        SolidPrimitive.BOX: (Box, 3),
        SolidPrimitive.SPHERE: (Sphere, 1),
        SolidPrimitive.CYLINDER: (Cylinder, 2),
        SolidPrimitive.CONE: (Cone, 2),
    }
    if message.type not in kinds:
        raise GeometryError(
            f"{field_name}: primitive type {message.type}; allowed types: 1 box, 2 sphere, 3 cylinder, 4 cone"
        )
    kind, count = kinds[message.type]
    if len(message.dimensions) < count:
        raise GeometryError(
            f"{field_name}: {kind.__name__.lower()} with {len(message.dimensions)} dimensions; give {count}"
        )
    try:
        return kind(*message.dimensions[:count])
    except GeometryError as error:
        raise GeometryError(f"{field_name}: {error.reason}") from error


def _mesh(message: Any, field_name: str) -> Shape:
    vertices = np.array([(p.x, p.y, p.z) for p in message.vertices], dtype=float).reshape(-1, 3)
    triangles = np.array([t.vertex_indices for t in message.triangles], dtype=np.int64).reshape(-1, 3)
    try:
        return Mesh(vertices, triangles)
    except GeometryError as error:
        raise GeometryError(f"{field_name}: {error.reason}") from error


def _shapes(message: Any, field_name: str) -> tuple[tuple[Shape, Transform], ...]:
    result: list[tuple[Shape, Transform]] = []
    for kind, items, poses, build in (
        ("primitive", message.primitives, message.primitive_poses, _primitive),
        ("mesh", message.meshes, message.mesh_poses, _mesh),
        ("plane", message.planes, message.plane_poses, lambda item, _: Plane(*item.coef)),
    ):
        if len(poses) > len(items):
            raise GeometryError(
                f"{field_name}: {len(items)} {kind} shapes and {len(poses)} poses; give one pose per shape"
            )
        for index, item in enumerate(items):
            source = f"{field_name} {kind} {index}"
            pose = _transform(poses[index], source) if index < len(poses) else pin.SE3.Identity()
            result.append((build(item, source), pose))
    return tuple(result)


def _object_pose(scene: PlanningScene, message: Any, field_name: str) -> Transform:
    """Returns the object's pose in the planning frame; an unset pose means the pose of the header's frame."""
    frame = scene.frame_transform(message.header.frame_id)
    return frame if _is_unset(message.pose) else frame * _transform(message.pose, field_name)


def _body(scene: PlanningScene, message: Any) -> core.CollisionObject:
    field_name = f"collision object '{message.id}'"
    if len(message.subframe_names) != len(message.subframe_poses):
        raise GeometryError(
            f"{field_name}: {len(message.subframe_names)} subframe names and "
            f"{len(message.subframe_poses)} poses; give one pose per name"
        )
    subframes = {
        name: _transform(pose, f"{field_name} subframe '{name}'")
        for name, pose in zip(message.subframe_names, message.subframe_poses, strict=True)
    }
    pose, shapes = _object_pose(scene, message, field_name), _shapes(message, field_name)
    if len(shapes) == 1 and _is_unset(message.pose):  # as in MoveIt, the only shape sets the object's pose
        shape, pose_in_header = shapes[0]
        pose, shapes = pose * pose_in_header, ((shape, pin.SE3.Identity()),)
    return core.CollisionObject(message.id, pose, shapes, subframes)


def apply_collision_object(scene: PlanningScene, message: CollisionObject) -> PlanningScene:
    """Returns the scene after ADD, APPEND, MOVE or REMOVE of a world object; raises PlanningError."""
    if message.id == OCTOMAP_ID:
        raise GeometryError(f"collision object: id '{OCTOMAP_ID}' is reserved for the octomap; use another id")
    if message.operation == CollisionObject.ADD:
        return scene.with_object(_body(scene, message))
    if message.operation == CollisionObject.APPEND:
        return scene.with_shapes_appended(_body(scene, message))
    if message.operation == CollisionObject.REMOVE:
        if not message.id:
            return scene.without_objects()
        return scene.without_object(message.id) if message.id in scene.objects else scene
    if message.operation == CollisionObject.MOVE:
        return _move(scene, message)
    raise GeometryError(
        f"collision object '{message.id}': operation {message.operation}; "
        "allowed operations: 0 ADD, 1 REMOVE, 2 APPEND, 3 MOVE"
    )


def _move(scene: PlanningScene, message: CollisionObject) -> PlanningScene:
    """Moves an object and, if the message has shape poses, its shapes; geometry in the message is ignored."""
    field_name = f"collision object '{message.id}'"
    scene.find_object(message.id)
    pose = _object_pose(scene, message, field_name)
    shape_poses = [
        _transform(item, f"{field_name} shape {index}")
        for index, item in enumerate((*message.primitive_poses, *message.mesh_poses, *message.plane_poses))
    ]
    if len(shape_poses) == 1 and _is_unset(message.pose):  # as in ADD, the only shape sets the object's pose
        pose, shape_poses = pose * shape_poses[0], [pin.SE3.Identity()]
    return scene.with_object_moved(message.id, pose, shape_poses)


def apply_attached_object(scene: PlanningScene, message: AttachedCollisionObject) -> PlanningScene:
    """Returns the scene after attaching or detaching; raises PlanningError."""
    name, operation = message.object.id, message.object.operation
    if operation == CollisionObject.REMOVE:
        return _detach(scene, name, message.link_name)
    if operation not in (CollisionObject.ADD, CollisionObject.APPEND):
        raise GeometryError(
            f"attached object '{name}': operation {operation}; allowed operations: 0 ADD, 1 REMOVE, 2 APPEND"
        )
    if message.link_name not in scene.model.frame_ids:
        raise UnknownNameError(
            ErrorCode.INVALID_LINK_NAME, f"attaching '{name}': link", message.link_name, scene.model.frame_ids
        )
    body = _body(scene, message.object)
    if name in scene.attached and (operation == CollisionObject.APPEND or not body.shapes):
        released = scene.with_detached(name)
        body = (released.with_shapes_appended(body) if body.shapes else released).objects[name]
    elif not body.shapes and name in scene.objects:
        body = scene.objects[name]
    link = scene.model.link_transforms(scene.positions)[message.link_name]
    in_link = core.CollisionObject(body.name, link.actInv(body.pose), body.shapes, body.subframes)
    return scene.with_attached(core.AttachedObject(in_link, message.link_name, frozenset(message.touch_links)))


def _detach(scene: PlanningScene, name: str, link: str) -> PlanningScene:
    """Moves attached objects back into the world.

    Args:
        scene: Scene.
        name: Object to detach; empty for all objects of the link.
        link: Link of the objects; empty for any link.
    """
    if name in scene.attached and link not in ("", scene.attached[name].link):
        raise GeometryError(
            f"detaching '{name}': the object is attached to '{scene.attached[name].link}', not to '{link}'; "
            "name the right link or leave link_name empty"
        )
    names = [name] if name else [key for key, item in scene.attached.items() if link in ("", item.link)]
    for item in names:
        scene = scene.with_detached(item)
    return scene


def with_matrix_of(scene: PlanningScene, message: Any) -> PlanningScene:
    """Returns the scene with the allowed collisions of a message.

    An empty message changes nothing; a message with defaults only changes these defaults.

    Raises:
        GeometryError: The matrix is not square, or the counts of names and values of defaults differ.
    """
    if len(message.default_entry_names) != len(message.default_entry_values):
        raise GeometryError(
            f"allowed_collision_matrix: {len(message.default_entry_names)} default_entry_names and "
            f"{len(message.default_entry_values)} default_entry_values; give one value per name"
        )
    defaults = dict(zip(message.default_entry_names, map(bool, message.default_entry_values), strict=True))
    if not message.entry_names:
        return scene.with_acm(scene.acm.with_defaults(defaults)) if defaults else scene
    try:
        rows = [list(row.enabled) for row in message.entry_values]
        return scene.with_acm(matrix_from_rows(list(message.entry_names), rows, defaults))
    except ValueError as error:
        raise GeometryError(str(error)) from error


def write_matrix(matrix: AllowedCollisionMatrix, message: Any) -> None:
    """Fills an AllowedCollisionMatrix message."""
    message.entry_names = list(matrix.names)
    message.entry_values = [AllowedCollisionEntry(enabled=row) for row in matrix.as_rows()]
    message.default_entry_names = list(matrix.defaults)
    message.default_entry_values = list(matrix.defaults.values())


def fixed_frames_from(scene: PlanningScene, transforms: Sequence[Any]) -> dict[str, Transform]:
    """Returns the poses of fixed_frame_transforms in the planning frame, without frames of the robot."""
    frames = {}
    for item in transforms:
        t, q = item.transform.translation, item.transform.rotation
        pose = make_transform((t.x, t.y, t.z), (q.x, q.y, q.z, q.w), f"fixed frame '{item.child_frame_id}'")
        if not scene.model.has_link(item.child_frame_id):
            frames[item.child_frame_id] = scene.frame_transform(item.header.frame_id) * pose
    return frames


def object_to_message(body: core.CollisionObject, frame: str, with_geometry: bool = True) -> CollisionObject:
    """Returns the message of an object.

    Args:
        body: Object.
        frame: Frame in which the object's pose is given.
        with_geometry: Whether the message holds shapes and subframes.
    """
    message = CollisionObject(id=body.name, operation=CollisionObject.ADD)
    message.header.frame_id = frame
    message.pose = pose_message(body.pose)
    if not with_geometry:
        return message
    for shape, pose in body.shapes:
        _write_shape(message, shape, pose_message(pose))
    message.subframe_names = list(body.subframes)
    message.subframe_poses = [pose_message(pose) for pose in body.subframes.values()]
    return message


def _write_shape(message: CollisionObject, shape: Shape, pose: Any) -> None:
    match shape:
        case Box():
            solid = SolidPrimitive(SolidPrimitive.BOX, [shape.x, shape.y, shape.z])
        case Sphere():
            solid = SolidPrimitive(SolidPrimitive.SPHERE, [shape.radius])
        case Cylinder():
            solid = SolidPrimitive(SolidPrimitive.CYLINDER, [shape.height, shape.radius])
        case Cone():
            solid = SolidPrimitive(SolidPrimitive.CONE, [shape.height, shape.radius])
        case Plane():
            message.planes.append(PlaneMessage([shape.a, shape.b, shape.c, shape.d]))
            message.plane_poses.append(pose)
            return
        case Mesh():
            message.meshes.append(
                MeshMessage(
                    [MeshTriangle([int(i) for i in row]) for row in shape.triangles],
                    [Point(*row) for row in shape.vertices],
                )
            )
            message.mesh_poses.append(pose)
            return
        case _:
            raise GeometryError(f"a shape of type {type(shape).__name__} has no message")
    message.primitives.append(solid)
    message.primitive_poses.append(pose)


def attached_to_message(
    scene: PlanningScene, item: core.AttachedObject, with_geometry: bool = True
) -> AttachedCollisionObject:
    """Returns an attached object as a message in the frame of its link.

    Args:
        scene: Scene.
        item: Attached object.
        with_geometry: Whether shapes are included.
    """
    message = AttachedCollisionObject(link_name=item.link, touch_links=sorted(item.touch_links))
    message.object = object_to_message(item.body, item.link, with_geometry)
    return message


def colors_to_message(scene: PlanningScene) -> list[ObjectColor]:
    """Returns the colours of objects as messages."""
    result = []
    for name, (red, green, blue, alpha) in scene.colors.items():
        color = ObjectColor(id=name)
        color.color.r, color.color.g, color.color.b, color.color.a = red, green, blue, alpha
        result.append(color)
    return result


def frames_to_message(scene: PlanningScene) -> list[TransformStamped]:
    """Returns the fixed frames as messages."""
    result = []
    for name, transform in {scene.model.planning_frame: pin.SE3.Identity(), **scene.fixed_frames}.items():
        item = TransformStamped(child_frame_id=name)
        item.header.frame_id = scene.model.planning_frame
        pose = pose_message(transform)
        item.transform.translation.x, item.transform.translation.y, item.transform.translation.z = (
            pose.position.x,
            pose.position.y,
            pose.position.z,
        )
        item.transform.rotation = pose.orientation
        result.append(item)
    return result
