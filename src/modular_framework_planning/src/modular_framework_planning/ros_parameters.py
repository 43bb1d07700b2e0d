# SPDX-License-Identifier: BSD-3-Clause
"""Reads the parameters of the move_group node, in the layouts MoveIt config packages load them."""
from __future__ import annotations

import time
from dataclasses import fields
from typing import Any

import rospy

from modular_framework_planning.errors import ModelError
from modular_framework_planning.planning_request import PipelineSettings
from modular_framework_planning.robot_model import RobotModel

DESCRIPTION = "robot_description"


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
            raise ModelError(f"parameter {' and '.join(missing)} not set after {timeout_s:.0f} s; load the robot's "
                             "description (planning_context.launch) before move_group")
        rospy.rostime.wallsleep(0.1)
    planning = rospy.get_param(f"{DESCRIPTION}_planning", {})
    return RobotModel(str(rospy.get_param(names[0])), str(rospy.get_param(names[1])),
                      planning.get("joint_limits") or {})


def pipeline_parameters() -> tuple[str, dict[str, Any]]:
    """Returns name and parameters of the default planning pipeline, in Noetic's or the older flat layout."""
    own = rospy.get_param("~", {}) or {}
    pipelines = own.get("planning_pipelines") or {}
    name = str(own.get("default_planning_pipeline") or next(iter(pipelines), "ompl"))
    parameters = pipelines.get(name) or own.get(name) or own
    return name, dict(parameters)


def load_pipeline_settings() -> tuple[str, PipelineSettings]:
    """Returns the default pipeline's name and its settings."""
    name, parameters = pipeline_parameters()
    planning = rospy.get_param(f"{DESCRIPTION}_planning", {}) or {}
    known = {item.name for item in fields(PipelineSettings)}
    values: dict[str, Any] = {}
    for source in (planning, rospy.get_param("~", {}) or {}, parameters):
        for key, value in source.items():
            if key in known and isinstance(value, int | float) and not isinstance(value, bool):
                values[key] = value
    values["planner_configs"] = parameters.get("planner_configs") or {}
    values["groups"] = {group: item for group, item in parameters.items()
                        if isinstance(item, dict) and group != "planner_configs"}
    values["parameters"], values["robot_planning"] = parameters, planning
    return name, PipelineSettings(**values)
