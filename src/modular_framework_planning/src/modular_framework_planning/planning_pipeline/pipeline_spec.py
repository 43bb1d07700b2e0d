# SPDX-License-Identifier: BSD-3-Clause
"""How a pipeline is built from the names of its planner and request adapters."""

from __future__ import annotations

from dataclasses import dataclass, field

from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.collision_detectors import (
    DEFAULT_COLLISION_DETECTOR,
    collision_detector,
)
from modular_framework_planning.planning_interface.planning_request import PipelineSettings
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.plugins import (
    DEFAULT_ADAPTERS,
    DEFAULT_PLANNER,
    make_adapters,
    make_planner,
)
from modular_framework_planning.robot_model.robot_model import RobotModel


@dataclass(frozen=True, slots=True)
class PipelineSpec:
    """Specification of a pipeline; can be sent to another process.

    Attributes:
        name: what `pipeline_id` calls it.
        planner, adapters: parameters planning_plugin and request_adapters.
        settings: the pipeline's parameters.
        collision_detector: parameter collision_detector.
    """

    name: str = "ompl"
    planner: str = DEFAULT_PLANNER
    adapters: str = DEFAULT_ADAPTERS
    settings: PipelineSettings = field(default_factory=PipelineSettings)
    collision_detector: str = DEFAULT_COLLISION_DETECTOR

    def build(self, model: RobotModel, kinematics: KinematicsPool) -> PlanningPipeline:
        """Builds the pipeline; raises PlanningError for an unknown part or a parameter a part refuses."""
        return PlanningPipeline(
            model,
            kinematics,
            self.settings,
            make_planner(self.planner, model, self.settings),
            make_adapters(self.adapters),
            self.name,
            collision_detector(self.collision_detector),
        )
