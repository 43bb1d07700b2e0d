# SPDX-License-Identifier: BSD-3-Clause
"""Action sequence_move_group: plans a sequence of motions and, unless plan_only is set, executes the sequence."""

from __future__ import annotations

import copy
from threading import Event
from typing import Any

from moveit_msgs.msg import MotionSequenceRequest, MoveGroupSequenceAction, MoveGroupSequenceResult

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.planned_motion_action import PlannedMotion, PlannedMotionAction
from modular_framework_planning.move_group.motion_sequences import solve_sequence
from modular_framework_planning.move_group.motion_watch import WatchedMotion
from modular_framework_planning.move_group.planning_options import with_current_start
from modular_framework_planning.planning_scene.planning_scene import SceneChange


class SequenceAction(PlannedMotionAction):
    """Offers sequence_move_group (moveit_msgs/MoveGroupSequence), which moves even if the robot is at the goal."""

    name, kind, report = names.SEQUENCE_ACTION, MoveGroupSequenceAction, "sequence"

    def _plan(self, goal: Any, change: SceneChange, cancelled: Event) -> PlannedMotion:
        request = goal.request if goal.planning_options.plan_only else _from_current_state(goal.request)
        planned_in = self._context.monitor.snapshot()
        solved = solve_sequence(self._context, request, change, cancelled.is_set)
        result = MoveGroupSequenceResult(solved.response)
        if not solved.parts:
            return PlannedMotion(result, solved.reason)

        def execute() -> None:
            for part, trajectory in zip(solved.parts, solved.response.planned_trajectories, strict=True):
                if cancelled.is_set():
                    raise PlanningError(ErrorCode.PREEMPTED, "cancelled between two parts of the sequence")
                scene = planned_in.with_positions(part.answers[0].start)
                WatchedMotion(self._context, trajectory, scene, change).execute(cancelled)

        return PlannedMotion(result, solved.reason, execute, {"parts": len(solved.parts)})


def _from_current_state(request: Any) -> MotionSequenceRequest:
    """Returns a copy of the sequence without start states."""
    items = []
    for index, item in enumerate(request.items):
        item = copy.copy(item)
        item.req = with_current_start(item.req, f"items[{index}].req")
        items.append(item)
    return MotionSequenceRequest(items)
