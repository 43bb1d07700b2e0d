# SPDX-License-Identifier: BSD-3-Clause
"""Reader for moveit_msgs/PlanningOptions."""

from __future__ import annotations

import copy
import math
from typing import Any

import rospy
from moveit_msgs.msg import RobotState

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.multi_dof import names_joints
from modular_framework_planning.messages.scene_messages import apply_scene
from modular_framework_planning.planning_scene.planning_scene import SceneChange


def check_options(options: Any) -> None:
    """Checks that planning_options are supported; raises PlanningError."""
    if options.look_around:
        raise PlanningError(
            ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA,
            "planning_options.look_around is true, but no sensor can be moved; set look_around to false",
        )
    if not (math.isfinite(options.replan_delay) and options.replan_delay >= 0.0):
        raise PlanningError(
            ErrorCode.FAILURE,
            f"planning_options.replan_delay is {options.replan_delay} s; give a finite number of at least 0",
        )


def scene_change(options: Any, keep_state: bool) -> SceneChange:
    """Returns the scene change of planning_scene_diff.

    As in MoveIt, the message is a difference to the current scene even if its is_diff is false.

    Args:
        options: moveit_msgs/PlanningOptions.
        keep_state: Whether the robot keeps its real state, as it must for a motion to execute.
    """
    diff = copy.copy(options.planning_scene_diff)
    diff.is_diff = True
    if keep_state and (names_joints(diff.robot_state) or diff.robot_state.attached_collision_objects):
        rospy.logwarn("planning_scene_diff.robot_state is ignored: an executed motion starts at the current state")
    if keep_state or not names_joints(diff.robot_state):
        diff.robot_state = RobotState(
            is_diff=True, attached_collision_objects=[] if keep_state else diff.robot_state.attached_collision_objects
        )
    return lambda scene: apply_scene(scene, diff)


def with_current_start(request: Any, source_name: str) -> Any:
    """Returns a copy of the request that starts at the current state, as an executed motion must.

    Args:
        request: moveit_msgs/MotionPlanRequest.
        source_name: Name of the request in a warning.
    """
    start = request.start_state
    if names_joints(start) or start.attached_collision_objects:
        rospy.logwarn("%s.start_state is ignored: an executed motion starts at the current state", source_name)
    request = copy.copy(request)
    request.start_state = RobotState(is_diff=True)
    return request
