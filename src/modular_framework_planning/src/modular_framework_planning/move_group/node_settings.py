# SPDX-License-Identifier: BSD-3-Clause
"""Settings of move_group that may change while it runs, under MoveIt's names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from modular_framework_planning.pick_place.settings import PickPlaceSettings


@dataclass(frozen=True, slots=True)
class SceneMonitorSettings:
    """Parameters below ~planning_scene_monitor.

    Attributes:
        publish_planning_scene: whether anything is published on ~monitored_planning_scene.
        publish_planning_scene_hz: how often joints and frames are published while they change; objects are at once.
        publish_geometry_updates, publish_state_updates, publish_transforms_updates: whether changes of objects, of
            joints and of frames outside the robot are published.
    """

    publish_planning_scene: bool
    publish_planning_scene_hz: float
    publish_geometry_updates: bool
    publish_state_updates: bool
    publish_transforms_updates: bool


@dataclass(frozen=True, slots=True)
class PlanExecutionSettings:
    """Parameters below ~plan_execution.

    Attributes:
        max_replan_attempts: how often a goal is planned anew where it asks for that and does not say how often.
        record_trajectory_state_frequency: of what `executed_trajectory` holds [Hz]; 0: nothing is recorded.
    """

    max_replan_attempts: int
    record_trajectory_state_frequency: float

    def attempts(self, options: Any) -> int:
        """Returns how often moveit_msgs/PlanningOptions allow to plan."""
        if not options.replan:
            return 1
        return options.replan_attempts if options.replan_attempts > 0 else max(1, self.max_replan_attempts)


@dataclass(slots=True)
class MotionSettings:
    """Holds the settings of motions; each motion uses those in force when it starts."""

    plan_execution: PlanExecutionSettings
    pick_place: PickPlaceSettings
