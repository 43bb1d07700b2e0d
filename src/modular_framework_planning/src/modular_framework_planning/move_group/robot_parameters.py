# SPDX-License-Identifier: BSD-3-Clause
"""Reads the robot from the parameter server, as MoveIt config packages load it."""

from __future__ import annotations

import time

import rospy

from modular_framework_planning.errors import ModelError
from modular_framework_planning.kinematics.kinematics_settings import KinematicsSettings, settings_from
from modular_framework_planning.planning_interface.collision_detectors import (
    COLLISION_DETECTORS,
    DEFAULT_COLLISION_DETECTOR,
    is_known,
)
from modular_framework_planning.robot_model.robot_model import RobotModel

DESCRIPTION = "robot_description"
COLLISION_DETECTOR = "collision_detector"


def load_robot_model(timeout_s: float = 30.0) -> RobotModel:
    """Builds the robot model from the parameter server.

    Raises:
        ModelError: a description is missing after the timeout, or not usable.
    """
    deadline = time.monotonic() + timeout_s
    names = (DESCRIPTION, f"{DESCRIPTION}_semantic")
    while not all(rospy.has_param(name) for name in names):
        if time.monotonic() > deadline or rospy.is_shutdown():
            missing = [rospy.resolve_name(name) for name in names if not rospy.has_param(name)]
            raise ModelError(
                f"parameter {' and '.join(missing)} not set after {timeout_s:.0f} s; load the robot's "
                "description (planning_context.launch) before move_group"
            )
        rospy.rostime.wallsleep(0.1)
    planning = rospy.get_param(f"{DESCRIPTION}_planning", {})
    model = RobotModel(
        str(rospy.get_param(names[0])), str(rospy.get_param(names[1])), planning.get("joint_limits") or {}
    )
    for note in model.document.notes:
        rospy.logwarn(note)
    return model


def load_kinematics_settings() -> dict[str, KinematicsSettings]:
    """Returns the settings of groups in robot_description_kinematics (kinematics.yaml); raises PlanningError."""
    return settings_from(rospy.get_param(f"{DESCRIPTION}_kinematics", {}) or {})


def collision_detector_name() -> str:
    """Returns `collision_detector` of the node or of a namespace above it; empty where there is none.

    As in MoveIt a name that is not known is an error in the log, and the default is used; the classes of
    `module/Class` are not looked up here.
    """
    found = rospy.search_param(COLLISION_DETECTOR)
    name = rospy.get_param(found) if found else ""
    if not isinstance(name, str):
        rospy.logwarn(
            "parameter %s is no text but %r: it is ignored, and %s is used", found, name, DEFAULT_COLLISION_DETECTOR
        )
        return ""
    if "/" not in name and not is_known(name):
        rospy.logerr(
            "parameter %s: collision_detector '%s' is not known; known are %s and module/Class; %s is used",
            found,
            name,
            ", ".join(COLLISION_DETECTORS),
            DEFAULT_COLLISION_DETECTOR,
        )
        return ""
    return name
