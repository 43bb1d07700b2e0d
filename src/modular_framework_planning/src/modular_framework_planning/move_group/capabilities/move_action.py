# SPDX-License-Identifier: BSD-3-Clause
"""Action move_group: plans a motion and, unless plan_only is set, executes it, with optional replanning."""

from __future__ import annotations

from threading import Event
from typing import Any

from moveit_msgs.msg import MoveGroupAction, MoveGroupResult

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.planned_motion_action import PlannedMotion, PlannedMotionAction
from modular_framework_planning.move_group.motion_plan_requests import plan_and_report
from modular_framework_planning.move_group.motion_watch import WatchedMotion
from modular_framework_planning.move_group.planning_options import with_current_start
from modular_framework_planning.planning_scene.planning_scene import SceneChange


class MoveAction(PlannedMotionAction):
    """Offers move_group (moveit_msgs/MoveGroup); a new goal cancels goals of groups that share joints with it."""

    name, kind, report = names.MOVE_ACTION, MoveGroupAction, "plan"

    def _resources(self, goal: Any) -> frozenset[str] | None:
        group = self._context.model.groups.get(goal.request.group_name)
        return frozenset(group.joints) if group else frozenset()

    def _plan(self, goal: Any, change: SceneChange, cancelled: Event) -> PlannedMotion:
        request = goal.request if goal.planning_options.plan_only else with_current_start(goal.request, "request")
        planned_in = self._context.monitor.snapshot()
        result = MoveGroupResult()
        try:
            response = plan_and_report(self._context, request, change, cancelled.is_set)
        except PlanningError as error:
            result.error_code.val = int(error.code)
            return PlannedMotion(result, error.reason)
        if cancelled.is_set():  # an anytime planner returns a path even after cancellation
            result.error_code.val = ErrorCode.PREEMPTED
            return PlannedMotion(result, "cancelled while planning")
        result = MoveGroupResult(
            error_code=response.error_code,
            trajectory_start=response.trajectory_start,
            planned_trajectory=response.trajectory,
            planning_time=response.planning_time,
        )

        def execute() -> None:
            motion = WatchedMotion(self._context, response.trajectory, planned_in, change)
            try:
                motion.execute(cancelled)
            finally:
                result.executed_trajectory = motion.executed

        return PlannedMotion(result, "planned", execute, self._details(goal))

    def _details(self, goal: Any) -> dict[str, Any]:
        return {"group": goal.request.group_name}
