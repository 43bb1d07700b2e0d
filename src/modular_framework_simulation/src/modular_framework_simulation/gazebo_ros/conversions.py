# SPDX-License-Identifier: BSD-3-Clause
"""Converts this package's values to and from ROS messages."""

from __future__ import annotations

import math
from collections.abc import Sequence

from geometry_msgs.msg import Point, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMsg
from geometry_msgs.msg import Twist as TwistMsg
from moveit_msgs.msg import CollisionObject
from shape_msgs.msg import Mesh as MeshMsg
from shape_msgs.msg import MeshTriangle, SolidPrimitive
from shape_msgs.msg import Plane as PlaneMsg

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import load_mesh
from modular_framework_simulation.models.poses import Pose, normalised_quaternion
from modular_framework_simulation.physics.simulated_body import BodyState, Twist
from modular_framework_urdf.lengths import MAX_LENGTH_M
from modular_framework_urdf.mesh_reader import TriangleMesh

MAX_COORDINATE_M = MAX_LENGTH_M
MAX_VELOCITY = 1e3
"""Maximum velocities in requests, up to which the physics engine is stable [m/s, rad/s]."""
MAX_FORCE = 1e5
"""Maximum forces and torques in requests [N, Nm]; larger values make a small object unstable within one step."""
MAX_MASS = 1e6
"""Maximum masses and inertias in requests [kg, kg m^2]."""


def pose_to_msg(pose: Pose) -> PoseMsg:
    """Returns a geometry_msgs/Pose."""
    return PoseMsg(Point(*pose.position), Quaternion(*pose.quaternion))


def pose_from_msg(message: PoseMsg) -> Pose:
    """Returns the pose of a message; an orientation with four zeros is the identity.

    Raises:
        ValueError: A number is not finite or too large, or the quaternion is far from unit length.
    """
    p, q = message.position, message.orientation
    position = (p.x, p.y, p.z)
    check_numbers(position, "position", MAX_COORDINATE_M, "m")
    return Pose(position, normalised_quaternion((q.x, q.y, q.z, q.w)))


def vector_from_msg(message: Vector3 | Point, noun: str, bound: float, unit: str) -> tuple[float, float, float]:
    """Returns the numbers of a vector or point.

    Args:
        message: The vector or point.
        noun: Name of the value for the error message.
        bound: Maximum magnitude of each number.
        unit: Unit of the numbers for the error message.

    Raises:
        ValueError: A number is not finite or too large.
    """
    values = (message.x, message.y, message.z)
    check_numbers(values, noun, bound, unit)
    return values


def check_numbers(values: Sequence[float], noun: str, bound: float, unit: str) -> None:
    """Checks that numbers are finite and within a bound.

    Args:
        values: The numbers.
        noun: Name of the value for the error message.
        bound: Maximum magnitude of each number.
        unit: Unit of the numbers for the error message.

    Raises:
        ValueError: A number is not finite or too large.
    """
    if not all(math.isfinite(value) and abs(value) <= bound for value in values):
        raise ValueError(f"{noun} {list(values)} is not allowed; give finite numbers of at most {bound:g} {unit}")


def twist_to_msg(twist: Twist) -> TwistMsg:
    """Returns a geometry_msgs/Twist."""
    return TwistMsg(Vector3(*twist.linear), Vector3(*twist.angular))


def twist_from_msg(message: TwistMsg) -> Twist:
    """Returns the twist of a message.

    Raises:
        ValueError: A number is not finite or too large.
    """
    linear = (message.linear.x, message.linear.y, message.linear.z)
    angular = (message.angular.x, message.angular.y, message.angular.z)
    check_numbers(linear, "linear velocity", MAX_VELOCITY, "m/s")
    check_numbers(angular, "angular velocity", MAX_VELOCITY, "rad/s")
    return Twist(linear, angular)


def state_from_msgs(pose: PoseMsg, twist: TwistMsg) -> BodyState:
    """Returns the state in a pose message and a twist message.

    Raises:
        ValueError: A number is not finite or too large, or the quaternion is far from unit length.
    """
    return BodyState(pose_from_msg(pose), twist_from_msg(twist))


def link_to_collision_object(model: str, link: specs.Link, frame: str, pose: Pose) -> CollisionObject:
    """Returns the exact collision shapes of a link, with the triangles of meshes and with primitives.

    Args:
        model: Name of the model in the world.
        link: The link.
        frame: Reference frame of the pose.
        pose: Pose of the link in the reference frame.

    Raises:
        DescriptionError: A mesh cannot be read any more.
    """
    message = CollisionObject()
    message.header.frame_id = frame
    message.id = specs.collision_object_id(model, link.name)
    message.operation = CollisionObject.ADD
    message.pose = pose_to_msg(pose)
    for collision in link.collisions:
        shape_pose = pose_to_msg(collision.pose)
        match collision.geometry:
            case specs.Box(size=size):
                message.primitives.append(SolidPrimitive(SolidPrimitive.BOX, list(size)))
                message.primitive_poses.append(shape_pose)
            case specs.Cylinder(radius=radius, length=length):
                message.primitives.append(SolidPrimitive(SolidPrimitive.CYLINDER, [length, radius]))
                message.primitive_poses.append(shape_pose)
            case specs.Sphere(radius=radius):
                message.primitives.append(SolidPrimitive(SolidPrimitive.SPHERE, [radius]))
                message.primitive_poses.append(shape_pose)
            case specs.Plane(normal=(x, y, z)):
                message.planes.append(PlaneMsg([x, y, z, 0.0]))
                message.plane_poses.append(shape_pose)
            case specs.Mesh() as mesh:
                message.meshes.append(mesh_to_msg(load_mesh(mesh)))
                message.mesh_poses.append(shape_pose)
    return message


def mesh_to_msg(mesh: TriangleMesh) -> MeshMsg:
    """Returns a shape_msgs/Mesh."""
    return MeshMsg(
        [MeshTriangle([int(a), int(b), int(c)]) for a, b, c in mesh.triangles],
        [Point(float(x), float(y), float(z)) for x, y, z in mesh.vertices],
    )
