# SPDX-License-Identifier: BSD-3-Clause
"""Reads moveit_msgs/PlanningOptions for the actions that plan and execute."""

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
    """Refuses planning_options that cannot be honoured; raises PlanningError."""
    if options.look_around:
        raise PlanningError(
            ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA,
            "planning_options.look_around: there is no sensor to point; ask with look_around false",
        )
    if not (math.isfinite(options.replan_delay) and options.replan_delay >= 0.0):
        raise PlanningError(
            ErrorCode.FAILURE,
            f"planning_options.replan_delay is {options.replan_delay} s; a finite number of at least 0 is needed",
        )


def scene_change(options: Any, keep_state: bool) -> SceneChange:
    """Returns what planning_scene_diff does to a scene.

    As in MoveIt it is always a difference to the current scene, whatever its is_diff says; and where the robot will
    move (`keep_state`), its state stays the real one.
    """
    diff = copy.copy(options.planning_scene_diff)
    diff.is_diff = True
    if keep_state and (names_joints(diff.robot_state) or diff.robot_state.attached_collision_objects):
        rospy.logwarn("planning_scene_diff.robot_state is ignored: a motion to execute starts where the robot is")
    if keep_state or not names_joints(diff.robot_state):
        diff.robot_state = RobotState(
            is_diff=True, attached_collision_objects=[] if keep_state else diff.robot_state.attached_collision_objects
        )
    return lambda scene: apply_scene(scene, diff)


def with_current_start(request: Any, where: str) -> Any:
    """Returns the request with the current state as its start, the only one from which a motion can be executed.

    Args:
        request: moveit_msgs/MotionPlanRequest, left as it is.
        where: its name in a warning.
    """
    start = request.start_state
    if names_joints(start) or start.attached_collision_objects:
        rospy.logwarn("%s.start_state is ignored: a motion to execute starts where the robot is", where)
    request = copy.copy(request)
    request.start_state = RobotState(is_diff=True)
    return request
