# SPDX-License-Identifier: BSD-3-Clause
"""Readers for the robot's parameters, as MoveIt config packages load them."""

from __future__ import annotations

import time
from typing import Any

import rospy

from modular_framework_planning.errors import ModelError
from modular_framework_planning.kinematics.kinematics_settings import KinematicsSettings, settings_from
from modular_framework_planning.planning_interface.collision_detectors import (
    COLLISION_DETECTORS,
    DEFAULT_COLLISION_DETECTOR,
    is_detector_name,
)
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_ros.allowed_names import nearest
from modular_framework_ros.parameter_search import nearest_parameter

DESCRIPTION = "robot_description"
COLLISION_DETECTOR = "collision_detector"
_NO_COSTS = "the scene has no costs, space is either free or occupied"
IGNORED = (  # parameter, value in MoveIt's launch files, reason why the parameter has no effect
    ("max_safe_path_cost", 1, _NO_COSTS),
    ("sense_for_plan/max_safe_path_cost", 1, _NO_COSTS),
    ("monitor_dynamics", False, "velocities and efforts of the robot's state are not used"),
)


def load_robot_model(timeout_s: float = 30.0) -> RobotModel:
    """Builds the robot model from the nearest descriptions in the node's namespace and the namespaces above.

    Raises:
        ModelError: A description is missing after the timeout, or invalid.
    """
    deadline = time.monotonic() + timeout_s
    names = (DESCRIPTION, f"{DESCRIPTION}_semantic")
    while missing := [name for name in map(nearest_parameter, names) if not rospy.has_param(name)]:
        if time.monotonic() > deadline or rospy.is_shutdown():
            raise ModelError(
                f"parameter {' and '.join(missing)} is not set after {timeout_s:.0f} s; load the robot "
                "description (planning_context.launch) before move_group"
            )
        rospy.rostime.wallsleep(0.1)
    urdf, srdf = (str(rospy.get_param(nearest_parameter(name))) for name in names)
    model = RobotModel(urdf, srdf, load_planning_limits().get("joint_limits") or {})
    for note in model.notes:
        rospy.logwarn(note)
    return model


def load_planning_limits() -> dict[str, Any]:
    """Returns robot_description_planning: joint_limits, cartesian_limits, paddings and default scaling factors."""
    limits: dict[str, Any] = rospy.get_param(nearest_parameter(f"{DESCRIPTION}_planning"), {}) or {}
    return limits


def load_kinematics_settings() -> dict[str, KinematicsSettings]:
    """Returns the settings of each group in robot_description_kinematics (kinematics.yaml); raises PlanningError."""
    return settings_from(rospy.get_param(nearest_parameter(f"{DESCRIPTION}_kinematics"), {}) or {})


def ignored_parameters() -> list[str]:
    """Returns a warning for each of MoveIt's parameters that is set but has no effect here."""
    warnings = []
    for name, default, reason in IGNORED:
        value = rospy.get_param(f"~{name}", default)
        if value != default:
            warnings.append(
                f"parameter {rospy.resolve_name(f'~{name}')} is {value!r} and has no effect: {reason}; leave it at "
                f"{default}"
            )
    return warnings


def collision_detector_name() -> str:
    """Returns the parameter `collision_detector` of the node or a namespace above, empty if unset.

    As in MoveIt, an unknown name is logged as an error and replaced by the default. Names of the form `module/Class`
    are not checked here.
    """
    found = rospy.search_param(COLLISION_DETECTOR)
    name = rospy.get_param(found) if found else ""
    if not isinstance(name, str):
        rospy.logwarn("parameter %s is %r, not a string; %s is used instead", found, name, DEFAULT_COLLISION_DETECTOR)
        return ""
    if "/" not in name and not is_detector_name(name):
        rospy.logerr(
            "parameter %s: collision_detector '%s' is not known; allowed: %s and module/Class%s; %s is used",
            found,
            name,
            ", ".join(COLLISION_DETECTORS),
            nearest(name, COLLISION_DETECTORS),
            DEFAULT_COLLISION_DETECTOR,
        )
        return ""
    return name
