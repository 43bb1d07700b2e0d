# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of a robot for move_group, section by section, and together as one dictionary."""

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
    """Parameters of a robot; each section may be given to a node by itself.

    Attributes:
        package_path: folder of the config package.
        robot_description: URDF, by the parameter's name.
        robot_description_semantic: SRDF, by the parameter's name.
        robot_description_kinematics: settings of inverse kinematics, by group.
        planning_pipelines: `planning_pipelines/<name>/...` and `default_planning_pipeline`.
        trajectory_execution: controllers and how motions are executed.
        planning_scene_monitor: what of the planning scene is published.
        sensors_3d: sensors of the octomap.
        move_group_capabilities: capabilities to add and to leave out; not part of `to_dict()`, as in MoveIt 2.
        joint_limits: limits for planning.
        moveit_cpp: parameters of MoveItCpp.
        pilz_cartesian_limits: limits of the tool along lines and arcs.
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
        """Returns all sections as one dictionary; a mapping that two of them have holds the entries of both."""
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
