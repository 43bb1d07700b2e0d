# SPDX-License-Identifier: BSD-3-Clause
"""Base class for the actions pickup and place."""

from __future__ import annotations

from abc import abstractmethod
from threading import Event
from typing import Any

from modular_framework_planning.move_group.capabilities.capability import ActionCapability, PublishState
from modular_framework_planning.move_group.manipulation import Manipulation, Task
from modular_framework_planning.planning_scene.planning_scene import PlanningScene


class ManipulationAction(ActionCapability):
    """Executes the best feasible candidate of a task."""

    def _perform(self, goal: Any, cancelled: Event, publish_state: PublishState) -> tuple[Any, str]:
        result = self.kind().action_result.result
        text = Manipulation(self._context, self._task(goal, result), cancelled, publish_state).run(result)
        publish_state("IDLE")
        return result, text

    @abstractmethod
    def _task(self, goal: Any, result: Any) -> Task:
        """Returns the task of a goal; the task writes the chosen candidate to the result."""


def check_objects(scene: PlanningScene, goal: Any) -> None:
    """Checks that support surface and touch objects of a goal exist; raises PlanningError."""
    for name in (goal.support_surface_name, *goal.allowed_touch_objects):
        if name:
            scene.find_object(name)
