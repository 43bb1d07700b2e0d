# SPDX-License-Identifier: BSD-3-Clause
"""Replaces a start state that violates the path constraints with the nearest state that satisfies the constraints."""

from __future__ import annotations

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.planning_pipeline.adapters.path_prefix import with_path_prefix
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter


class FixStartStatePathConstraints(RequestAdapter):
    """Prepends a collision-free straight-line motion to a state that satisfies the path constraints."""

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans from the nearest state that satisfies the path constraints."""
        constraints = problem.constraints
        if constraints is None or constraints.are_satisfied(problem.start):
            return plan_next(problem)
        indices = problem.group.indices
        nearest = constraints.project(problem.start, indices)
        if nearest is None or not problem.motion.edge_is_free(
            problem.start[indices], nearest[indices], problem.settings.motion_step
        ):
            raise PlanningError(
                ErrorCode.START_STATE_VIOLATES_PATH_CONSTRAINTS,
                "start state: "
                f"{constraints.describe(problem.start)}; no collision-free straight-line motion reaches a state "
                "that satisfies the path constraints; choose a different start state",
            )
        path = plan_next(problem.with_start(nearest))
        return with_path_prefix(problem, path)
