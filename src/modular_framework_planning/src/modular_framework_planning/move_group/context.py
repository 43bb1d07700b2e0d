# SPDX-License-Identifier: BSD-3-Clause
"""Parts of the node that its endpoints share."""

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
from modular_framework_planning.planning_interface.planning_request import PlanningAnswer, PlanningRequest
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.robot_model.robot_model import RobotModel


@dataclass(frozen=True, slots=True)
class MoveGroupContext:
    """Parts every endpoint may use; all of them may be used from several threads."""

    model: RobotModel
    monitor: SceneMonitor
    kinematics: KinematicsPool
    pipelines: PipelineSet
    execution: TrajectoryExecution
    markers: MarkerPublisher
    reporter: Reporter
    settings: MotionSettings
    new_checker: CollisionCheckerFactory

    def plan(self, request: PlanningRequest) -> PlanningAnswer:
        """Plans with the pipeline the request names, or the default one.

        Raises:
            PlanningError: no such pipeline, or no plan; code and reason.
        """
        return self.pipelines.plan(request)

    @property
    def default_pipeline(self) -> str:
        """Name of the pipeline of requests that name none."""
        return self.pipelines.default

    def pipeline(self, name: str) -> PlanningPipeline:
        """Returns a pipeline, the default one for an empty name; raises PlanningError, which lists the known ones."""
        return self.pipelines.choose(name)
