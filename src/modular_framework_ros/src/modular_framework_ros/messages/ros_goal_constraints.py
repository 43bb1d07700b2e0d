# SPDX-License-Identifier: BSD-3-Clause
"""Converts joint and pose goals to the constraints of a planning request."""

from __future__ import annotations

from collections.abc import Mapping

from geometry_msgs.msg import Pose, PoseStamped, Quaternion
from moveit_msgs.msg import Constraints, JointConstraint, OrientationConstraint, PositionConstraint
from shape_msgs.msg import SolidPrimitive


def joint_goal(positions: Mapping[str, float], tolerance: float, name: str = "") -> Constraints:
    """Returns constraints of every joint to its position.

    Args:
        positions: Position of each joint [rad or m].
        tolerance: Tolerance in both directions [rad or m].
        name: Name of the constraints.
    """
    return Constraints(
        name=name,
        joint_constraints=[
            JointConstraint(
                joint_name=joint, position=position, tolerance_above=tolerance, tolerance_below=tolerance, weight=1.0
            )
            for joint, position in positions.items()
        ],
    )


def position_goal(link: str, pose: PoseStamped, tolerance_m: float) -> PositionConstraint:
    """Returns the constraint of a link's origin to a sphere around a position.

    Args:
        link: Name of the link.
        pose: Pose whose position is the centre of the sphere.
        tolerance_m: Radius of the sphere [m].
    """
    constraint = PositionConstraint(header=pose.header, link_name=link, weight=1.0)
    constraint.constraint_region.primitives = [SolidPrimitive(SolidPrimitive.SPHERE, [tolerance_m])]
    constraint.constraint_region.primitive_poses = [Pose(pose.pose.position, Quaternion(0.0, 0.0, 0.0, 1.0))]
    return constraint


def orientation_goal(link: str, pose: PoseStamped, tolerance_rad: float) -> OrientationConstraint:
    """Returns the constraint of a link's orientation.

    Args:
        link: Name of the link.
        pose: Pose with the target orientation.
        tolerance_rad: Tolerance about each axis [rad].
    """
    return OrientationConstraint(
        header=pose.header,
        orientation=pose.pose.orientation,
        link_name=link,
        weight=1.0,
        absolute_x_axis_tolerance=tolerance_rad,
        absolute_y_axis_tolerance=tolerance_rad,
        absolute_z_axis_tolerance=tolerance_rad,
    )
