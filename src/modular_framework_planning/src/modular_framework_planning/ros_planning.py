# SPDX-License-Identifier: BSD-3-Clause
"""Answers a MotionPlanRequest message: used by the planning service and by the move_group action."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from moveit_msgs.msg import MotionPlanResponse

from modular_framework_planning.conversions import (
    goals_from_constraints,
    refuse_constraints,
    scene_with_state,
    state_message,
    trajectory_message,
)
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.planning_request import PlanningRequest
from modular_framework_planning.planning_scene import PlanningScene
from modular_framework_planning.ros_context import MoveGroupContext

DEFAULT_PLANNING_TIME_S = 5.0


def _core_request(context: MoveGroupContext, scene: PlanningScene, message: Any,
                  cancelled: Callable[[], bool]) -> PlanningRequest:
    """Reads the message; raises PlanningError."""
    group = context.model.group(message.group_name)
    refuse_constraints("path_constraints", message.path_constraints, ErrorCode.PLANNING_FAILED)
    for constraints in message.trajectory_constraints.constraints:
        refuse_constraints("trajectory_constraints", constraints, ErrorCode.PLANNING_FAILED)
    context.pipeline(message.pipeline_id)
    if not np.isfinite(message.allowed_planning_time):
        raise PlanningError(ErrorCode.TIMED_OUT, "allowed_planning_time is not finite")
    scene = scene_with_state(scene, message.start_state, "start_state")
    goals = goals_from_constraints(scene, message.goal_constraints, group.tip_link)
    return PlanningRequest(scene, group.name, goals, message.planner_id, max(1, message.num_planning_attempts),
                           message.allowed_planning_time if message.allowed_planning_time > 0.0
                           else DEFAULT_PLANNING_TIME_S,
                           message.max_velocity_scaling_factor, message.max_acceleration_scaling_factor, cancelled,
                           message.pipeline_id)


def plan(context: MoveGroupContext, message: Any, change: Callable[[PlanningScene], PlanningScene] = lambda s: s,
         cancelled: Callable[[], bool] = lambda: False) -> MotionPlanResponse:
    """Plans and reports; failures come back as a code, never as an exception.

    Args:
        context: parts of the node.
        message: moveit_msgs/MotionPlanRequest.
        change: changes the scene for this plan only.
        cancelled: true when the caller gave up.
    """
    response = MotionPlanResponse(group_name=message.group_name)
    name = message.goal_constraints[0].name if message.goal_constraints else ""
    details: dict[str, Any] = {"group": message.group_name, "planner_id": message.planner_id, "request_name": name,
                               "planning_time_s": 0.0, "start": {}, "goal": {}}
    try:
        if not message.start_state.joint_state.name or message.start_state.is_diff:
            context.monitor.wait_for_state()
        scene = change(context.monitor.snapshot())
        request = _core_request(context, scene, message, cancelled)
        scene = request.scene
        details["start"] = dict(zip(scene.model.joint_names, scene.positions.tolist(), strict=True))
        answer = context.plan(request)
    except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
        response.error_code.val = context.reporter.failure("plan", error, **details)
        return response
    response.trajectory_start = state_message(scene, answer.start)
    response.trajectory = trajectory_message(answer.trajectory, scene.model.planning_frame)
    response.planning_time = answer.total_time_s
    response.error_code.val = ErrorCode.SUCCESS
    details.update(planner_id=answer.planner_id, planning_time_s=answer.total_time_s,
                   goal=dict(zip(scene.model.joint_names, answer.goal.tolist(), strict=True)))
    context.reporter.report("plan", ErrorCode.SUCCESS, "", **details)
    context.markers.show_path(scene, response, answer)
    return response
