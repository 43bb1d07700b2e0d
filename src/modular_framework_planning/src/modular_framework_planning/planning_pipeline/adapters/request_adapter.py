# SPDX-License-Identifier: BSD-3-Clause
"""One step around a planner, and the chain of them that a pipeline runs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem


class RequestAdapter:
    """Changes the problem before, or the path after planning.

    An adapter is made without arguments and keeps nothing between requests: threads share it.
    """

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans through the rest of the chain.

        Args:
            problem: the request as the outer adapters changed it; parameters are in `problem.settings`.
            plan_next: the inner adapters and the planner.

        Raises:
            PlanningError: with code and reason.
        """
        return plan_next(problem)


def chain(adapters: Sequence[RequestAdapter], planner: PlanNext) -> PlanNext:
    """Returns the planner with all adapters around it, the first one outermost."""
    result = planner
    for adapter in reversed(adapters):
        result = partial(adapter.adapt_and_plan, plan_next=result)
    return result
