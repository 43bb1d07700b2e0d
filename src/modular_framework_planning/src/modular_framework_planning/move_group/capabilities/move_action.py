# SPDX-License-Identifier: BSD-3-Clause
"""Action move_group: plans and, unless plan_only is set, executes; replans when the scene changes, if allowed."""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Callable
from typing import Any

import rospy
from moveit_msgs.msg import MoveGroupAction, MoveGroupFeedback, MoveGroupResult, RobotState

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.scene_messages import apply_scene
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.goal_runner import GoalRunner
from modular_framework_planning.move_group.motion_plan_requests import answer
from modular_framework_planning.move_group.motion_watch import WatchedMotion
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

SHORTEST_DELAY_S = 0.05  # between two attempts: a plan that fails at once must not fill the log
WORTH_ANOTHER_TRY = (
    ErrorCode.PLANNING_FAILED,
    ErrorCode.INVALID_MOTION_PLAN,
    ErrorCode.TIMED_OUT,
    ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
)


def check_options(options: Any) -> None:
    """Refuses planning_options that cannot be honoured; raises PlanningError."""
    if options.look_around:
        raise PlanningError(
            ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA,
            "planning_options.look_around: there is no sensor to point; ask with look_around false",
        )
    if not (math.isfinite(options.replan_delay) and options.replan_delay >= 0.0):
        raise PlanningError(
            ErrorCode.FAILURE,
            f"planning_options.replan_delay is {options.replan_delay} s; a finite number of at least 0 is needed",
        )


def scene_change(options: Any, keep_state: bool) -> Callable[[PlanningScene], PlanningScene]:
    """Returns what planning_scene_diff does to a scene.

    As in MoveIt it is always a difference to the current scene, whatever its is_diff says; and where the robot will
    move (`keep_state`), its state stays the real one.
    """
    diff = copy.copy(options.planning_scene_diff)
    diff.is_diff = True
    if keep_state and (diff.robot_state.joint_state.name or diff.robot_state.attached_collision_objects):
        rospy.logwarn("planning_scene_diff.robot_state is ignored: a motion to execute starts where the robot is")
    if keep_state or not diff.robot_state.joint_state.name:
        diff.robot_state = RobotState(
            is_diff=True, attached_collision_objects=[] if keep_state else diff.robot_state.attached_collision_objects
        )
    return lambda scene: apply_scene(scene, diff)


class MoveAction:
    """Offers move_group (moveit_msgs/MoveGroup); honours planning_options but for look_around, which is refused."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context
        self._runner = GoalRunner(names.MOVE_ACTION, MoveGroupAction, self._work)

    def connect(self) -> None:
        """Starts the action server."""
        self._runner.connect()

    def _work(
        self, goal: Any, cancelled: threading.Event, feedback: Callable[[Any], None]
    ) -> tuple[MoveGroupResult, bool, str]:
        options = goal.planning_options
        attempts = self._context.settings.plan_execution.attempts(options)
        result, text = MoveGroupResult(), ""
        try:
            check_options(options)
            for number in range(attempts):
                result, text = self._once(goal, cancelled, feedback)
                if result.error_code.val not in WORTH_ANOTHER_TRY or number + 1 == attempts:
                    break
                if cancelled.wait(max(options.replan_delay, SHORTEST_DELAY_S)):
                    raise PlanningError(ErrorCode.PREEMPTED, "cancelled before the next attempt")
        except PlanningError as error:
            result.error_code.val = self._context.reporter.failure("plan", error, group=goal.request.group_name)
            text = error.reason
        feedback(MoveGroupFeedback("IDLE"))
        return result, result.error_code.val == ErrorCode.SUCCESS, text

    def _once(
        self, goal: Any, cancelled: threading.Event, feedback: Callable[[Any], None]
    ) -> tuple[MoveGroupResult, str]:
        """Plans once and executes once; failures come back as a code with their reason."""
        moves = not goal.planning_options.plan_only
        request = self._from_here(goal.request) if moves else goal.request
        change = scene_change(goal.planning_options, moves)
        feedback(MoveGroupFeedback("PLANNING"))
        planned_in = self._context.monitor.snapshot()
        result = MoveGroupResult()
        try:
            response = answer(self._context, request, change, cancelled.is_set)
        except PlanningError as error:
            result.error_code.val = int(error.code)
            return result, error.reason
        if cancelled.is_set():  # an improving planner returns a path also when the client has cancelled
            result.error_code.val = ErrorCode.PREEMPTED
            return result, "cancelled while planning"
        result = MoveGroupResult(
            error_code=response.error_code,
            trajectory_start=response.trajectory_start,
            planned_trajectory=response.trajectory,
            planning_time=response.planning_time,
        )
        if not moves:
            return result, "planned"
        feedback(MoveGroupFeedback("MONITOR"))
        motion = WatchedMotion(self._context, response.trajectory, planned_in, change)
        try:
            motion.execute(cancelled)
        except Exception as error:  # noqa: BLE001 - the client must get a code; the reporter logs the error
            result.error_code.val = self._context.reporter.failure("execute", error, group=request.group_name)
            return result, str(error)
        finally:
            result.executed_trajectory = motion.executed
        self._context.reporter.report("execute", ErrorCode.SUCCESS, "", group=request.group_name)
        return result, "planned and executed"

    @staticmethod
    def _from_here(request: Any) -> Any:
        """Returns the request with the current state as its start, the only one from which a motion can be executed."""
        start = request.start_state
        if start.joint_state.name or start.attached_collision_objects:
            rospy.logwarn("request.start_state is ignored: a motion to execute starts where the robot is")
        request = copy.copy(request)
        request.start_state = RobotState(is_diff=True)
        return request
