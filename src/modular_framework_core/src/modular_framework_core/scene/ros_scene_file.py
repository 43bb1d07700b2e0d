# SPDX-License-Identifier: BSD-3-Clause
"""Loads a text scene into the planning scene, and saves the planning scene as a text scene."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, NoReturn

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import CollisionObject, ObjectColor, PlanningScene, PlanningSceneComponents
from moveit_msgs.srv import (
    ApplyPlanningScene,
    ApplyPlanningSceneRequest,
    GetPlanningScene,
    GetPlanningSceneRequest,
)
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive

from modular_framework_core.files.atomic_files import write_atomically
from modular_framework_core.scene.scene_file import (
    NO_COLOR,
    Scene,
    SceneFileError,
    SceneObject,
    SceneShape,
    Vector,
    read_scene_file,
    scene_text,
)
from modular_framework_ros.calls import CallError, call_service, wait_for_service
from modular_framework_ros.start_up import start_timeout

SERVICE_TIMEOUT_S = 10.0
PRIMITIVES = {
    "box": SolidPrimitive.BOX,
    "sphere": SolidPrimitive.SPHERE,
    "cylinder": SolidPrimitive.CYLINDER,
    "cone": SolidPrimitive.CONE,
}


def collision_object(scene_object: SceneObject) -> CollisionObject:
    """Returns an object as a message. An empty frame stands for the planning frame."""
    message = CollisionObject(id=scene_object.name, operation=CollisionObject.ADD)
    message.pose = _pose(scene_object.position, scene_object.quaternion_xyzw)
    message.subframe_names = [name for name, _, _ in scene_object.subframes]
    message.subframe_poses = [_pose(position, quaternion) for _, position, quaternion in scene_object.subframes]
    for shape in scene_object.shapes:
        pose = _pose(shape.position, shape.quaternion_xyzw)
        match shape.kind:
            case "plane":
                message.planes.append(Plane(coef=list(shape.size)))
                message.plane_poses.append(pose)
            case "mesh":
                message.meshes.append(
                    Mesh(
                        [MeshTriangle(list(indices)) for indices in shape.triangles],
                        [Point(*vertex) for vertex in shape.vertices],
                    )
                )
                message.mesh_poses.append(pose)
            case "cylinder" | "cone":
                radius, length = shape.size
                message.primitives.append(SolidPrimitive(PRIMITIVES[shape.kind], [length, radius]))
                message.primitive_poses.append(pose)
            case _:
                message.primitives.append(SolidPrimitive(PRIMITIVES[shape.kind], list(shape.size)))
                message.primitive_poses.append(pose)
    return message


def _pose(position: Vector, quaternion_xyzw: Vector) -> Pose:
    return Pose(Point(*position), Quaternion(*quaternion_xyzw))


def scene_from_message(message: PlanningScene) -> Scene:
    """Returns the world objects of a planning scene. The octomap and attached objects are not part of a text scene."""
    colors = {item.id: (item.color.r, item.color.g, item.color.b, item.color.a) for item in message.object_colors}
    return Scene(
        message.name or "(noname)",
        tuple(
            SceneObject(
                item.id,
                *_vectors(item.pose),
                _shapes(item, colors.get(item.id, NO_COLOR)),
                tuple(
                    (name, *_vectors(pose)) for name, pose in zip(item.subframe_names, item.subframe_poses, strict=True)
                ),
            )
            for item in message.world.collision_objects
        ),
    )


def _shapes(message: CollisionObject, color: Vector) -> tuple[SceneShape, ...]:
    kinds = {primitive_type: kind for kind, primitive_type in PRIMITIVES.items()}
    shapes = [
        SceneShape(
            kinds[solid.type],
            tuple(solid.dimensions[::-1] if kinds[solid.type] in ("cylinder", "cone") else solid.dimensions),
            *_vectors(pose),
            color=color,
        )
        for solid, pose in zip(message.primitives, message.primitive_poses, strict=True)
    ]
    shapes += [
        SceneShape(
            "mesh",
            (),
            *_vectors(pose),
            vertices=tuple((p.x, p.y, p.z) for p in mesh.vertices),
            triangles=tuple(tuple(item.vertex_indices) for item in mesh.triangles),
            color=color,
        )
        for mesh, pose in zip(message.meshes, message.mesh_poses, strict=True)
    ]
    return (
        *shapes,
        *(
            SceneShape("plane", tuple(plane.coef), *_vectors(pose), color=color)
            for plane, pose in zip(message.planes, message.plane_poses, strict=True)
        ),
    )


def _vectors(pose: Pose) -> tuple[Vector, Vector]:
    p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z), (q.x, q.y, q.z, q.w)


class _Arguments(argparse.ArgumentParser):
    """Argument parser that raises SceneFileError instead of exiting."""

    def error(self, message: str) -> NoReturn:
        raise SceneFileError(f"arguments: {message}")


def _arguments(*options: tuple[str, str]) -> argparse.Namespace:
    parser = _Arguments(allow_abbrev=False)
    parser.add_argument("file", type=Path)
    for name, text in options:
        parser.add_argument(name, action="store_true", help=text)
    return parser.parse_args(rospy.myargv(sys.argv)[1:])


def _call(service: str, kind: Any, request: Any) -> Any:
    proxy = rospy.ServiceProxy(service, kind)
    wait_for_service(proxy, start_timeout())
    return call_service(proxy, request, SERVICE_TIMEOUT_S)


def planning_scene(scene: Scene, replace: bool) -> PlanningScene:
    """Returns a scene as a message that adds the objects to the planning scene, or replaces the whole scene."""
    message = PlanningScene(is_diff=not replace, name=scene.name if replace else "")
    message.robot_state.is_diff = True
    message.world.collision_objects = [collision_object(scene_object) for scene_object in scene.objects]
    for scene_object in scene.objects:
        if scene_object.color != NO_COLOR:
            color = ObjectColor(id=scene_object.name)
            color.color.r, color.color.g, color.color.b, color.color.a = scene_object.color
            message.object_colors.append(color)
    return message


def main() -> int:
    """Runs the node ``moveit_publish_scene_from_text [--scene] FILE``. Service called: ``apply_planning_scene``.

    The objects are added to the planning scene; with ``--scene`` they replace the whole scene.

    Returns:
        Exit code: 0 for success, 1 if move_group is missing or refuses, 2 for an invalid file.
    """
    rospy.init_node("moveit_publish_scene_from_text")
    try:
        arguments = _arguments(("--scene", "replace the whole planning scene"))
        scene = read_scene_file(arguments.file)
    except SceneFileError as error:
        rospy.logfatal("moveit_publish_scene_from_text: %s", error)
        return 2
    try:
        request = ApplyPlanningSceneRequest(scene=planning_scene(scene, arguments.scene))
        applied = _call("apply_planning_scene", ApplyPlanningScene, request).success
    except CallError as error:
        rospy.logfatal("moveit_publish_scene_from_text: %s", error)
        return 1
    if not applied:
        rospy.logfatal(
            "moveit_publish_scene_from_text: service '%s' refused the objects of %s; its node logged the reason",
            rospy.resolve_name("apply_planning_scene"),
            arguments.file,
        )
        return 1
    rospy.loginfo("The planning scene has the %d objects of %s.", len(scene.objects), arguments.file)
    return 0


def export_main() -> int:
    """Runs the node ``moveit_export_scene_to_text [--old] FILE``. Service called: ``get_planning_scene``.

    ``--old`` writes the old layout, without object poses and subframes.

    Returns:
        Exit code: 0 for success, 1 if move_group is missing, 2 if the file cannot be written.
    """
    rospy.init_node("moveit_export_scene_to_text", anonymous=True)
    parts = PlanningSceneComponents
    components = parts(
        parts.SCENE_SETTINGS | parts.WORLD_OBJECT_NAMES | parts.WORLD_OBJECT_GEOMETRY | parts.OBJECT_COLORS
    )
    try:
        arguments = _arguments(("--old", "write the old layout"))
        scene = scene_from_message(
            _call("get_planning_scene", GetPlanningScene, GetPlanningSceneRequest(components)).scene
        )
        write_atomically(arguments.file, scene_text(scene, arguments.old))
    except CallError as error:
        rospy.logfatal("moveit_export_scene_to_text: %s", error)
        return 1
    except (SceneFileError, OSError) as error:
        rospy.logfatal("moveit_export_scene_to_text: %s", error)
        return 2
    rospy.loginfo("%s has the %d objects of the planning scene.", arguments.file, len(scene.objects))
    return 0
