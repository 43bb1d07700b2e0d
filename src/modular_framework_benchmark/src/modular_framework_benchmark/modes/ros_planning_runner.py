# SPDX-License-Identifier: BSD-3-Clause
"""Runs planners on sets of motion planning problems, without simulation and without a ROS master.

Each plan runs in a forked process with the same initial state, so that a seed reproduces it bit for bit. A planner with
a process of its own plans in that process, which the seed reaches with the request.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from modular_framework_benchmark.experiments.planning_mode import PlanningSettings
from modular_framework_benchmark.experiments.problem_sets import Problem
from modular_framework_benchmark.metrics.measurements import ComponentReport, Motion
from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.measured_record import Stopwatch, measured_record
from modular_framework_benchmark.modes.parameters import merge_parameters
from modular_framework_benchmark.modes.robots import Robot
from modular_framework_benchmark.modes.ros_model_runner import ModelEpisodeRunner
from modular_framework_benchmark.modes.ros_planning_parameters import pipeline_parameters
from modular_framework_benchmark.modes.ros_robots import digests_of
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.used_software import UsedSoftware
from modular_framework_planning.errors import ErrorCode, ModelError, PlanningError
from modular_framework_planning.plan_statistics import PlanStatistics
from modular_framework_planning.planning_interface.collision_detectors import DEFAULT_CHECKER
from modular_framework_planning.planning_interface.motion_problems import MotionProblem, read_problem
from modular_framework_planning.planning_interface.planning_request import PlanningResult
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec, read_pipeline_spec
from modular_framework_planning.reproducible.seeded_planning import SeededPlanning
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory
from modular_framework_ros.reported_figures import CLEARANCE, PLANNING_TIME, PROCESSOR_TIME, SEARCH_TIME, Figure

MOTION_PERIOD_S = 0.01
DEFAULT_TIME_S = 5.0
CLEARANCE_STATES = 25  # states per motion; the distances of one state take about 0.1 s with detailed meshes


BROKEN_CODES = (
    ErrorCode.CRASH,
    ErrorCode.INVALID_GROUP_NAME,
    ErrorCode.INVALID_LINK_NAME,
    ErrorCode.INVALID_OBJECT_NAME,
    ErrorCode.INVALID_ROBOT_STATE,
    ErrorCode.FRAME_TRANSFORM_FAILURE,
    ErrorCode.UNRECOGNIZED_GOAL_TYPE,
)
"""Errors in the problem or in its names; every planner fails with these errors."""

FULL_SPEED = {"default_velocity_scaling_factor": 1.0, "default_acceleration_scaling_factor": 1.0}
PLUGINS = {  # defaults for pipelines without a configuration
    "ompl": "ompl_interface/OMPLPlanner",
    "pilz_industrial_motion_planner": "pilz_industrial_motion_planner/CommandPlanner",
    "stomp": "stomp_moveit/StompPlannerManager",
    "external": "mbf_method/ExternalPlanner",
}


@dataclass(frozen=True, slots=True)
class _PlanningSetup:
    """Data shared by episodes with the same robot and pipeline."""

    model: RobotModel
    pipeline: PlanningPipeline
    seeded: SeededPlanning


class PlanningEpisodeRunner(ModelEpisodeRunner[PlanningSettings, _PlanningSetup]):
    """Runs episodes of the mode `planning`."""

    def measure(self, spec: EpisodeSpec, folder: Path, watch: Stopwatch) -> EpisodeRecord:
        """Plans one problem and writes the motion to `trajectory.parquet` in the folder."""
        settings = spec.settings_of(PlanningSettings)
        prepared = self.cached_setup(settings)
        problem = _read_problem(settings, prepared.model)
        started_s, response, code, reason = watch.elapsed_s(), None, ErrorCode.SUCCESS, ""
        statistics: PlanStatistics | None = None
        try:
            prepared.pipeline.start()
            started_s = watch.elapsed_s()
            response = prepared.seeded.plan(prepared.pipeline, problem.request, spec.seed)
            statistics = response.statistics
        except PlanningError as error:
            statistics = error.statistics
            code, reason = error.code, f"{problem.name}: {error.code.name}: {error.reason}"
        ended_s = watch.elapsed_s()
        if response is not None and settings.record.trajectories:
            write_motion(response.trajectory, folder / "trajectory.parquet")
        report = ComponentReport(
            component="planning",
            name=problem.name,
            succeeded=response is not None,
            reason=reason,
            started_s=started_s,
            ended_s=ended_s,
            wall_s=ended_s - started_s,
            figures=({} if statistics is None else {PROCESSOR_TIME: statistics.processor_s, **statistics.figures})
            | (_figures(problem, response, settings) if response is not None else {}),
            motion=_motion(response.trajectory) if response is not None else None,
            ran=_used_software(statistics, self.robot(settings.robot)),
        )
        return measured_record(spec, _status(code), code.name, report=report, folder=folder, watch=watch)

    def setup_key(self, settings: PlanningSettings) -> tuple[Any, ...]:
        """Returns the settings of the pipeline."""
        return settings.robot, settings.pipeline, settings.planner, settings.planner_parameters, settings.parameters

    def prepare(self, settings: PlanningSettings) -> _PlanningSetup:
        """Returns the robot and the started planning process, whose start is no part of a plan."""
        robot = self.robot(settings.robot)
        spec = pipeline_spec(robot, settings)
        pipeline = spec.build(robot.model, robot.solvers())
        _check_planner(pipeline, settings.planner)
        seeded = SeededPlanning(robot.model, [spec])
        seeded.start()
        return _PlanningSetup(robot.model, pipeline, seeded)

    def end(self, prepared: _PlanningSetup) -> None:
        """Ends the planning process and the planner's own process."""
        prepared.seeded.close()
        prepared.pipeline.close()


