# SPDX-License-Identifier: BSD-3-Clause
"""Planning of MotionPlanRequest messages, for the planning service and the move_group action."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from moveit_msgs.msg import MotionPlanResponse

from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.constraint_conversions import constraints_from_message
from modular_framework_planning.messages.conversions import (
    goals_from_constraints,
    refuse_constraints,
    scene_with_state,
    state_message,
    trajectory_message,
)
from modular_framework_planning.messages.multi_dof import names_joints
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.planners.pilz.auxiliary_point import auxiliary_point
from modular_framework_planning.planning_interface.planning_request import AuxiliaryPoint, PlanningRequest, Workspace
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, SceneChange

DEFAULT_PLANNING_TIME_S = 5.0


def read_request(
    context: MoveGroupContext, scene: PlanningScene, message: Any, cancelled: Callable[[], bool]
) -> PlanningRequest:
    """Reads a moveit_msgs/MotionPlanRequest.

    Args:
        context: Shared parts of the node.
        scene: Planning scene with the current state, which the request's start state replaces.
        message: Request message.
        cancelled: Returns whether the caller cancelled the request.

    Raises:
        PlanningError: A name is unknown, or a value is missing, not finite or not supported.
    """
    group = context.model.group(message.group_name)
    pipeline = context.pipeline(message.pipeline_id)
    for constraints in message.trajectory_constraints.constraints:
        refuse_constraints("trajectory_constraints", constraints, ErrorCode.PLANNING_FAILED)
    if not np.isfinite([message.allowed_planning_time, message.max_cartesian_speed]).all():
        raise PlanningError(
            ErrorCode.TIMED_OUT,
            f"allowed_planning_time is {message.allowed_planning_time}, "
            f"max_cartesian_speed is {message.max_cartesian_speed}; both must be finite",
        )
    scene = scene_with_state(scene, message.start_state, "start_state")
    state = message.start_state.joint_state
    constraints, point = _path_constraints(pipeline, scene, message, group.tip_link)
    return PlanningRequest(
        scene,
        group.name,
        goals_from_constraints(scene, message.goal_constraints, group.tip_link),
        planner_id=message.planner_id,
        attempts=max(1, message.num_planning_attempts),
        allowed_time_s=message.allowed_planning_time
        if message.allowed_planning_time > 0.0
        else DEFAULT_PLANNING_TIME_S,
        velocity_scaling=message.max_velocity_scaling_factor,
        acceleration_scaling=message.max_acceleration_scaling_factor,
        cancelled=cancelled,
        pipeline_id=message.pipeline_id,
        path_constraints=constraints,
        auxiliary_point=point,
        start_velocities=dict(zip(state.name, state.velocity, strict=False)),
        max_cartesian_speed=message.max_cartesian_speed,
        cartesian_speed_limited_link=message.cartesian_speed_limited_link,
        workspace=_workspace(scene, message.workspace_parameters),
    )


def _path_constraints(
    pipeline: PlanningPipeline, scene: PlanningScene, message: Any, tip: str
) -> tuple[KinematicConstraints | None, AuxiliaryPoint | None]:
    """Returns the path constraints, or the auxiliary point (of CIRC) given in the same field of the message."""
    path_constraints = message.path_constraints
    if path_constraints.name and path_constraints.name in pipeline.auxiliary_constraints:
        return None, auxiliary_point(scene, path_constraints)
    constraints = constraints_from_message(scene, path_constraints, "path_constraints", ErrorCode.PLANNING_FAILED, tip)
    return (None if constraints.is_empty else constraints), None


def _workspace(scene: PlanningScene, message: Any) -> Workspace | None:
    """Reads the workspace; None if the request has no workspace."""
    low, high = (np.array([vector.x, vector.y, vector.z]) for vector in (message.min_corner, message.max_corner))
    if not low.any() and not high.any():
        return None
    if not (np.isfinite(low).all() and np.isfinite(high).all() and (low <= high).all()):
        raise PlanningError(
            ErrorCode.PLANNING_FAILED,
            f"workspace_parameters: min_corner {low.tolist()}, max_corner "
            f"{high.tolist()}; both must be finite, and min_corner must not exceed max_corner",
        )
    frame = scene.frame_transform(message.header.frame_id)
    corners = np.array(
        [
            frame.act(np.array([x, y, z]))
            for x in (low[0], high[0])
            for y in (low[1], high[1])
            for z in (low[2], high[2])
        ]
    )
    return Workspace(corners.min(axis=0), corners.max(axis=0))


def plan_and_report(
    context: MoveGroupContext, message: Any, change: SceneChange, cancelled: Callable[[], bool]
) -> MotionPlanResponse:
    """Plans, reports and visualizes a motion; holds simulated time meanwhile if possible.

    Args:
        context: Shared parts of the node.
        message: moveit_msgs/MotionPlanRequest.
        change: Scene change for this plan only.
        cancelled: Returns whether the caller cancelled the request.

    Raises:
        PlanningError: Planning failed; the error is already reported.
    """
    name, start_s = message.goal_constraints[0].name if message.goal_constraints else "", time.monotonic()
    details: dict[str, Any] = {
        "group": message.group_name,
        "planner_id": message.planner_id,
        "request_name": name,
        "planning_time_s": 0.0,
        "start": {},
        "goal": {},
    }
    context.reporter.request(message)
    try:
        with context.monitor.time.held("planning", during_motions=True):
            if not names_joints(message.start_state) or message.start_state.is_diff:
                context.monitor.wait_for_state()
            request = read_request(context, change(context.monitor.snapshot()), message, cancelled)
            scene = request.scene
            details["start"] = dict(zip(scene.model.joint_names, scene.positions.tolist(), strict=True))
            start_s = time.monotonic()
            planned = context.plan(request)
    except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
        details["planning_time_s"] = time.monotonic() - start_s
        code = context.reporter.failure("plan", error, **details)
        if isinstance(error, PlanningError):
            context.markers.show_contacts(error.contacts)
            raise
        raise PlanningError(ErrorCode(code), f"planning failed: {type(error).__name__}: {error}") from error
    response = MotionPlanResponse(group_name=message.group_name)
    response.trajectory_start = state_message(scene, planned.start)
    response.trajectory = trajectory_message(planned.trajectory, scene.model)
    response.planning_time = planned.total_time_s
    response.error_code.val = ErrorCode.SUCCESS
    details.update(
        planner_id=planned.planner_id,
        planning_time_s=planned.total_time_s,
        **planned.statistics.as_json(),
        goal=dict(zip(scene.model.joint_names, planned.goal.tolist(), strict=True)),
    )
    context.reporter.report("plan", ErrorCode.SUCCESS, "", **details)
    context.markers.show_contacts(())
    context.markers.show_path(scene, response, planned)
    return response
