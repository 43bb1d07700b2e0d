# SPDX-License-Identifier: BSD-3-Clause
"""Action place: puts down a held object at the best feasible location."""

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
    """Offers place (moveit_msgs/Place); locations are tried in descending order of quality."""

    name, kind = names.PLACE_ACTION, PlaceMessages

    def _task(self, goal: PlaceGoal, result: PlaceResult) -> Task:
        def read(scene: PlanningScene, index: int, hand: Hand) -> Manoeuvre:
            held = held_object(scene, goal.attached_object_name, hand)
            return place_manoeuvre(
                scene, goal, goal.place_locations[index], hand=hand, held=held, field_name=f"place_locations[{index}]"
            )

        def accept(index: int) -> None:
            result.place_location = goal.place_locations[index]

        order = best_first(location.quality for location in goal.place_locations)
        return Task(
            kind="place",
            goal=goal,
            group=goal.group_name,
            end_effector="",
            check=lambda scene: _check(scene, goal),
            candidates=order,
            read=read,
            accept=accept,
        )


def _check(scene: PlanningScene, goal: PlaceGoal) -> None:
    """Checks the parts of a goal that all locations need; raises PlanningError."""
    check_objects(scene, goal)
    if not goal.place_locations:
        raise PlanningError(ErrorCode.INVALID_GOAL_CONSTRAINTS, "place_locations is empty; give at least one location")
