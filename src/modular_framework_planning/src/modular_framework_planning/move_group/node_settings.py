# SPDX-License-Identifier: BSD-3-Clause
"""Settings of move_group that can change at runtime, under MoveIt's names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from modular_framework_planning.pick_place.settings import PickPlaceSettings


@dataclass(frozen=True, slots=True)
class SceneMonitorSettings:
    """Parameters below ~planning_scene_monitor.

    Attributes:
        publish_planning_scene: Whether ~monitored_planning_scene is published.
        publish_planning_scene_hz: Maximum rate for changes of joints and frames [Hz]; objects are published at once.
        publish_geometry_updates: Whether changes of objects are published.
        publish_state_updates: Whether changes of joint positions are published.
        publish_transforms_updates: Whether changes of frames outside the robot are published.
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
        max_replan_attempts: Maximum planning attempts for goals that ask for replanning without a limit.
        record_trajectory_state_frequency: Sampling rate of `executed_trajectory` [Hz]; 0 disables recording.
    """

    max_replan_attempts: int
    record_trajectory_state_frequency: float

    def attempts(self, options: Any) -> int:
        """Returns the maximum number of planning attempts for moveit_msgs/PlanningOptions."""
        if not options.replan:
            return 1
        return options.replan_attempts if options.replan_attempts > 0 else max(1, self.max_replan_attempts)


@dataclass(slots=True)
class MotionSettings:
    """Current settings of motions; each motion uses the settings at its start."""

    plan_execution: PlanExecutionSettings
    pick_place: PickPlaceSettings
