# SPDX-License-Identifier: BSD-3-Clause
"""Action place: puts a held object down at the best feasible one of several locations."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from moveit_msgs.msg import PlaceAction as PlaceMessages
from moveit_msgs.msg import PlaceFeedback, PlaceGoal, PlaceResult

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.manipulation_messages import Hand, held_object, place_manoeuvre
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.goal_runner import GoalRunner
from modular_framework_planning.move_group.manipulation import Manipulation, Task
from modular_framework_planning.pick_place.manipulation import Manoeuvre
from modular_framework_planning.planning_scene.planning_scene import PlanningScene


class PlaceAction:
    """Offers place (moveit_msgs/Place). Locations are tried from the highest quality to the lowest."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context
        self._runner = GoalRunner(names.PLACE_ACTION, PlaceMessages, self._work)

    def connect(self) -> None:
        """Starts the action server."""
        self._runner.connect()

    def _work(
        self, goal: PlaceGoal, cancelled: threading.Event, feedback: Callable[[Any], None]
    ) -> tuple[PlaceResult, bool, str]:
        result = PlaceResult()
        order = sorted(range(len(goal.place_locations)), key=lambda number: -goal.place_locations[number].quality)

        def read(scene: PlanningScene, number: int, hand: Hand) -> Manoeuvre:
            held = held_object(scene, goal.attached_object_name, hand)
            return place_manoeuvre(scene, goal, goal.place_locations[number], hand, held, f"place_locations[{number}]")

        def accept(number: int) -> None:
            result.place_location = goal.place_locations[number]

        task = Task("place", goal, goal.group_name, "", lambda scene: _check(scene, goal), order, read, accept)
        text = Manipulation(self._context, task, cancelled, lambda state: feedback(PlaceFeedback(state))).run(result)
        feedback(PlaceFeedback("IDLE"))
        return result, result.error_code.val == ErrorCode.SUCCESS, text


def _check(scene: PlanningScene, goal: PlaceGoal) -> None:
    """Refuses goals that fail at every location; raises PlanningError."""
    for name in (goal.support_surface_name, *goal.allowed_touch_objects):
        if name:
            scene.find_object(name)
    if not goal.place_locations:
        raise PlanningError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS, "place_locations is empty; give at least one place for the object"
        )
