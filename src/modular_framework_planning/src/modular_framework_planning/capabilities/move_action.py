# SPDX-License-Identifier: BSD-3-Clause
"""Action move_group: plans and, unless told otherwise, executes."""
from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from moveit_msgs.msg import MoveGroupAction, MoveGroupFeedback, MoveGroupResult

from modular_framework_planning import capability_names as names
from modular_framework_planning.errors import ErrorCode
from modular_framework_planning.planning_scene import PlanningScene
from modular_framework_planning.ros_context import MoveGroupContext
from modular_framework_planning.ros_goal_runner import GoalRunner
from modular_framework_planning.ros_planning import plan
from modular_framework_planning.scene_messages import apply_scene


class MoveAction:
    """Offers move_group (moveit_msgs/MoveGroup); planning_options: plan_only, replan, planning_scene_diff."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context
        self._runner = GoalRunner(names.MOVE_ACTION, MoveGroupAction, self._work)

    def connect(self) -> None:
        """Starts the action server."""
        self._runner.connect()

    def _work(self, goal: Any, cancelled: threading.Event,
              feedback: Callable[[Any], None]) -> tuple[MoveGroupResult, bool, str]:
        options = goal.planning_options
        attempts = 1 + (max(0, options.replan_attempts) if options.replan and not options.plan_only else 0)
        result, text = MoveGroupResult(), ""
        for _ in range(attempts):
            result, text = self._once(goal, cancelled, feedback)
            if result.error_code.val == ErrorCode.SUCCESS or cancelled.is_set():
                break
        feedback(MoveGroupFeedback("IDLE"))
        return result, result.error_code.val == ErrorCode.SUCCESS, text

    def _once(self, goal: Any, cancelled: threading.Event,
              feedback: Callable[[Any], None]) -> tuple[MoveGroupResult, str]:
        options = goal.planning_options

        def changed(scene: PlanningScene) -> PlanningScene:
            diff = options.planning_scene_diff
            return apply_scene(scene, diff) if diff.is_diff else scene

        feedback(MoveGroupFeedback("PLANNING"))
        response = plan(self._context, goal.request, changed, cancelled.is_set)
        result = MoveGroupResult(error_code=response.error_code, trajectory_start=response.trajectory_start,
                                 planned_trajectory=response.trajectory, planning_time=response.planning_time)
        if response.error_code.val != ErrorCode.SUCCESS:
            return result, "planning failed; see the log and planning_report"
        if options.plan_only:
            return result, "planned"
        feedback(MoveGroupFeedback("MONITOR"))
        try:
            self._context.execution.execute(response.trajectory, cancelled)
        except Exception as error:  # noqa: BLE001 - the client must get a code; the reporter logs the error
            result.error_code.val = self._context.reporter.failure("execute", error, group=goal.request.group_name)
            return result, str(error)
        result.executed_trajectory = response.trajectory
        self._context.reporter.report("execute", ErrorCode.SUCCESS, "", group=goal.request.group_name)
        return result, "planned and executed"
