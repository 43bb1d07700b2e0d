# SPDX-License-Identifier: BSD-3-Clause
"""Pulls a start state that is slightly beyond a joint's bounds back onto them."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.planning_pipeline.adapters.path_prefix import with_path_prefix
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter

NEGLIGIBLE = 1.0e-6  # [rad or m]; a start this near to its bounds is taken as being on them


class FixStartStateBounds(RequestAdapter):
    """Parameter `start_state_max_bounds_error` [rad or m]: how far beyond a bound a start is corrected."""

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans from the nearest state within bounds; the motion begins where the robot is."""
        indices = problem.group.indices
        inner = np.clip(problem.start[indices], *problem.bounds)
        beyond = np.abs(problem.start[indices] - inner).max()
        if beyond > problem.settings.start_state_max_bounds_error:
            faults = "; ".join(problem.model.bound_violations(problem.start, indices, bounds=problem.bounds))
            raise PlanningError(
                ErrorCode.START_STATE_INVALID,
                f"start state: {faults}; at most "
                f"{problem.settings.start_state_max_bounds_error} beyond a bound is pulled back",
            )
        if beyond == 0.0:
            return plan_next(problem)
        start = problem.start.copy()
        start[indices] = inner
        path = plan_next(problem.with_start(start))
        return path if beyond < NEGLIGIBLE else with_path_prefix(problem, path)
