# SPDX-License-Identifier: BSD-3-Clause
"""Action pickup: picks up an object with the best feasible grasp."""

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
    """Offers pickup (moveit_msgs/Pickup); grasps are tried in descending order of grasp_quality."""

    name, kind = names.PICKUP_ACTION, PickupMessages

    def _task(self, goal: PickupGoal, result: PickupResult) -> Task:
        def read(scene: PlanningScene, index: int, hand: Hand) -> Manoeuvre:
            return grasp_manoeuvre(scene, goal, goal.possible_grasps[index], hand, f"possible_grasps[{index}]")

        def accept(index: int) -> None:
            result.grasp = goal.possible_grasps[index]

        order = best_first(grasp.grasp_quality for grasp in goal.possible_grasps)
        return Task(
            kind="pickup",
            goal=goal,
            group=goal.group_name,
            end_effector=goal.end_effector,
            check=lambda scene: _check(scene, goal),
            candidates=order,
            read=read,
            accept=accept,
        )


def _check(scene: PlanningScene, goal: PickupGoal) -> None:
    """Checks the goal fields shared by all grasps; raises PlanningError."""
    scene.find_object(goal.target_name)
    check_objects(scene, goal)
    if not goal.possible_grasps:
        raise PlanningError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS,
            "possible_grasps is empty; this node plans no grasps, so give at least one",
        )
