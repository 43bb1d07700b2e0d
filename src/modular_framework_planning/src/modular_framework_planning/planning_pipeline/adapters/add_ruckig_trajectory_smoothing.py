# SPDX-License-Identifier: BSD-3-Clause
"""Jerk limits under the name of MoveIt's adapter: replaces the trajectory by its moving average or a slower one."""

from __future__ import annotations

from dataclasses import replace

from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.planning_pipeline.adapters.add_time_optimal_parameterization import time_path
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter
from modular_framework_planning.trajectory_processing.jerk_limits import (
    averaged_curve,
    required_jerk_slowdown,
    slowed_to_limits,
)


class AddRuckigTrajectorySmoothing(RequestAdapter):
    """Limits the jerk to `max_jerk` of joint_limits.yaml (has_jerk_limits), 1000 rad/s^3 by default.

    The result is the moving average if it is faster than the uniformly slowed trajectory and passes the validation;
    otherwise, it is the slowed trajectory.
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
        slowed = slowed_to_limits(timed.trajectory, *limits)
        averaged = replace(timed, trajectory=averaged_curve(timed.trajectory, *limits))
        assert averaged.trajectory is not None
        is_faster = averaged.trajectory.duration_s < slowed.duration_s
        if is_faster and problem.solution_validator.is_valid(problem, averaged):
            return averaged
        return replace(timed, trajectory=slowed)
