# SPDX-License-Identifier: BSD-3-Clause
"""Action pickup: picks an object up by the best feasible one of several grasps."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from moveit_msgs.msg import PickupAction as PickupMessages
from moveit_msgs.msg import PickupFeedback, PickupGoal, PickupResult

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.manipulation_messages import Hand, grasp_manoeuvre
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.goal_runner import GoalRunner
from modular_framework_planning.move_group.manipulation import Manipulation, Task
from modular_framework_planning.pick_place.manipulation import Manoeuvre
from modular_framework_planning.planning_scene.planning_scene import PlanningScene


class PickupAction:
    """Offers pickup (moveit_msgs/Pickup). Grasps are tried from the highest grasp_quality to the lowest."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context
        self._runner = GoalRunner(names.PICKUP_ACTION, PickupMessages, self._work)

    def connect(self) -> None:
        """Starts the action server."""
        self._runner.connect()

    def _work(
        self, goal: PickupGoal, cancelled: threading.Event, feedback: Callable[[Any], None]
    ) -> tuple[PickupResult, bool, str]:
        result = PickupResult()
        order = sorted(range(len(goal.possible_grasps)), key=lambda number: -goal.possible_grasps[number].grasp_quality)

        def read(scene: PlanningScene, number: int, hand: Hand) -> Manoeuvre:
            return grasp_manoeuvre(scene, goal, goal.possible_grasps[number], hand, f"possible_grasps[{number}]")

        def accept(number: int) -> None:
            result.grasp = goal.possible_grasps[number]

        task = Task(
            "pickup", goal, goal.group_name, goal.end_effector, lambda scene: _check(scene, goal), order, read, accept
        )
        text = Manipulation(self._context, task, cancelled, lambda state: feedback(PickupFeedback(state))).run(result)
        feedback(PickupFeedback("IDLE"))
        return result, result.error_code.val == ErrorCode.SUCCESS, text


def _check(scene: PlanningScene, goal: PickupGoal) -> None:
    """Refuses goals that fail with every grasp; raises PlanningError."""
    scene.find_object(goal.target_name)
    for name in (goal.support_surface_name, *goal.allowed_touch_objects):
        if name:
            scene.find_object(name)
    if not goal.possible_grasps:
        raise PlanningError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS,
            "possible_grasps is empty and nobody here plans grasps; give at least one",
        )
