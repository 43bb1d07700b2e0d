# SPDX-License-Identifier: BSD-3-Clause
"""Gives a request without a workspace the default one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.planning_interface.planning_request import Workspace
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter


class FixWorkspaceBounds(RequestAdapter):
    """Parameter `default_workspace_bounds` [m]: edge of the cube around the planning frame's origin."""

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans within a workspace, whatever the request says."""
        if problem.request.workspace is not None:
            return plan_next(problem)
        half = np.full(3, 0.5 * problem.settings.default_workspace_bounds)
        return plan_next(replace(problem, request=replace(problem.request, workspace=Workspace(-half, half))))
