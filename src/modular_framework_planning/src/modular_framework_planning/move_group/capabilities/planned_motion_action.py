# SPDX-License-Identifier: BSD-3-Clause
"""Base class for actions that plan, execute the plan unless plan_only is set, and replan after failures."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from threading import Event
from typing import Any

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.move_group.capabilities.capability import ActionCapability, PublishState
from modular_framework_planning.move_group.goal_runner import error_code_of
from modular_framework_planning.move_group.planning_options import check_options, scene_change
from modular_framework_planning.planning_scene.planning_scene import SceneChange

MIN_REPLAN_DELAY_S = 0.05  # pause between attempts, so that immediate failures do not flood the log
RETRYABLE_CODES = (
    ErrorCode.PLANNING_FAILED,
    ErrorCode.INVALID_MOTION_PLAN,
    ErrorCode.TIMED_OUT,
    ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
)


@dataclass(frozen=True, slots=True, eq=False)
class PlannedMotion:
    """Result of one planning attempt.

    Attributes:
        result: Action result; its code shows whether planning succeeded.
        text: Text for the client.
        execute: Function that executes the plan and may raise PlanningError; None without a plan.
        details: Additional keys for the report of the execution.
    """

    result: Any
    text: str
    execute: Callable[[], None] | None = None
    details: Mapping[str, Any] = field(default_factory=dict)


class PlannedMotionAction(ActionCapability):
    """Supports all planning_options except look_around.

    Attributes:
        report: `kind` of the planning report if the action fails.
    """

    report: str

    def _perform(self, goal: Any, cancelled: Event, publish_state: PublishState) -> tuple[Any, str]:
        options = goal.planning_options
        attempts = self._context.settings.plan_execution.attempts(options)
        result, text = self.kind().action_result.result, ""
        try:
            check_options(options)
            for attempt in range(attempts):
                result, text = self._plan_and_execute(goal, cancelled, publish_state)
                if error_code_of(result).val not in RETRYABLE_CODES or attempt + 1 == attempts:
                    break
                if cancelled.wait(max(options.replan_delay, MIN_REPLAN_DELAY_S)):
                    raise PlanningError(ErrorCode.PREEMPTED, "cancelled before the next attempt")
        except PlanningError as error:
            error_code_of(result).val = self._context.reporter.failure(self.report, error, **self._details(goal))
            text = error.reason
        publish_state("IDLE")
        return result, text

    def _plan_and_execute(self, goal: Any, cancelled: Event, publish_state: PublishState) -> tuple[Any, str]:
        """Plans and executes once; failures are returned as code and reason."""
        executes = not goal.planning_options.plan_only
        change = scene_change(goal.planning_options, executes)
        publish_state("PLANNING")
        planned = self._plan(goal, change, cancelled)
        if not executes or planned.execute is None:
            return planned.result, planned.text
        publish_state("MONITOR")
        try:
            planned.execute()
        except Exception as error:  # noqa: BLE001 - the client must get a code; the reporter logs the error
            code = self._context.reporter.failure("execute", error, **self._details(goal))
            error_code_of(planned.result).val = code
            return planned.result, str(error)
        self._context.reporter.report("execute", ErrorCode.SUCCESS, "", **planned.details)
        return planned.result, "planned and executed"

    @abstractmethod
    def _plan(self, goal: Any, change: SceneChange, cancelled: Event) -> PlannedMotion:
        """Plans once; a failure is returned as code and reason.

        Args:
            goal: Goal message.
            change: Change to the monitored scene that applies to this plan only.
            cancelled: Event that is set when the client cancels the goal.
        """

    def _details(self, _: Any) -> dict[str, Any]:
        """Returns additional keys for the report of a goal's failure."""
        return {}
