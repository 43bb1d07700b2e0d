# SPDX-License-Identifier: BSD-3-Clause
"""Correction of a start state that is slightly out of bounds."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.planning_pipeline.adapters.path_prefix import with_path_prefix
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter

BOUNDS_TOLERANCE = 1.0e-6  # bounds violation that is corrected without a path prefix [rad or m]


class FixStartStateBounds(RequestAdapter):
    """Moves the start into bounds, up to the parameter `start_state_max_bounds_error` [rad or m]."""

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans from the nearest state within bounds; the motion starts at the robot's position."""
        indices = problem.group.indices
        clipped = np.clip(problem.start[indices], *problem.bounds)
        violation = np.abs(problem.start[indices] - clipped).max()
        if violation > problem.settings.start_state_max_bounds_error:
            faults = "; ".join(problem.model.bound_violations(problem.start, indices, bounds=problem.bounds))
            raise PlanningError(
                ErrorCode.START_STATE_INVALID,
                f"start state: {faults}; a violation of at most "
                f"{problem.settings.start_state_max_bounds_error} is corrected (start_state_max_bounds_error)",
            )
        if violation == 0.0:
            return plan_next(problem)
        start = problem.start.copy()
        start[indices] = clipped
        path = plan_next(problem.with_start(start))
        return path if violation < BOUNDS_TOLERANCE else with_path_prefix(problem, path)
