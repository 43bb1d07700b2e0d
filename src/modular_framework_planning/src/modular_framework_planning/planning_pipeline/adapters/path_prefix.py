# SPDX-License-Identifier: BSD-3-Clause
"""Path prefix from the robot's start state to the corrected start state of a plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanningProblem
from modular_framework_planning.trajectory_processing.time_parameterization import parameterize
from modular_framework_planning.trajectory_processing.trajectory import Trajectory


def with_path_prefix(problem: PlanningProblem, path: PlannedPath, collides: bool = False) -> PlannedPath:
    """Returns the path with the problem's start prepended.

    Args:
        problem: Planning problem with the robot's start state.
        path: Path planned from the corrected start state.
        collides: Whether the prefix may collide.

    Raises:
        PlanningError: The path has a trajectory, and the prefix takes longer than `start_state_max_dt`.
    """
    start = problem.start_values
    result = replace(
        path,
        vertices=np.vstack([start, path.vertices]),
        unconstrained_prefix=path.unconstrained_prefix + 1,
        path_prefix=path.path_prefix + 1 if collides or path.path_prefix else 0,
    )
    if path.trajectory is None or np.abs(path.vertices[0] - start).max() < 1e-9:
        return result
    return replace(result, trajectory=_with_prefix(problem, start, path.trajectory))


def _with_prefix(problem: PlanningProblem, start: Array, trajectory: Trajectory) -> Trajectory:
    prefix = parameterize(
        problem.group.joints,
        np.vstack([start, trajectory.positions[0]]),
        np.zeros(0),
        problem.max_velocity,
        problem.max_acceleration,
    )
    max_duration_s = problem.settings.start_state_max_dt
    if prefix.duration_s > max_duration_s:
        raise PlanningError(
            ErrorCode.START_STATE_INVALID,
            f"start state: the motion to the corrected start state "
            f"takes {prefix.duration_s:.2f} s; start_state_max_dt allows {max_duration_s} s",
        )
    return Trajectory(
        trajectory.joint_names,
        np.concatenate([prefix.times, prefix.duration_s + trajectory.times[1:]]),
        np.vstack([prefix.positions, trajectory.positions[1:]]),
        np.vstack([prefix.velocities, trajectory.velocities[1:]]),
        np.vstack([prefix.accelerations, trajectory.accelerations[1:]]),
    )
