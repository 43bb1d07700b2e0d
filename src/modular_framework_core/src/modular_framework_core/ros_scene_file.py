# SPDX-License-Identifier: BSD-3-Clause
"""Puts the objects of a text scene into the planning scene: what stands around a robot that is not simulated."""
from __future__ import annotations

import sys
from pathlib import Path

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import CollisionObject, PlanningScene
from moveit_msgs.srv import ApplyPlanningScene, ApplyPlanningSceneRequest
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive

from modular_framework_core.ros_calls import CallError, call_service, wait_for_service
from modular_framework_core.scene_file import SceneFileError, SceneObject, Vector, read_scene_file

START_TIMEOUT_S = 60.0
SERVICE_TIMEOUT_S = 10.0
PRIMITIVES = {"box": SolidPrimitive.BOX, "sphere": SolidPrimitive.SPHERE, "cylinder": SolidPrimitive.CYLINDER,
              "cone": SolidPrimitive.CONE}


def collision_object(thing: SceneObject) -> CollisionObject:
    """Converts an object; without a frame, which stands for the planning frame."""
    message = CollisionObject(id=thing.name, operation=CollisionObject.ADD)
    message.pose = _pose(thing.position, thing.quaternion_xyzw)
    message.subframe_names = [name for name, _, _ in thing.subframes]
    message.subframe_poses = [_pose(position, quaternion) for _, position, quaternion in thing.subframes]
    for shape in thing.shapes:
        pose = _pose(shape.position, shape.quaternion_xyzw)
        match shape.kind:
            case "plane":
                message.planes.append(Plane(coef=list(shape.size)))
                message.plane_poses.append(pose)
            case "mesh":
                message.meshes.append(Mesh([MeshTriangle(list(indices)) for indices in shape.triangles],
                                           [Point(*vertex) for vertex in shape.vertices]))
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


def main() -> int:
    """Runs once: node ``moveit_publish_scene_from_text``; argument: the scene file. Service: ``apply_planning_scene``.

    Returns:
        0 when the planning scene has the objects, 1 when move_group is missing or refuses, 2 when the file is wrong.
    """
    rospy.init_node("moveit_publish_scene_from_text")
    arguments = rospy.myargv(sys.argv)[1:]
    try:
        if len(arguments) != 1:
            raise SceneFileError(f"got the arguments {arguments}, expected one: the path of a scene file")
        objects = read_scene_file(Path(arguments[0]))
    except SceneFileError as error:
        rospy.logfatal("moveit_publish_scene_from_text: %s", error)
        return 2
    scene = PlanningScene(is_diff=True)
    scene.robot_state.is_diff = True
    scene.world.collision_objects = [collision_object(thing) for thing in objects]
    proxy = rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene)
    try:
        wait_for_service(proxy, START_TIMEOUT_S)
        applied = call_service(proxy, ApplyPlanningSceneRequest(scene=scene), SERVICE_TIMEOUT_S).success
    except CallError as error:
        rospy.logfatal("moveit_publish_scene_from_text: %s", error)
        return 1
    if not applied:
        rospy.logfatal("moveit_publish_scene_from_text: service '%s' refused the objects of %s; its node logged the "
                       "reason", proxy.resolved_name, arguments[0])
        return 1
    rospy.loginfo("The planning scene has the %d objects of %s.", len(objects), arguments[0])
    return 0
