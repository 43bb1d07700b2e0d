# SPDX-License-Identifier: BSD-3-Clause
"""Base class of request adapters, and the adapter chain of a pipeline."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem


class RequestAdapter:
    """Modifies the problem before planning or the path after planning.

    Adapters are created without arguments and are stateless, because threads share them.
    """

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans with the remaining adapters and the planner.

        Args:
            problem: Planning problem, modified by the outer adapters; parameters are in `problem.settings`.
            plan_next: Inner adapters and planner.

        Raises:
            PlanningError: Planning failed; gives error code and reason.
        """
        return plan_next(problem)


def chain(adapters: Sequence[RequestAdapter], planner: PlanNext) -> PlanNext:
    """Returns the planner wrapped in all adapters; the first adapter is outermost."""
    result = planner
    for adapter in reversed(adapters):
        result = partial(adapter.adapt_and_plan, plan_next=result)
    return result
