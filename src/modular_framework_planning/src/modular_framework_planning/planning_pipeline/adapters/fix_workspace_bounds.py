# SPDX-License-Identifier: BSD-3-Clause
"""Default workspace of requests without a workspace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.planning_interface.planning_request import Workspace
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter


class FixWorkspaceBounds(RequestAdapter):
    """Adds a cube around the origin of the planning frame with edge length `default_workspace_bounds` [m]."""

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans within the workspace of the request or the default workspace."""
        if problem.request.workspace is not None:
            return plan_next(problem)
        half = np.full(3, 0.5 * problem.settings.default_workspace_bounds)
        return plan_next(replace(problem, request=replace(problem.request, workspace=Workspace(-half, half))))
