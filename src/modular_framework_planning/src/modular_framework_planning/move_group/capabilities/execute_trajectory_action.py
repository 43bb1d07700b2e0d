# SPDX-License-Identifier: BSD-3-Clause
"""Action execute_trajectory: sends a planned motion to the controllers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from moveit_msgs.msg import ExecuteTrajectoryAction, ExecuteTrajectoryFeedback, ExecuteTrajectoryResult

from modular_framework_planning.errors import ErrorCode
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.goal_runner import GoalRunner


class ExecuteTrajectory:
    """Offers execute_trajectory (moveit_msgs/ExecuteTrajectory)."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context
        self._runner = GoalRunner(names.EXECUTE_ACTION, ExecuteTrajectoryAction, self._work)

    def connect(self) -> None:
        """Starts the action server."""
        self._runner.connect()

    def _work(
        self, goal: Any, cancelled: threading.Event, feedback: Callable[[Any], None]
    ) -> tuple[ExecuteTrajectoryResult, bool, str]:
        result = ExecuteTrajectoryResult()
        feedback(ExecuteTrajectoryFeedback("MONITOR"))
        joints = list(goal.trajectory.joint_trajectory.joint_names)
        try:
            self._context.execution.execute(goal.trajectory, cancelled)
        except Exception as error:  # noqa: BLE001 - the client must get a code; the reporter logs the error
            result.error_code.val = self._context.reporter.failure("execute", error, joints=joints)
            return result, False, str(error)
        result.error_code.val = ErrorCode.SUCCESS
        self._context.reporter.report("execute", ErrorCode.SUCCESS, "", joints=joints)
        feedback(ExecuteTrajectoryFeedback("IDLE"))
        return result, True, "motion executed"
