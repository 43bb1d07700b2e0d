# SPDX-License-Identifier: BSD-3-Clause
"""Action pickup: picks an object up by the best feasible one of several grasps."""

from __future__ import annotations

from moveit_msgs.msg import PickupAction as PickupMessages
from moveit_msgs.msg import PickupGoal, PickupResult

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.manipulation_messages import Hand, grasp_manoeuvre
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.manipulation_action import ManipulationAction, check_objects
from modular_framework_planning.move_group.manipulation import Task, best_first
from modular_framework_planning.pick_place.manipulation import Manoeuvre
from modular_framework_planning.planning_scene.planning_scene import PlanningScene


class PickupAction(ManipulationAction):
    """Offers pickup (moveit_msgs/Pickup). Grasps are tried from the highest grasp_quality to the lowest."""

    name, kind = names.PICKUP_ACTION, PickupMessages

    def _task(self, goal: PickupGoal, result: PickupResult) -> Task:
        def read(scene: PlanningScene, number: int, hand: Hand) -> Manoeuvre:
            return grasp_manoeuvre(scene, goal, goal.possible_grasps[number], hand, f"possible_grasps[{number}]")

        def accept(number: int) -> None:
            result.grasp = goal.possible_grasps[number]

        order = best_first(grasp.grasp_quality for grasp in goal.possible_grasps)
        return Task(
            "pickup", goal, goal.group_name, goal.end_effector, lambda scene: _check(scene, goal), order, read, accept
        )


def _check(scene: PlanningScene, goal: PickupGoal) -> None:
    """Refuses goals that fail with every grasp; raises PlanningError."""
    scene.find_object(goal.target_name)
    check_objects(scene, goal)
    if not goal.possible_grasps:
        raise PlanningError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS,
            "possible_grasps is empty and nobody here plans grasps; give at least one",
        )
