# SPDX-License-Identifier: BSD-3-Clause
"""Reads the held object and its support from the planning scene, and makes the locations of a place goal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Vector3, Vector3Stamped
from moveit_msgs.msg import CollisionObject, GripperTranslation, PlaceLocation, PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene, GetPlanningSceneRequest
from scipy.spatial.transform import Rotation
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_core.grasp_generation.object_names import is_named
from modular_framework_core.grasp_generation.planning_scene_objects import rotation_matrix, scene_object
from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_ros.calls import request_service
from modular_framework_states.grasp_stages import stage_pose
from modular_framework_states.link_poses import link_poses
from modular_framework_states.place_poses import Array, PlaceError, PlacePose
from modular_framework_urdf.mesh_reader import TriangleMesh

SERVICE_TIMEOUT_S = 10.0
APPROACH_M, MIN_APPROACH_M = 0.1, 0.03
MIN_RETREAT = 0.5
"""Minimum fraction of the path back to the pregrasp pose."""
MAX_LOCATIONS = 72
"""Maximum number of locations, as many as a stable pose has. Locations share the planning time, which would be too
short for each of the many poses in which a cylinder lies."""
COMPONENTS = PlanningSceneComponents(
    PlanningSceneComponents.WORLD_OBJECT_NAMES
    | PlanningSceneComponents.WORLD_OBJECT_GEOMETRY
    | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceScene:
    """The held object, its support and its grasp.

    Attributes:
        frame: Planning frame.
        held: Planning scene id of the held object.
        solids: Parts of the held object in its frame.
        orientation: Orientation of the held object in the planning frame when the hand was at the grasp pose.
        support: Planning scene id of the support.
        support_solids: Parts of the support in the planning frame.
        tip_link: Link whose pose a grasp gives.
        retreat: Translation from the grasp pose to the pregrasp pose in the frame of the tip link, shape (3,) [m].
    """

    frame: str
    held: str
    solids: Sequence[TriangleMesh]
    orientation: Rotation
    support: str
    support_solids: Sequence[TriangleMesh]
    tip_link: str
    retreat: Array


def read_place_scene(commander: Any, grasp: Any, support: str) -> PlaceScene:
    """Reads the planning scene.

    Args:
        commander: Arm commander.
        grasp: modular_framework_core/StandardisedGrasp that holds the object.
        support: Model or planning scene id of the support.

    Raises:
        CallError: move_group does not answer.
        PlaceError: No object or another object is held, or the support does not exist.
        SceneObjectError: A shape is invalid.
        StageError: The grasp has no poses.
    """
    request = GetPlanningSceneRequest(components=COMPONENTS)
    scene = request_service("get_planning_scene", GetPlanningScene, request, SERVICE_TIMEOUT_S).scene
    held = [item for item in scene.robot_state.attached_collision_objects if is_named(item.object.id, grasp.object_id)]
    if len(held) != 1:
        attached_names = [item.object.id for item in scene.robot_state.attached_collision_objects]
        expected = f"'{grasp.object_id}'" if grasp.object_id else "one object"
        raise PlaceError(f"the hand should hold {expected}; attached objects: {', '.join(attached_names) or 'none'}")
    support_object = _only_object(support, scene.world.collision_objects)
    tip_link, item = commander.group.tip_link, held[0].object
    tip, carrier = link_poses(commander, (tip_link, item.header.frame_id), SERVICE_TIMEOUT_S)
    in_tip = _rotation(tip.pose).inv() * _rotation(carrier.pose) * _rotation(item.pose)
    grasped, before = (stage_pose(grasp, stage).pose for stage in ("grasp", "pregrasp"))
    return PlaceScene(
        frame=tip.header.frame_id,
        held=item.id,
        solids=_solids(item, in_own_frame=True),
        orientation=_rotation(grasped) * in_tip,
        support=support_object.id,
        support_solids=_solids(support_object),
        tip_link=tip_link,
        retreat=_rotation(grasped).inv().apply(_position(before) - _position(grasped)),
    )


def _only_object(support: str, objects: Sequence[CollisionObject]) -> CollisionObject:
    matches = [item for item in objects if is_named(item.id, support)]
    if len(matches) != 1:
        known_ids = sorted(item.id for item in objects)
        raise PlaceError(
            f"{len(matches)} objects of the planning scene are named '{support}'; {listing(known_ids)}"
            f"{nearest(support, known_ids)}"
        )
    return matches[0]


def _rotation(pose: Any) -> Rotation:
    return Rotation.from_matrix(rotation_matrix(pose.orientation))


def _position(pose: Any) -> Array:
    return np.array([pose.position.x, pose.position.y, pose.position.z])


def _solids(message: CollisionObject, in_own_frame: bool = False) -> Sequence[TriangleMesh]:
    """Returns the parts of an object in the planning frame, or in its own frame."""
    if in_own_frame:
        message = CollisionObject(
            id=message.id,
            primitives=message.primitives,
            primitive_poses=message.primitive_poses,
            meshes=message.meshes,
            mesh_poses=message.mesh_poses,
        )
    converted = scene_object(message)
    if converted is None:
        raise PlaceError(f"'{message.id}' has no solid part; allowed: boxes, spheres, cylinders, cones and meshes")
    return converted.solids


def place_locations(scene: PlaceScene, poses: Sequence[PlacePose], fingers: Mapping[str, float]) -> list[PlaceLocation]:
    """Returns the locations of a place goal, the best first, at most `MAX_LOCATIONS`.

    Args:
        scene: Scene of the place.
        poses: Poses of the object, the best first.
        fingers: Finger positions after the release, by joint name [rad or m].
    """
    opened = JointTrajectory(joint_names=list(fingers), points=[JointTrajectoryPoint(positions=list(fingers.values()))])
    length = float(np.linalg.norm(scene.retreat))
    return [
        PlaceLocation(
            id=f"place {index}",
            quality=-float(index),
            place_pose=_pose_message(scene.frame, pose),
            pre_place_approach=_translation(scene.frame, (0.0, 0.0, -1.0), APPROACH_M, MIN_APPROACH_M),
            post_place_retreat=_translation(scene.tip_link, scene.retreat, length, MIN_RETREAT * length),
            post_place_posture=opened,
        )
        for index, pose in enumerate(poses[:MAX_LOCATIONS])
    ]


def _pose_message(frame: str, pose: PlacePose) -> PoseStamped:
    message = PoseStamped(header=Header(frame_id=frame))
    message.pose.position, message.pose.orientation = Point(*pose.position), Quaternion(*pose.rotation.as_quat())
    return message


def _translation(frame: str, direction: Any, desired_m: float, least_m: float) -> GripperTranslation:
    vector = Vector3Stamped(Header(frame_id=frame), Vector3(*direction))
    return GripperTranslation(vector, desired_m, least_m)
