# SPDX-License-Identifier: BSD-3-Clause
"""Markers of a robot state: visual shapes of the links at their poses from compute_fk."""

from __future__ import annotations

from collections.abc import Sequence

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from moveit_msgs.msg import MoveItErrorCodes, RobotState
from moveit_msgs.srv import GetPositionFK, GetPositionFKRequest
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker, MarkerArray

from modular_framework_urdf.robot import Box, Cylinder, MeshFile, PlacedShapes, Sphere
from moveit_commander.conversions import list_to_pose
from moveit_commander.exception import MoveItCommanderException
from moveit_commander.object_region import transform_point
from moveit_commander.robot_model import RobotModel
from moveit_commander.servers import Servers

GREY = 0.5


def robot_markers(model: RobotModel, servers: Servers, state: RobotState, links: Sequence[str]) -> MarkerArray:
    """Returns markers of links in the planning frame.

    Args:
        model: Robot model.
        servers: Clients of move_group.
        state: State of the robot.
        links: Names of the links.

    Raises:
        ServerError: The service compute_fk is not available.
        MoveItCommanderException: The service rejects the request.
    """
    shown = [link for link in links if model.visuals.get(link)]
    if not shown:
        return MarkerArray()
    request = GetPositionFKRequest(fk_link_names=shown, robot_state=state)
    request.header.frame_id = model.planning_frame
    response = servers.call("compute_fk", GetPositionFK, request)
    if response.error_code.val != MoveItErrorCodes.SUCCESS:
        raise MoveItCommanderException(
            f"service {servers.resolve('compute_fk')}: no poses of {', '.join(shown)}: code {response.error_code.val}"
        )
    poses = dict(zip(response.fk_link_names, response.pose_stamped, strict=True))
    array = MarkerArray()
    for link in shown:
        for number, visual in enumerate(model.visuals[link]):
            marker = _marker(visual)
            if marker is not None:
                marker.header.frame_id, marker.header.stamp = model.planning_frame, rospy.Time.now()
                marker.ns, marker.id = link, number
                marker.pose = _compose(poses[link].pose, list_to_pose([*visual.origin.xyz, *visual.origin.rpy]))
                array.markers.append(marker)
    return array


def _marker(visual: PlacedShapes) -> Marker | None:
    """Returns the marker of a <visual>, or None for an unsupported shape."""
    marker = Marker(action=Marker.ADD)
    marker.color.r = marker.color.g = marker.color.b = GREY
    marker.color.a = 1.0
    match visual.shapes[0] if visual.shapes else None:
        case MeshFile(uri, scale):
            marker.type, marker.mesh_resource, marker.scale = Marker.MESH_RESOURCE, uri, Vector3(*scale)
            marker.mesh_use_embedded_materials = True
        case Box(size):
            marker.type, marker.scale = Marker.CUBE, Vector3(*size)
        case Cylinder(radius, length):
            marker.type, marker.scale = Marker.CYLINDER, Vector3(2.0 * radius, 2.0 * radius, length)
        case Sphere(radius):
            marker.type, marker.scale = Marker.SPHERE, Vector3(2.0 * radius, 2.0 * radius, 2.0 * radius)
        case _:
            return None
    return marker


def _compose(outer: Pose, inner: Pose) -> Pose:
    """Returns the product of two poses: the inner pose in the parent frame of the outer pose."""
    rotations = (
        Rotation.from_quat([item.orientation.x, item.orientation.y, item.orientation.z, item.orientation.w])
        for item in (outer, inner)
    )
    quaternion = (next(rotations) * next(rotations)).as_quat()
    return Pose(Point(*transform_point(outer, inner.position)), Quaternion(*quaternion.tolist()))
