# SPDX-License-Identifier: BSD-3-Clause
"""Shared parts of the node for all endpoints."""

from __future__ import annotations

from dataclasses import dataclass

from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.move_group.controllers.execution import TrajectoryExecution
from modular_framework_planning.move_group.markers.scene_markers import MarkerPublisher
from modular_framework_planning.move_group.monitors.scene_monitor import SceneMonitor
from modular_framework_planning.move_group.node_settings import MotionSettings
from modular_framework_planning.move_group.pipeline_parameters import PipelineSet
from modular_framework_planning.move_group.planning_report import Reporter
from modular_framework_planning.planning_interface.collision_checker import CollisionCheckerFactory
from modular_framework_planning.planning_interface.planning_request import PlanningRequest, PlanningResult
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.robot_model.robot_model import RobotModel


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveGroupContext:
    """Thread-safe parts of the node that all endpoints share."""

    model: RobotModel
    monitor: SceneMonitor
    kinematics: KinematicsPool
    pipelines: PipelineSet
    execution: TrajectoryExecution
    markers: MarkerPublisher
    reporter: Reporter
    settings: MotionSettings
    new_checker: CollisionCheckerFactory

    def plan(self, request: PlanningRequest) -> PlanningResult:
        """Plans with the requested or default pipeline.

        Raises:
            PlanningError: The pipeline does not exist, or planning failed.
        """
        return self.pipelines.plan(request)

    @property
    def default_pipeline(self) -> str:
        """Name of the pipeline for requests without a pipeline name."""
        return self.pipelines.default

    def pipeline(self, name: str) -> PlanningPipeline:
        """Returns a pipeline, the default pipeline for an empty name; raises PlanningError for an unknown name."""
        return self.pipelines.choose(name)