def pipeline_spec(robot: Robot, settings: PlanningSettings) -> PipelineSpec:
    """Returns the pipeline of the robot's configuration with the episode's parameters, at full speed.

    Full speed makes the durations of motions compare planners instead of scaling factors.
    """
    name, planner = settings.pipeline or "ompl", settings.planner
    own = robot.pipelines.get(name) or {"planning_plugin": PLUGINS.get(name, name)}
    given = pipeline_parameters(settings.parameters, name)
    parameters = merge_parameters({**own, **FULL_SPEED}, given)
    if settings.planner_parameters:
        configurations = {planner: {"type": f"geometric::{planner}"}}
        configurations = merge_parameters(configurations, parameters.get("planner_configs") or {})
        configurations = merge_parameters(configurations, {planner: settings.planner_parameters})
        parameters["planner_configs"] = configurations
    return read_pipeline_spec(name, parameters, robot.planning, {})


def _check_planner(pipeline: PlanningPipeline, planner: str) -> None:
    """Raises ModeError if move_group would replace the planner by its default."""
    known_names = (*pipeline.planner_ids, *pipeline.configurations.names())
    if not planner:
        return  # the pipeline's default
    if pipeline.planner_ids and planner not in known_names:
        raise ModeError(
            f"planner '{planner}': pipeline '{pipeline.name}' has no such planner; allowed: {', '.join(known_names)}"
        )
    faults = pipeline.parameter_faults(planner)
    if faults:
        raise ModeError(f"planner_parameters of '{planner}': {'; '.join(faults)}")


def load_problem(
    problem: Problem, model: RobotModel, group: str = "", allowed_time_s: float = DEFAULT_TIME_S
) -> MotionProblem:
    """Returns a problem of an experiment.

    Args:
        problem: Name and files of the problem.
        model: Robot model.
        group: Planning group that replaces the group of the request; "" for none.
        allowed_time_s: Allowed planning time [s].

    Raises:
        ModeError: A file cannot be read, names what the robot does not have, or asks for more than the mode supports.
    """
    try:
        return read_problem(model, Path(problem.scene), Path(problem.request), allowed_time_s, group)
    except ModelError as error:
        raise ModeError(f"problem {problem.name}: {error}") from error
    except PlanningError as error:
        raise ModeError(f"problem {problem.name}: {problem.scene}: {error}") from error
    except (KeyError, TypeError, ValueError, IndexError) as error:
        text = f"{problem.scene} cannot be read: {type(error).__name__}: {error}"
        raise ModeError(f"problem {problem.name}: {text}") from error


def _read_problem(settings: PlanningSettings, model: RobotModel) -> MotionProblem:
    problem = load_problem(settings.problem, model, settings.group, settings.planning_time)
    request = replace(problem.request, planner_id=settings.planner, attempts=settings.attempts)
    return MotionProblem(settings.problem.name, request)


def _used_software(statistics: PlanStatistics | None, robot: Robot) -> UsedSoftware:
    run = None if statistics is None else statistics.run
    return UsedSoftware(digests=digests_of(robot)).with_plans([] if run is None else [run])


def _status(code: ErrorCode) -> EpisodeStatus:
    match code:
        case ErrorCode.SUCCESS:
            return EpisodeStatus.SUCCEEDED
        case ErrorCode.TIMED_OUT:
            return EpisodeStatus.TIMED_OUT
        case code if code in BROKEN_CODES:
            return EpisodeStatus.BROKEN
        case _:
            return EpisodeStatus.FAILED


def _figures(problem: MotionProblem, response: PlanningResult, settings: PlanningSettings) -> dict[Figure, float]:
    """Returns the figures of `metrics.planning`; the clearance only on request, because it takes seconds."""
    figures = {PLANNING_TIME: response.total_time_s, SEARCH_TIME: response.planning_time_s}
    if "clearance" in settings.metrics:
        figures[CLEARANCE] = _clearance(problem, response)
    return figures


def _motion(trajectory: Trajectory) -> Motion:
    """Returns the motion that a controller interpolates, sampled at least every 10 ms."""
    times = trajectory.sample_times(MOTION_PERIOD_S)
    return Motion(trajectory.joint_names, times, trajectory.positions_at(times))


def _clearance(problem: MotionProblem, response: PlanningResult) -> float:
    """Returns the minimum distance of the checked pairs along the motion [m]."""
    motion, model = response.trajectory, problem.request.scene.model
    checker = DEFAULT_CHECKER(problem.request.scene, model.group(problem.request.group).indices)
    times = np.linspace(0.0, motion.duration_s, min(CLEARANCE_STATES, len(motion.sample_times())))
    positions = np.tile(response.start, (len(times), 1))
    positions[:, [model.index[name] for name in motion.joint_names]] = motion.positions_at(times)
    return min(checker.distance(model.with_mimics(row)) for row in positions)


def write_motion(motion: Trajectory, path: Path) -> None:
    """Writes a motion to a Parquet file.

    The columns are `time_s`, and `<joint>/position`, `/velocity` and `/acceleration` [rad or m, per s, per s^2].
    """
    columns = {"time_s": motion.times}
    for number, joint in enumerate(motion.joint_names):
        for name in ("position", "velocity", "acceleration"):
            values = {"position": motion.positions, "velocity": motion.velocities}.get(name, motion.accelerations)
            columns[f"{joint}/{name}"] = values[:, number]
    pq.write_table(pa.table(columns), path)
