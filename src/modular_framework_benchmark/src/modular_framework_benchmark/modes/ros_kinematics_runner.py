# SPDX-License-Identifier: BSD-3-Clause
"""Runs inverse kinematics on random reachable poses of a robot, without simulation and without a ROS master.

Each target pose results from random joint values within bounds, so it is reachable. The search starts from the robot's
default state, so the seed does not contain the answer. Forward kinematics (Pinocchio) checks each solution.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from modular_framework_benchmark.experiments.kinematics_mode import KinematicsSettings
from modular_framework_benchmark.metrics.measurements import ComponentReport
from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.measured_record import Stopwatch, measured_record
from modular_framework_benchmark.modes.parameters import parameters_below
from modular_framework_benchmark.modes.robots import Robot
from modular_framework_benchmark.modes.ros_model_runner import ModelEpisodeRunner
from modular_framework_benchmark.modes.ros_robots import digests_of
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.used_software import UsedSoftware, solver_substitutions
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics
from modular_framework_planning.kinematics.kinematics_settings import (
    CLOSED_FORM,
    NUMERIC,
    settings_from,
)
from modular_framework_planning.kinematics.kinematics_settings import KinematicsSettings as SolverSettings
from modular_framework_planning.robot_model.robot_model import JointGroup
from modular_framework_ros.reported_figures import (
    POSITION_ERROR,
    ROTATION_ERROR,
    SOLUTIONS,
    SOLVED_SHARE,
    SOLVING_TIME,
    Figure,
)

SOLVERS = ("", CLOSED_FORM, NUMERIC)
"""Allowed values of the setting `solver`; empty for a closed form if the chain has one."""
POSITION_TOLERANCE_M = 1.0e-4
ROTATION_TOLERANCE_RAD = 1.0e-3


@dataclass(frozen=True, slots=True)
class _PoseResult:
    """Result for a target pose, with the errors of the first solution; infinite without a solution."""

    time_s: float
    solutions: int
    position_error_m: float
    rotation_error_rad: float

    @property
    def is_solved(self) -> bool:
        return self.position_error_m < POSITION_TOLERANCE_M and self.rotation_error_rad < ROTATION_TOLERANCE_RAD


class KinematicsEpisodeRunner(ModelEpisodeRunner[KinematicsSettings, InverseKinematics]):
    """Runs episodes of the mode `kinematics`."""

    def measure(self, spec: EpisodeSpec, folder: Path, watch: Stopwatch) -> EpisodeRecord:
        """Solves the poses of a trial; writes no files."""
        settings = spec.settings_of(KinematicsSettings)
        robot, solver = self.robot(settings.robot), self.cached_setup(settings)
        started_s = watch.elapsed_s()
        results = _solve_poses(robot, solver, settings, spec.seed)
        unsolved, ended_s = [number for number, result in enumerate(results) if not result.is_solved], watch.elapsed_s()
        report = ComponentReport(
            component="kinematics",
            name=solver.group.name,
            succeeded=not unsolved,
            reason=f"{len(unsolved)} of {len(results)} poses not solved, first number {unsolved[0]}"
            if unsolved
            else "",
            started_s=started_s,
            ended_s=ended_s,
            wall_s=ended_s - started_s,
            figures=_figures(results),
            ran=UsedSoftware(
                solver=solver.method,
                digests=digests_of(robot),
                substitutions=solver_substitutions([solver.settings.solver]),
            ),
        )
        status = EpisodeStatus.FAILED if unsolved else EpisodeStatus.SUCCEEDED
        return measured_record(
            spec, status, "unsolved" if unsolved else "solved", report=report, folder=folder, watch=watch
        )

    def setup_key(self, settings: KinematicsSettings) -> tuple[Any, ...]:
        """Returns the settings of the solver."""
        return settings.robot, settings.group, settings.solver, settings.timeout, settings.parameters

    def prepare(self, settings: KinematicsSettings) -> InverseKinematics:
        """Returns the solver after a first solution, which takes longer than later solutions."""
        robot = self.robot(settings.robot)
        group = robot.chain(settings.group)
        check_solver(settings.solver)
        solver = InverseKinematics(robot.model, group, _solver_settings(robot, settings))
        if settings.solver == CLOSED_FORM and solver.method == NUMERIC:
            raise ModeError(f"solver '{CLOSED_FORM}': group '{group.name}' has no closed form; leave the key out")
        solver.solutions(
            group.tip_link, _reachable_pose(robot, group, np.random.default_rng(0)), _default_positions(robot)
        )
        return solver


def check_solver(name: str) -> None:
    """Raises ModeError if the setting `solver` is not one of SOLVERS."""
    if name not in SOLVERS:
        raise ModeError(f"solver '{name}'; allowed: {', '.join(filter(None, SOLVERS))}")


def solver_parameters(parameters: Mapping[str, Any], group: str) -> dict[str, Any]:
    """Returns the solver settings of a group that ROS parameters override, keyed as in kinematics.yaml.

    Raises:
        ModeError: A parameter is not below the group's name in robot_description_kinematics.
        PlanningError: A value is not allowed.
    """
    group_parameters = parameters_below(parameters, (f"/robot_description_kinematics/{group}/",))
    settings_from({group: group_parameters})
    return group_parameters


def _solver_settings(robot: Robot, settings: KinematicsSettings) -> SolverSettings:
    group = settings.group
    result = robot.kinematics.get(group, SolverSettings())
    parameters = solver_parameters(settings.parameters, group)
    if parameters:
        result = settings_from({group: {"kinematics_solver": result.solver, **parameters}})[group]
    return replace(result, solver=settings.solver) if settings.solver else result


def _default_positions(robot: Robot) -> Array:
    return robot.model.default_positions()


def _reachable_pose(robot: Robot, group: JointGroup, generator: np.random.Generator) -> Transform:
    """Returns the pose of the tip at random joint values, within pi of zero."""
    model, positions = robot.model, _default_positions(robot)
    lower, upper = np.maximum(model.lower[group.indices], -np.pi), np.minimum(model.upper[group.indices], np.pi)
    positions[group.indices] = generator.uniform(lower, upper)
    return model.link_transforms(model.with_mimics(positions))[group.tip_link]


def _solve_poses(robot: Robot, solver: InverseKinematics, settings: KinematicsSettings, seed: int) -> list[_PoseResult]:
    generator = np.random.default_rng(seed)
    results = []
    for _ in range(settings.poses):
        target = _reachable_pose(robot, solver.group, generator)
        start = time.perf_counter()
        solutions = solver.solutions(
            solver.group.tip_link, target, _default_positions(robot), timeout_s=settings.timeout
        )
        results.append(_check_solution(robot, solver.group.tip_link, target, solutions, time.perf_counter() - start))
    return results


def _check_solution(robot: Robot, tip: str, target: Transform, solutions: list[Array], time_s: float) -> _PoseResult:
    """Returns the errors of the first solution, computed by forward kinematics.

    Args:
        robot: Robot.
        tip: Tip link.
        target: Target pose of the tip.
        solutions: Solutions, each of shape (joints of the robot,).
        time_s: Solving time [s].
    """
    if not solutions:
        return _PoseResult(time_s, 0, np.inf, np.inf)
    reached = robot.model.link_transforms(solutions[0])[tip]
    model, values = robot.model, solutions[0]
    within_limits = bool(((values >= model.lower - 1e-9) & (values <= model.upper + 1e-9)).all())
    error = pin.log3(target.rotation.T @ reached.rotation)
    position_error = float(np.linalg.norm(reached.translation - target.translation)) if within_limits else np.inf
    return _PoseResult(time_s, len(solutions), position_error, float(np.linalg.norm(error)))


def _figures(results: list[_PoseResult]) -> dict[Figure, float]:
    """Returns the figures of `metrics.kinematics`; errors require a solved pose."""
    solved = [result for result in results if result.is_solved]
    figures = {
        SOLVED_SHARE: len(solved) / len(results),
        SOLVING_TIME: float(np.median([result.time_s for result in results])),
        SOLUTIONS: float(np.mean([result.solutions for result in results])),
    }
    if solved:
        figures[POSITION_ERROR] = max(result.position_error_m for result in solved)
        figures[ROTATION_ERROR] = max(result.rotation_error_rad for result in solved)
    return figures
