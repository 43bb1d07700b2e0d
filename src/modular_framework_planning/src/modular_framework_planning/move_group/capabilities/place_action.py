# SPDX-License-Identifier: BSD-3-Clause
"""Action place: puts a held object down at the best feasible one of several locations."""

from __future__ import annotations

from moveit_msgs.msg import PlaceAction as PlaceMessages
from moveit_msgs.msg import PlaceGoal, PlaceResult

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.manipulation_messages import Hand, held_object, place_manoeuvre
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.manipulation_action import ManipulationAction, check_objects
from modular_framework_planning.move_group.manipulation import Task, best_first
from modular_framework_planning.pick_place.manipulation import Manoeuvre
from modular_framework_planning.planning_scene.planning_scene import PlanningScene


class PlaceAction(ManipulationAction):
    """Offers place (moveit_msgs/Place). Locations are tried from the highest quality to the lowest."""

    name, kind = names.PLACE_ACTION, PlaceMessages

    def _task(self, goal: PlaceGoal, result: PlaceResult) -> Task:
        def read(scene: PlanningScene, number: int, hand: Hand) -> Manoeuvre:
            held = held_object(scene, goal.attached_object_name, hand)
            return place_manoeuvre(scene, goal, goal.place_locations[number], hand, held, f"place_locations[{number}]")

        def accept(number: int) -> None:
            result.place_location = goal.place_locations[number]

        order = best_first(location.quality for location in goal.place_locations)
        return Task("place", goal, goal.group_name, "", lambda scene: _check(scene, goal), order, read, accept)


def _check(scene: PlanningScene, goal: PlaceGoal) -> None:
    """Refuses goals that fail at every location; raises PlanningError."""
    check_objects(scene, goal)
    if not goal.place_locations:
        raise PlanningError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS, "place_locations is empty; give at least one place for the object"
        )
