# SPDX-License-Identifier: BSD-3-Clause
"""Jerk limits: replaces the trajectory by the fastest of several smooth trajectories that passes the validation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.planning_pipeline.adapters.add_time_optimal_parameterization import time_path
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter
from modular_framework_planning.trajectory_processing.jerk_limits import (
    along_straight_lines,
    averaged_curve,
    required_jerk_slowdown,
    slowed_to_limits,
)
from modular_framework_planning.trajectory_processing.trajectory import Trajectory


class AddRuckigTrajectorySmoothing(RequestAdapter):
    """Limits the jerk to `max_jerk` of joint_limits.yaml (has_jerk_limits), 1000 rad/s^3 by default.

    Candidates are the trajectory slowed down uniformly, its moving average and, unless the shape must be kept, Ruckig's
    motion along the straight lines of the path with a stop at each vertex.
    """

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans and smooths the motion, unless it already satisfies the jerk limits."""
        path = plan_next(problem)
        timed = path if path.trajectory is not None else time_path(problem, path)
        assert timed.trajectory is not None
        jerk = problem.model.max_jerk[problem.group.indices]
        limits = problem.max_velocity, problem.max_acceleration, jerk
        if required_jerk_slowdown(timed.trajectory, *limits) <= 1.0:
            return timed
        candidates = [replace(timed, trajectory=item) for item in self._candidates(problem, timed)]
        for candidate in sorted(candidates, key=_duration):
            if problem.solution_validator.is_valid(problem, candidate):
                return candidate
        return replace(timed, trajectory=slowed_to_limits(timed.trajectory, *limits))

    @staticmethod
    def _candidates(problem: PlanningProblem, path: PlannedPath) -> Iterator[Trajectory]:
        assert path.trajectory is not None
        limits = (problem.max_velocity, problem.max_acceleration, problem.model.max_jerk[problem.group.indices])
        yield slowed_to_limits(path.trajectory, *limits)
        yield averaged_curve(path.trajectory, *limits)
        if not path.keep_shape:
            yield along_straight_lines(path.trajectory.joint_names, path.vertices, *limits)


def _duration(path: PlannedPath) -> float:
    assert path.trajectory is not None
    return path.trajectory.duration_s
