# SPDX-License-Identifier: BSD-3-Clause
"""Gives a path its fastest timing within the limits, with rounded corners where they are free."""
from __future__ import annotations

from dataclasses import replace

import numpy as np

from modular_framework_planning.adapters.request_adapter import RequestAdapter
from modular_framework_planning.blended_path import choose_blends
from modular_framework_planning.errors import PlanningError
from modular_framework_planning.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.time_parameterization import parameterize


class AddTimeOptimalParameterization(RequestAdapter):
    """Times what is not timed yet."""

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans, then times the path; the path without rounded corners where the rounded one fails the last check."""
        path = plan_next(problem)
        return path if path.trajectory is not None else time_path(problem, path)


def time_path(problem: PlanningProblem, path: PlannedPath) -> PlannedPath:
    """Returns the path with a trajectory; raises PlanningError where no timing is found."""
    vertices = path.vertices
    if len(vertices) == 2 and np.abs(vertices[1] - vertices[0]).max() < 1e-9:
        vertices = vertices[1:]
    fine = problem.settings.motion_step
    blends = choose_blends(vertices, problem.settings.blend_deviation,
                           lambda curve: problem.motion.first_collision(curve, fine) is None)
    stops = np.zeros_like(blends)
    if blends.any():
        try:
            timed = replace(path, trajectory=parameterize(problem.group.joints, vertices, blends,
                                                          problem.max_velocity, problem.max_acceleration))
        except PlanningError:
            timed = None
        if timed is not None and not problem.last_check.fault(problem, timed):
            return timed
    return replace(path, trajectory=parameterize(problem.group.joints, vertices, stops, problem.max_velocity,
                                                 problem.max_acceleration))
