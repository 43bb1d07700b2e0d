# SPDX-License-Identifier: BSD-3-Clause
"""What the endpoints of the node share."""
from __future__ import annotations

from dataclasses import dataclass

from modular_framework_planning.kinematics import KinematicsPool
from modular_framework_planning.pipeline import PlanningPipeline
from modular_framework_planning.robot_model import RobotModel
from modular_framework_planning.ros_execution import TrajectoryExecution
from modular_framework_planning.ros_markers import MarkerPublisher
from modular_framework_planning.ros_report import Reporter
from modular_framework_planning.ros_scene_monitor import SceneMonitor


@dataclass(frozen=True, slots=True)
class MoveGroupContext:
    """Parts every endpoint may use; all of them may be used from several threads."""

    model: RobotModel
    monitor: SceneMonitor
    kinematics: KinematicsPool
    pipeline: PlanningPipeline
    pipeline_name: str
    execution: TrajectoryExecution
    markers: MarkerPublisher
    reporter: Reporter
