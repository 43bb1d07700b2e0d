# SPDX-License-Identifier: BSD-3-Clause
"""The settings of move_group that may be adjusted while it runs, by dynamic_reconfigure as in MoveIt."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import rospy

from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_ros.reconfiguration import Adjustable, Reconfiguration

NO_LIMIT = 1.0e9
Settings = TypeVar("Settings")


TABLES = {
    "trajectory_execution": (
        Adjustable("execution_duration_monitoring", False, True, "stop a motion that takes too long"),
        Adjustable("allowed_execution_duration_scaling", 1.0, 10.0, "too long is the planned time times this + margin"),
        Adjustable("allowed_goal_duration_margin", 0.1, 30.0, "margin beyond the planned time [s]"),
        Adjustable("execution_velocity_scaling", 0.1, 10.0, "how many times as fast as planned motions are executed"),
        Adjustable("allowed_start_tolerance", 0.0, NO_LIMIT, "of a joint from the first point [rad or m]; 0: any"),
        Adjustable("wait_for_trajectory_completion", False, True, "wait until the joints stand still"),
    ),
    "planning_scene_monitor": (
        Adjustable("publish_planning_scene", False, True, "publish changes of the scene"),
        Adjustable("publish_planning_scene_hz", 0.1, 100.0, "rate of joints and frames while they change"),
        Adjustable("publish_geometry_updates", False, True, "publish changes of objects"),
        Adjustable("publish_state_updates", False, True, "publish changes of joints"),
        Adjustable("publish_transforms_updates", False, True, "publish changes of frames outside the robot"),
    ),
    "plan_execution": (
        Adjustable("max_replan_attempts", 0, 1000, "plans of a goal that asks for replanning and gives no number"),
        Adjustable("record_trajectory_state_frequency", 0.0, 1000.0, "of the executed trajectory [Hz]; 0: none"),
    ),
    "pick_place": (
        Adjustable("max_attempted_states_per_pose", 1, 100, "postures of the arm tried for one grasp or place"),
        Adjustable("cartesian_motion_step_size", 0.005, 0.1, "between the poses solved on a straight line [m]"),
    ),
    "ompl": (Adjustable("simplify_solutions", False, True, "shorten the paths that are found"),),
}


def reconfigurations(context: MoveGroupContext) -> tuple[Reconfiguration, ...]:
    """Returns a server for each part of the node that may be adjusted."""
    adjusted: tuple[tuple[str, Any, str], ...] = (
        ("trajectory_execution", context.execution, "settings"),
        ("planning_scene_monitor", context.monitor, "settings"),
        ("plan_execution", context.settings, "plan_execution"),
        ("pick_place", context.settings, "pick_place"),
        ("ompl", context.pipelines, "sampling_settings"),
    )
    return tuple(
        Reconfiguration(f"~{namespace}", TABLES[namespace], holder, attribute)
        for namespace, holder, attribute in adjusted
    )


def given_settings(namespace: str, settings: Settings) -> Settings:
    """Returns the settings with what the parameters give; a faulty value is an error in the log and left out."""
    values = {}
    for item in TABLES[namespace]:
        name, default = f"~{namespace}/{item.name}", getattr(settings, item.name)
        value = rospy.get_param(name, default)
        if item.accepts(value):
            values[item.name] = value
        else:
            rospy.logerr(
                "%s is %r; allowed is %s of %s to %s; %s is used",
                rospy.resolve_name(name),
                value,
                item.kind,
                item.lowest,
                item.highest,
                default,
            )
    return replace(settings, **values)  # type: ignore[type-var]
