# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of a robot for move_group, by section and as one dictionary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Parameters = dict[str, Any]


def _no_capabilities() -> Parameters:
    return {"capabilities": "", "disable_capabilities": ""}


@dataclass(slots=True)
class MoveItConfigs:
    """Parameters of a robot; each section may be passed to a node separately.

    Attributes:
        package_path: Folder of the config package.
        robot_description: URDF, by parameter name.
        robot_description_semantic: SRDF, by parameter name.
        robot_description_kinematics: Settings of the kinematics solvers, by group.
        planning_pipelines: Parameters `planning_pipelines/<name>/...` and `default_planning_pipeline`.
        trajectory_execution: Controllers, and settings of the execution.
        planning_scene_monitor: Settings for publishing the planning scene.
        sensors_3d: Sensors of the octomap.
        move_group_capabilities: Capabilities to add and to disable; not part of `to_dict()`, as in MoveIt 2.
        joint_limits: Joint limits for planning.
        moveit_cpp: Parameters of MoveItCpp.
        pilz_cartesian_limits: Limits of the tool along lines and arcs.
    """

    package_path: Path | None = None
    robot_description: Parameters = field(default_factory=dict)
    robot_description_semantic: Parameters = field(default_factory=dict)
    robot_description_kinematics: Parameters = field(default_factory=dict)
    planning_pipelines: Parameters = field(default_factory=dict)
    trajectory_execution: Parameters = field(default_factory=dict)
    planning_scene_monitor: Parameters = field(default_factory=dict)
    sensors_3d: Parameters = field(default_factory=dict)
    move_group_capabilities: Parameters = field(default_factory=_no_capabilities)
    joint_limits: Parameters = field(default_factory=dict)
    moveit_cpp: Parameters = field(default_factory=dict)
    pilz_cartesian_limits: Parameters = field(default_factory=dict)

    def to_dict(self) -> Parameters:
        """Returns all sections as one dictionary; mappings with the same name are merged."""
        parameters: Parameters = {}
        for section in (
            self.robot_description,
            self.robot_description_semantic,
            self.robot_description_kinematics,
            self.planning_pipelines,
            self.trajectory_execution,
            self.planning_scene_monitor,
            self.sensors_3d,
            self.joint_limits,
            self.moveit_cpp,
            self.pilz_cartesian_limits,
        ):
            _merge(parameters, section)
        return parameters


def _merge(parameters: Parameters, section: Mapping[str, Any]) -> None:
    for name, value in section.items():
        known = parameters.get(name)
        if isinstance(known, dict) and isinstance(value, dict):
            value = {**known, **value}
        parameters[name] = value
