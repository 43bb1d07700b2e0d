# SPDX-License-Identifier: BSD-3-Clause
"""Service plan_kinematic_path: plans a motion without moving."""

from __future__ import annotations

import rospy
from moveit_msgs.srv import GetMotionPlan, GetMotionPlanResponse

from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.motion_plan_requests import plan


class PlanService:
    """Offers plan_kinematic_path (moveit_msgs/GetMotionPlan)."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context

    def connect(self) -> None:
        """Advertises the service."""
        rospy.Service(names.PLAN_SERVICE, GetMotionPlan, self._serve)

    def _serve(self, request: object) -> GetMotionPlanResponse:
        return GetMotionPlanResponse(plan(self._context, request.motion_plan_request))  # type: ignore[attr-defined]
