# SPDX-License-Identifier: BSD-3-Clause
"""Puts a prefix in front of a path: from the real start to the corrected one it was planned from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanningProblem
from modular_framework_planning.trajectory_processing.time_parameterization import parameterize
from modular_framework_planning.trajectory_processing.trajectory import Trajectory


def with_path_prefix(problem: PlanningProblem, path: PlannedPath, collides: bool = False) -> PlannedPath:
    """Returns the path with the problem's start in front.

    Args:
        problem: its start is where the robot is.
        path: planned from a start that was corrected.
        collides: the prefix may collide.

    Raises:
        PlanningError: the path is timed already, and the prefix takes longer than `start_state_max_dt`.
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
    return replace(result, trajectory=_joined(problem, start, path.trajectory))


def _joined(problem: PlanningProblem, start: Array, rest: Trajectory) -> Trajectory:
    prefix = parameterize(
        problem.group.joints,
        np.vstack([start, rest.positions[0]]),
        np.zeros(0),
        problem.max_velocity,
        problem.max_acceleration,
    )
    longest = problem.settings.start_state_max_dt
    if prefix.duration_s > longest:
        raise PlanningError(
            ErrorCode.START_STATE_INVALID,
            f"start state: the way to the first state of the motion "
            f"takes {prefix.duration_s:.2f} s; start_state_max_dt allows {longest} s",
        )
    return Trajectory(
        rest.joint_names,
        np.concatenate([prefix.times, prefix.duration_s + rest.times[1:]]),
        np.vstack([prefix.positions, rest.positions[1:]]),
        np.vstack([prefix.velocities, rest.velocities[1:]]),
        np.vstack([prefix.accelerations, rest.accelerations[1:]]),
    )
