# SPDX-License-Identifier: BSD-3-Clause
"""Correction of a start state in slight collision by a free state nearby."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.contacts import describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.planning_pipeline.adapters.path_prefix import with_path_prefix
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter


class FixStartStateCollision(RequestAdapter):
    """Samples free states near the start.

    Parameters: `jiggle_fraction`, `max_sampling_attempts` and `start_state_collision_depth` [m].
    """

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans from a free state near a colliding start and prepends the motion to this state."""
        if problem.motion.state_is_free(problem.start_values):
            return plan_next(problem)
        free = self._free_state(problem)
        path = plan_next(problem.with_start(problem.motion.full_positions(free)))
        return with_path_prefix(problem, path, collides=True)

    def _free_state(self, problem: PlanningProblem) -> Array:
        settings, start = problem.settings, problem.start_values
        contacts = problem.checker.contacts(problem.start, include_fixed=False)
        low, high = problem.bounds
        max_offset = settings.jiggle_fraction * np.minimum(high - low, 2.0 * np.pi)
        shallow = all(item.depth <= settings.start_state_collision_depth for item in contacts)
        for attempt in range(settings.max_sampling_attempts if shallow else 0):
            fraction = (attempt + 1) / settings.max_sampling_attempts
            candidate = np.clip(start + fraction * problem.rng.uniform(-max_offset, max_offset), low, high)
            if problem.motion.state_is_free(candidate):
                return candidate
        raise PlanningError(
            ErrorCode.START_STATE_IN_COLLISION,
            "start state is in collision: "
            f"{describe_contacts(contacts)}; "
            + (
                f"no free state was found within {settings.jiggle_fraction:.0%} of the joint ranges"
                if shallow
                else "the contact is too deep to correct; allow the collision or move the object"
            ),
            contacts,
        )
