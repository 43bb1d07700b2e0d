# SPDX-License-Identifier: BSD-3-Clause
"""Action sequence_move_group: plans a sequence of motions together and, unless plan_only is set, executes it."""

from __future__ import annotations

import copy
import threading
from collections.abc import Callable
from typing import Any

import rospy
from moveit_msgs.msg import (
    MotionSequenceRequest,
    MoveGroupSequenceAction,
    MoveGroupSequenceFeedback,
    MoveGroupSequenceResult,
    RobotState,
)

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.move_action import (
    WORTH_ANOTHER_TRY,
    check_options,
    scene_change,
)
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.goal_runner import GoalRunner
from modular_framework_planning.move_group.motion_sequences import SolvedSequence, solve_sequence
from modular_framework_planning.move_group.motion_watch import WatchedMotion
from modular_framework_planning.planning_scene.planning_scene import PlanningScene


class SequenceAction:
    """Offers sequence_move_group (moveit_msgs/MoveGroupSequence); the motions run even if the robot is at the goal."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context
        self._runner = GoalRunner(names.SEQUENCE_ACTION, MoveGroupSequenceAction, self._work)

    def connect(self) -> None:
        """Starts the action server."""
        self._runner.connect()

    def _work(
        self, goal: Any, cancelled: threading.Event, feedback: Callable[[Any], None]
    ) -> tuple[MoveGroupSequenceResult, bool, str]:
        options = goal.planning_options
        attempts = self._context.settings.plan_execution.attempts(options)
        result, text = MoveGroupSequenceResult(), ""
        try:
            check_options(options)
            for number in range(attempts):
                result, text = self._once(goal, cancelled, feedback)
                if result.response.error_code.val not in WORTH_ANOTHER_TRY or number + 1 == attempts:
                    break
                if cancelled.wait(options.replan_delay):
                    raise PlanningError(ErrorCode.PREEMPTED, "cancelled before the next attempt")
        except PlanningError as error:
            result.response.error_code.val = self._context.reporter.failure("sequence", error)
            text = error.reason
        feedback(MoveGroupSequenceFeedback("IDLE"))
        return result, result.response.error_code.val == ErrorCode.SUCCESS, text

    def _once(
        self, goal: Any, cancelled: threading.Event, feedback: Callable[[Any], None]
    ) -> tuple[MoveGroupSequenceResult, str]:
        """Plans once and executes once; failures come back as a code with their reason."""
        moves = not goal.planning_options.plan_only
        request = _from_here(goal.request) if moves else goal.request
        change = scene_change(goal.planning_options, moves)
        feedback(MoveGroupSequenceFeedback("PLANNING"))
        planned_in = self._context.monitor.snapshot()
        solved = solve_sequence(self._context, request, change, cancelled.is_set)
        result = MoveGroupSequenceResult(solved.response)
        if not moves or not solved.parts:
            return result, solved.reason
        feedback(MoveGroupSequenceFeedback("MONITOR"))
        try:
            self._execute(solved, planned_in, change, cancelled)
        except Exception as error:  # noqa: BLE001 - the client must get a code; the reporter logs the error
            result.response.error_code.val = self._context.reporter.failure("execute", error)
            return result, str(error)
        self._context.reporter.report("execute", ErrorCode.SUCCESS, "", parts=len(solved.parts))
        return result, "planned and executed"

    def _execute(
        self,
        solved: SolvedSequence,
        planned_in: PlanningScene,
        change: Callable[[PlanningScene], PlanningScene],
        cancelled: threading.Event,
    ) -> None:
        """Runs one part after the other; raises PlanningError."""
        for part, trajectory in zip(solved.parts, solved.response.planned_trajectories, strict=True):
            if cancelled.is_set():
                raise PlanningError(ErrorCode.PREEMPTED, "cancelled between two parts of the sequence")
            scene = planned_in.with_positions(part.answers[0].start)
            WatchedMotion(self._context, trajectory, scene, change).execute(cancelled)


def _from_here(request: Any) -> MotionSequenceRequest:
    """Returns the sequence without start states: only from the current state it can be executed."""
    items = []
    for item in request.items:
        start = item.req.start_state
        item = copy.copy(item)
        item.req = copy.copy(item.req)
        item.req.start_state = RobotState(is_diff=True)
        if start.joint_state.name or start.attached_collision_objects:
            rospy.logwarn("start_state of a sequence is ignored: a motion to execute starts where the robot is")
        items.append(item)
    return MotionSequenceRequest(items)
