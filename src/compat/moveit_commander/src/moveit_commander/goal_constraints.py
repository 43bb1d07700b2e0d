# SPDX-License-Identifier: BSD-3-Clause
"""Writes a goal of joints or of a pose as the constraints a planning request carries."""

from __future__ import annotations

from collections.abc import Mapping

from geometry_msgs.msg import Pose, PoseStamped, Quaternion
from moveit_msgs.msg import Constraints, JointConstraint, OrientationConstraint, PositionConstraint
from shape_msgs.msg import SolidPrimitive


def joint_goal(positions: Mapping[str, float], tolerance: float) -> Constraints:
    """Constrains every joint at its position within a tolerance [rad or m]."""
    return Constraints(
        joint_constraints=[
            JointConstraint(
                joint_name=name, position=position, tolerance_above=tolerance, tolerance_below=tolerance, weight=1.0
            )
            for name, position in positions.items()
        ]
    )


def position_goal(link: str, pose: PoseStamped, tolerance_m: float) -> PositionConstraint:
    """Constrains the link's origin within a sphere about the pose's position."""
    constraint = PositionConstraint(header=pose.header, link_name=link, weight=1.0)
    constraint.constraint_region.primitives = [SolidPrimitive(SolidPrimitive.SPHERE, [tolerance_m])]
    constraint.constraint_region.primitive_poses = [Pose(pose.pose.position, Quaternion(0.0, 0.0, 0.0, 1.0))]
    return constraint


def orientation_goal(link: str, pose: PoseStamped, tolerance_rad: float) -> OrientationConstraint:
    """Constrains the orientation of the link to that of the pose within a tolerance about each axis."""
    return OrientationConstraint(
        header=pose.header,
        orientation=pose.pose.orientation,
        link_name=link,
        weight=1.0,
        absolute_x_axis_tolerance=tolerance_rad,
        absolute_y_axis_tolerance=tolerance_rad,
        absolute_z_axis_tolerance=tolerance_rad,
    )
