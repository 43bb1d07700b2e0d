# SPDX-License-Identifier: BSD-3-Clause
"""Planning of MotionSequenceRequest messages, for plan_sequence_path and sequence_move_group."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import rospy
from moveit_msgs.msg import MotionPlanResponse, MotionSequenceResponse, RobotState

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.conversions import state_message, trajectory_message
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.motion_plan_requests import read_request
from modular_framework_planning.plan_statistics import PlanStatistics
from modular_framework_planning.planners.pilz.command_planner import DEFAULT_SAMPLING_TIME_S, CommandPlanner
from modular_framework_planning.planners.pilz.sequence import (
    ItemSpec,
    PlannedItem,
    SequenceJoiner,
    SequencePart,
    checked_radii,
)
from modular_framework_planning.planning_scene.planning_scene import SceneChange


@dataclass(frozen=True, slots=True, eq=False)
class SolvedSequence:
    """Result of planning a sequence.

    Attributes:
        response: Response message.
        parts: Planned parts; empty if planning failed.
        reason: Reason of a failure.
    """

    response: MotionSequenceResponse
    parts: tuple[SequencePart, ...]
    reason: str


def solve_sequence(
    context: MoveGroupContext, message: Any, change: SceneChange, cancelled: Callable[[], bool]
) -> SolvedSequence:
    """Plans all motions of a sequence, or none; failures are returned as code and reason, never raised.

    Args:
        context: Shared parts of the node.
        message: moveit_msgs/MotionSequenceRequest.
        change: Scene change for this plan only.
        cancelled: Returns whether the caller cancelled the request.
    """
    start = time.monotonic()
    response = MotionSequenceResponse()
    runs: list[dict[str, Any]] = []
    details = {"items": len(message.items), "groups": [item.req.group_name for item in message.items], "runs": runs}
    try:
        parts = _plan(context, message.items, change, cancelled, runs)
    except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
        response.error_code.val = context.reporter.failure("sequence", error, **details)
        return SolvedSequence(response, (), str(error))
    response.planning_time = time.monotonic() - start
    response.error_code.val = ErrorCode.SUCCESS
    response.planned_trajectories = [trajectory_message(part.trajectory, context.model) for part in parts]
    if parts:
        response.sequence_start = state_message(parts[0].scene, parts[0].answers[0].start)
        _show(context, parts, response)
    context.reporter.report("sequence", ErrorCode.SUCCESS, "", planning_time_s=response.planning_time, **details)
    return SolvedSequence(response, parts, "planned")


def _plan(
    context: MoveGroupContext,
    items: Sequence[Any],
    change: SceneChange,
    cancelled: Callable[[], bool],
    runs: list[dict[str, Any]],
) -> tuple[SequencePart, ...]:
    """Plans each motion from the end of the previous motion, then joins the motions.

    Raises:
        PlanningError: Planning of an item failed; the reason names the item.
    """
    radii, warnings = checked_radii(
        [ItemSpec(item.req.group_name, item.blend_radius, _has_start(item.req.start_state)) for item in items]
    )
    for text in warnings:
        rospy.logwarn("sequence: %s", text)
    if not items:
        return ()
    context.monitor.wait_for_state()
    scene = change(context.monitor.snapshot())
    planned = []
    for index, (item, radius) in enumerate(zip(items, radii, strict=True)):
        try:
            request = read_request(context, scene, _item_request(context, item.req, index), cancelled)
            planned_motion = context.plan(request)
        except PlanningError as error:
            _append_run(error.statistics, runs)
            raise PlanningError(error.code, f"items[{index}]: {error.reason}") from error
        _append_run(planned_motion.statistics, runs)
        planned.append(PlannedItem(request, planned_motion, radius))
        scene = request.scene.with_positions(planned_motion.goal)
    pipeline = context.pipeline(_pipeline_of(context, items[0].req))
    period = float(pipeline.settings.parameters.get("sampling_time", DEFAULT_SAMPLING_TIME_S))
    return SequenceJoiner(context.kinematics, pipeline.checker, period, pipeline.settings.motion_step).join(planned)


def _append_run(statistics: PlanStatistics | None, runs: list[dict[str, Any]]) -> None:
    if statistics is not None and statistics.run is not None:
        runs.append(asdict(statistics.run))


def _has_start(state: RobotState) -> bool:
    joints = state.joint_state
    return bool(joints.name or joints.position or joints.velocity or joints.effort)


def _item_request(context: MoveGroupContext, request: Any, index: int) -> Any:
    """Returns a copy of the request with its pipeline; only the first item may replace attached objects."""
    request = copy.copy(request)
    request.pipeline_id = _pipeline_of(context, request)
    if index:
        request.start_state = copy.copy(request.start_state)
        request.start_state.is_diff = True
    return request


def _pipeline_of(context: MoveGroupContext, request: Any) -> str:
    """Returns the named pipeline, or for planners PTP, LIN and CIRC the pipeline that offers them."""
    if not request.pipeline_id and request.planner_id in CommandPlanner.planner_ids:
        for name, pipeline in context.pipelines.items():
            if request.planner_id in pipeline.planner_ids:
                return name
    return str(request.pipeline_id)


def _show(context: MoveGroupContext, parts: Sequence[SequencePart], response: MotionSequenceResponse) -> None:
    """Visualizes the longest part."""
    index = max(range(len(parts)), key=lambda item: parts[item].trajectory.duration_s)
    part = parts[index]
    shown = MotionPlanResponse(
        group_name=part.group.name,
        trajectory=response.planned_trajectories[index],
        trajectory_start=state_message(part.scene, part.answers[0].start),
    )
    context.markers.show_path(part.scene, shown, replace(part.answers[0], trajectory=part.trajectory))
