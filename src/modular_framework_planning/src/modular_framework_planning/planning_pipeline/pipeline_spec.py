# SPDX-License-Identifier: BSD-3-Clause
"""Pipeline specification: builds a pipeline from parameters with the names of its planner and request adapters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from modular_framework_planning.errors import ErrorCode, PlanningError
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
from modular_framework_ros.parameter_declarations import existing_declaration


@dataclass(frozen=True, slots=True)
class PipelineSpec:
    """Specification of a pipeline, which can be sent to a different process.

    Attributes:
        name: Name of the pipeline (`pipeline_id`).
        planner, adapters: Parameters planning_plugin and request_adapters.
        settings: Settings of the pipeline.
        collision_detector: Parameter collision_detector.
    """

    name: str = "ompl"
    planner: str = DEFAULT_PLANNER
    adapters: str = DEFAULT_ADAPTERS
    settings: PipelineSettings = field(default_factory=PipelineSettings)
    collision_detector: str = DEFAULT_COLLISION_DETECTOR

    def build(self, model: RobotModel, kinematics: KinematicsPool) -> PlanningPipeline:
        """Returns the pipeline; raises PlanningError for an unknown name or an invalid parameter."""
        return PlanningPipeline(
            kinematics,
            self.settings,
            make_planner(self.planner, model, self.settings),
            adapters=make_adapters(self.adapters),
            name=self.name,
            new_checker=collision_detector(self.collision_detector),
        )


def pipelines_of(node: Mapping[str, Any]) -> tuple[dict[str, dict[str, Any]], str]:
    """Returns the parameters of every pipeline, keyed by name, and the name of the default pipeline.

    In Noetic, parameters are at planning_pipelines/<name>/... and default_planning_pipeline. Older config packages load
    the parameters of their only pipeline into the node's namespace.

    Args:
        node: Parameters of move_group.
    """
    entries = node.get("planning_pipelines") or {}
    pipelines = {name: dict(item) for name, item in entries.items() if isinstance(item, dict)}
    default = str(node.get("default_planning_pipeline") or "")
    if not pipelines:
        name = default or str(node.get("planning_plugin") or DEFAULT_PLANNER).split("_interface")[0].split("/")[0]
        nested = node.get(name)
        pipelines = {name: {**node, **(nested if isinstance(nested, dict) else {})}}
    if not default:
        default = "ompl" if "ompl" in pipelines else next(iter(pipelines))
    return pipelines, default


def read_pipeline_spec(
    name: str,
    parameters: Mapping[str, Any],
    planning: Mapping[str, Any],
    node: Mapping[str, Any],
    collision_detector: str = DEFAULT_COLLISION_DETECTOR,
) -> PipelineSpec:
    """Returns the specification of a pipeline.

    Parameters of the pipeline override parameters of the node, which override parameters of the robot.

    Args:
        name: Name of the pipeline (`pipeline_id`).
        parameters: Parameters of the pipeline, as in ompl_planning.yaml.
        planning: Parameters of the robot, robot_description_planning.
        node: Parameters of the planning node.
        collision_detector: Name of the collision checker.

    Raises:
        PlanningError: `search_threads` is not a whole number above 0.
    """
    threads = parameters.get("search_threads", node.get("search_threads"))
    declared = existing_declaration("modular_framework_planning", "planning_pipeline").parameters["search_threads"]
    if threads is not None and declared.fault(threads):
        raise PlanningError(ErrorCode.PLANNING_FAILED, f"pipeline '{name}': search_threads {declared.fault(threads)}")
    setting_names = {item.name for item in fields(PipelineSettings)}
    values: dict[str, Any] = {}
    for source in (planning, node, parameters):
        for key, value in source.items():
            if key in setting_names and isinstance(value, int | float) and not isinstance(value, bool):
                values[key] = value
    values["planner_configs"] = {
        key: item for key, item in (parameters.get("planner_configs") or {}).items() if isinstance(item, dict)
    }
    values["groups"] = {
        key: item for key, item in parameters.items() if isinstance(item, dict) and key != "planner_configs"
    }
    entries = parameters.get("request_adapters")
    return PipelineSpec(
        name,
        str(parameters.get("planning_plugin") or DEFAULT_PLANNER),
        DEFAULT_ADAPTERS if entries is None else " ".join(entries) if isinstance(entries, list) else str(entries),
        PipelineSettings(**values, parameters=parameters, robot_planning=planning),
        collision_detector,
    )
