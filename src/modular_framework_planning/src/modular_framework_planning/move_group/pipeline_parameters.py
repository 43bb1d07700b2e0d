# SPDX-License-Identifier: BSD-3-Clause
"""Builds the planning pipelines from the parameters of the node, in the layouts config packages load them."""

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
    PlanningAnswer,
    PlanningRequest,
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
"""Iterations that stand for a second of the allowed time where /seed is set: about what one core does for an arm."""
CLOCK_MARGIN = 20.0
"""With /seed the clock ends a plan only after so many times the allowed time: a busy machine must not decide."""


def launch_seed() -> int | None:
    """Returns the parameter /seed; raises PlanningError where it is no seed."""
    try:
        return seed_parameter()
    except SeedError as error:
        raise PlanningError(ErrorCode.PLANNING_FAILED, str(error)) from error


class PipelineSet(Mapping[str, PlanningPipeline]):
    """The pipelines of the node, by name."""

    def __init__(
        self, loaded: Mapping[str, PlanningPipeline], default: str, refused: Mapping[str, str], seeded: SeededPlanning
    ) -> None:
        """Stores the parts.

        Args:
            loaded: the pipelines.
            default: name of the one an empty name means.
            refused: why others, which the parameters name, are not there.
            seeded: plans requests with a seed.
        """
        self._loaded, self.default, self._refused, self._seeded = dict(loaded), default, dict(refused), seeded
        self._sampling = SamplingSettings()
        self._asked = RequestCounts()

    @property
    def sampling_settings(self) -> SamplingSettings:
        """Sampling settings of all pipelines; in force for plans that begin later."""
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

    def plan(self, request: PlanningRequest) -> PlanningAnswer:
        """Plans with the pipeline the request names; with a seed in a process of its own."""
        pipeline = self.choose(request.pipeline_id)
        request = self._with_launch_seed(request)
        seed = pipeline.settings.seed if request.seed is None else request.seed
        return pipeline.plan(request) if seed is None else self._seeded.plan(pipeline, request, seed)

    def _with_launch_seed(self, request: PlanningRequest) -> PlanningRequest:
        """Gives a request without a seed one that follows from /seed; iterations bound its searches, not the clock."""
        seed = launch_seed() if request.seed is None else None
        if seed is None:
            return request
        digest = request_digest(request)
        number = self._asked.count(digest, rospy.get_time())
        return replace(
            request,
            seed=derived_seed(seed, "planning", digest, number),
            max_iterations=max(1, int(SEEDED_ITERATIONS_PER_S * request.allowed_time_s)),
            allowed_time_s=CLOCK_MARGIN * request.allowed_time_s,
        )

    def close(self) -> None:
        """Ends the worker processes."""
        self._seeded.close()

    def choose(self, name: str) -> PlanningPipeline:
        """Returns a pipeline, the default one for an empty name; raises PlanningError with those there are."""
        name = name or self.default
        if name in self._loaded:
            return self._loaded[name]
        reason = f" ({self._refused[name]})" if name in self._refused else ""
        raise PlanningError(
            ErrorCode.PLANNING_FAILED,
            f"pipeline_id '{name}' is not loaded{reason}; available: {', '.join(self._loaded)}",
        )


def load_pipelines(model: RobotModel, kinematics: KinematicsPool, collision_detector: str) -> PipelineSet:
    """Builds every pipeline; one that cannot be built is left out, with its reason in the log.

    Args:
        model: the robot.
        kinematics: inverse kinematics of its groups.
        collision_detector: name of the collision checker of all of them.

    Raises:
        ModelError: the default pipeline is not among the parameters, or cannot be built.
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
        reason = refused.get(default, f"there is none of that name below {rospy.resolve_name(PARENT)}")
        raise ModelError(
            f"{rospy.resolve_name('~default_planning_pipeline')}: pipeline '{default}' cannot be used: "
            f"{reason}; usable: {', '.join(loaded) or 'none'}"
        )
    for name, reason in refused.items():
        rospy.logwarn("planning pipeline '%s' is left out: %s", name, reason)
    seeded = SeededPlanning(model, specs)
    if launch_seed() is not None or any(pipeline.settings.seed is not None for pipeline in loaded.values()):
        threading.Thread(target=_start, args=(seeded,), daemon=True).start()
    return PipelineSet(loaded, default, refused, seeded)


def _start(seeded: SeededPlanning) -> None:
    """Starts the worker early; a request that cannot wait for it gets the reason itself."""
    try:
        seeded.start()
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
