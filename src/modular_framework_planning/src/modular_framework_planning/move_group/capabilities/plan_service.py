# SPDX-License-Identifier: BSD-3-Clause
"""Service plan_kinematic_path: plans a motion without executing it."""

from __future__ import annotations

from typing import Any

from moveit_msgs.srv import GetMotionPlan, GetMotionPlanResponse

from modular_framework_planning.errors import PlanningError
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.capability import ServiceCapability
from modular_framework_planning.move_group.motion_plan_requests import plan_and_report


class PlanService(ServiceCapability):
    """Offers plan_kinematic_path (moveit_msgs/GetMotionPlan)."""

    name, kind = names.PLAN_SERVICE, GetMotionPlan

    def _serve(self, request: Any) -> GetMotionPlanResponse:
        message = request.motion_plan_request
        try:
            return GetMotionPlanResponse(plan_and_report(self._context, message, lambda scene: scene, lambda: False))
        except PlanningError as error:
            response = GetMotionPlanResponse()
            response.motion_plan_response.group_name = message.group_name
            response.motion_plan_response.error_code.val = error.code
            return response
