# SPDX-License-Identifier: BSD-3-Clause
"""The planning pipelines of the node, built from parameters in the layouts of MoveIt config packages."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import rospy

from modular_framework_planning.errors import ErrorCode, ModelError, PlanningError
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.move_group.robot_parameters import load_planning_limits
from modular_framework_planning.planning_interface.planning_request import (
    PlanningRequest,
    PlanningResult,
    SamplingSettings,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.pipeline_spec import (
    PipelineSpec,
    pipelines_of,
    read_pipeline_spec,
)
from modular_framework_planning.reproducible.request_seeds import RequestCounts, request_digest
from modular_framework_planning.reproducible.seeded_planning import SeededPlanning
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_ros.seeds import SeedError, derived_seed, seed_parameter

PARENT = "~planning_pipelines"
SEEDED_ITERATIONS_PER_S = 1000.0
"""Iterations per second of allowed time if /seed is set; about the rate of one core for an arm."""
CLOCK_MARGIN = 20.0
"""Factor on the allowed time if /seed is set, so that iterations, and not the machine's load, end a search."""


def launch_seed() -> int | None:
    """Returns the parameter /seed, or None if unset; raises PlanningError for an invalid seed."""
    try:
        return seed_parameter()
    except SeedError as error:
        raise PlanningError(ErrorCode.PLANNING_FAILED, str(error)) from error


class PipelineSet(Mapping[str, PlanningPipeline]):
    """The loaded pipelines, keyed by name."""

    def __init__(
        self, loaded: Mapping[str, PlanningPipeline], default: str, refused: Mapping[str, str], seeded: SeededPlanning
    ) -> None:
        """Stores the parts.

        Args:
            loaded: Usable pipelines, keyed by name.
            default: Name of the default pipeline.
            refused: Reasons why other configured pipelines are not usable, keyed by name.
            seeded: Planner for requests with a seed.
        """
        self._loaded, self.default, self._refused, self._seeded = dict(loaded), default, dict(refused), seeded
        self._sampling = SamplingSettings()
        self._request_counts = RequestCounts()

    @property
    def sampling_settings(self) -> SamplingSettings:
        """Sampling settings of all pipelines, used by plans that start later."""
        return self._sampling

    @sampling_settings.setter
    def sampling_settings(self, settings: SamplingSettings) -> None:
        self._sampling = settings
        for pipeline in self._loaded.values():
            pipeline.settings = replace(pipeline.settings, sampling=settings)

    def __getitem__(self, name: str) -> PlanningPipeline:
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._loaded)

    def __len__(self) -> int:
        return len(self._loaded)

    def plan(self, request: PlanningRequest) -> PlanningResult:
        """Plans with the requested pipeline; seeded requests are planned in a worker process."""
        pipeline = self.choose(request.pipeline_id)
        request = self._with_launch_seed(request, pipeline.has_own_process)
        seed = pipeline.settings.seed if request.seed is None else request.seed
        return pipeline.plan(request) if seed is None else self._seeded.plan(pipeline, request, seed)

    def _with_launch_seed(self, request: PlanningRequest, has_own_process: bool) -> PlanningRequest:
        """Derives a seed from /seed for a request without a seed, and bounds searches of this node by iterations."""
        seed = launch_seed() if request.seed is None else None
        if seed is None:
            return request
        digest = request_digest(request)
        repetition = self._request_counts.count(digest, rospy.get_time())
        request = replace(request, seed=derived_seed(seed, "planning", digest, repetition))
        if has_own_process:
            return request
        return replace(
            request,
            max_iterations=max(1, int(SEEDED_ITERATIONS_PER_S * request.allowed_time_s)),
            allowed_time_s=CLOCK_MARGIN * request.allowed_time_s,
        )

    def close(self) -> None:
        """Stops the worker processes and the processes of planners."""
        self._seeded.close()
        for pipeline in self._loaded.values():
            pipeline.close()

    def choose(self, name: str) -> PlanningPipeline:
        """Returns a pipeline, the default pipeline for an empty name; raises PlanningError for an unknown name."""
        name = name or self.default
        if name in self._loaded:
            return self._loaded[name]
        reason = f" ({self._refused[name]})" if name in self._refused else ""
        raise PlanningError(
            ErrorCode.PLANNING_FAILED,
            f"pipeline_id '{name}' is not loaded{reason}; available: {', '.join(self._loaded)}",
        )


def load_pipelines(model: RobotModel, kinematics: KinematicsPool, collision_detector: str) -> PipelineSet:
    """Builds all configured pipelines; a pipeline that cannot be built is logged and left out.

    Args:
        model: Robot model.
        kinematics: Inverse kinematics of the groups.
        collision_detector: Name of the collision checker for all pipelines.

    Raises:
        ModelError: The default pipeline is not configured or cannot be built.
    """
    parameters, default = pipelines_of(rospy.get_param("~", {}) or {})
    loaded: dict[str, PlanningPipeline] = {}
    refused: dict[str, str] = {}
    specs: list[PipelineSpec] = []
    for name, item in parameters.items():
        try:
            spec = _spec(name, item, collision_detector)
            loaded[name] = _build(spec, model, kinematics)
            specs.append(spec)
        except PlanningError as error:
            refused[name] = error.reason
    if default not in loaded:
        reason = refused.get(default, f"{rospy.resolve_name(PARENT)} has no pipeline of this name")
        raise ModelError(
            f"{rospy.resolve_name('~default_planning_pipeline')}: pipeline '{default}' cannot be used: "
            f"{reason}; usable: {', '.join(loaded) or 'none'}"
        )
    for name, reason in refused.items():
        rospy.logwarn("planning pipeline '%s' is left out: %s", name, reason)
    seeded = SeededPlanning(model, specs)
    if launch_seed() is not None or any(pipeline.settings.seed is not None for pipeline in loaded.values()):
        threading.Thread(target=_start, args=(seeded,), daemon=True).start()
    for pipeline in loaded.values():
        if pipeline.has_own_process:
            threading.Thread(target=_start, args=(pipeline,), daemon=True).start()
    return PipelineSet(loaded, default, refused, seeded)


def _start(planning: SeededPlanning | PlanningPipeline) -> None:
    """Starts a process in advance; a failure is logged here and raised again by the first request."""
    try:
        planning.start()
    except PlanningError as error:
        rospy.logerr("%s", error.reason)


def _spec(name: str, parameters: Mapping[str, Any], collision_detector: str) -> PipelineSpec:
    node = rospy.get_param("~", {}) or {}
    return read_pipeline_spec(name, parameters, load_planning_limits(), node, collision_detector)


def _build(spec: PipelineSpec, model: RobotModel, kinematics: KinematicsPool) -> PlanningPipeline:
    pipeline = spec.build(model, kinematics)
    for configuration in pipeline.configurations.names():
        for fault in pipeline.parameter_faults(configuration):
            rospy.logwarn("planning pipeline '%s', planner_configs/%s: %s", spec.name, configuration, fault)
    return pipeline
