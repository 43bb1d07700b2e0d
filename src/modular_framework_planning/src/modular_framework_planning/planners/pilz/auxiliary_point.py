# SPDX-License-Identifier: BSD-3-Clause
"""Auxiliary point of a CIRC motion, which clients of Pilz's planner pass in the path_constraints of a request."""

from __future__ import annotations

from typing import Any

import numpy as np

from modular_framework_planning.constraints.robot_frames import require_holding_link
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.planning_interface.planning_request import AuxiliaryPoint
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

CENTRE, INTERIM = "center", "interim"


def auxiliary_point(scene: PlanningScene, constraints: Any, source_name: str = "path_constraints") -> AuxiliaryPoint:
    """Returns the auxiliary point in the planning frame.

    Args:
        scene: Planning scene with the frame poses.
        constraints: moveit_msgs/Constraints named "center" or "interim", with one position constraint whose region
            has one pose; shapes and orientation are ignored.
        source_name: Name of the message field in error messages.

    Raises:
        PlanningError: The name is unknown, the number of points is not 1, the point is not finite, or its frame or
            link does not exist.
    """
    poses = [
        pose
        for item in constraints.position_constraints
        for pose in (*item.constraint_region.primitive_poses, *item.constraint_region.mesh_poses)
    ]
    if constraints.name not in (CENTRE, INTERIM) or len(constraints.position_constraints) != 1 or len(poses) != 1:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"{source_name}: name '{constraints.name}' with "
            f"{len(constraints.position_constraints)} position constraints and {len(poses)} poses; "
            f"CIRC needs the name '{CENTRE}' or '{INTERIM}' and one position constraint whose region "
            "has one pose: the auxiliary point",
        )
    item = constraints.position_constraints[0]
    if item.link_name:
        require_holding_link(scene, item.link_name, f"{source_name}: link")
    point = np.array([poses[0].position.x, poses[0].position.y, poses[0].position.z], dtype=float)
    if not np.isfinite(point).all():
        raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"{source_name}: the point {point.tolist()} is not finite")
    return AuxiliaryPoint(constraints.name, scene.frame_transform(item.header.frame_id).act(point))
