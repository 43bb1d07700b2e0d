# SPDX-License-Identifier: BSD-3-Clause
"""State costs of STOMP: obstacle penetration and path constraint violation."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_penetration import TOUCH_COST_M
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker, CollisionCostEstimator
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem

DEPTH_WEIGHT = 10.0  # with weight 1, grazing an obstacle costs less than the accelerations of a detour


class StateCosts:
    """Cost function of states; validity is decided by the exact check, not by the cost."""

    def __init__(self, problem: PlanningProblem) -> None:
        self._problem = problem

    def __call__(self, values: Array) -> Array:
        """Returns the costs of joint vectors (n, joints), shape (n,)."""
        states = self._problem.motion.full_path(values)
        costs = DEPTH_WEIGHT * collision_costs(self._problem.checker, states)
        if self._problem.constraints is not None:
            costs += [self._violation(row) for row in values]
        return costs

    def _violation(self, values: Array) -> float:
        constraints = self._problem.constraints
        assert constraints is not None
        results = constraints.evaluate(self._problem.motion.full_positions(values))
        return float(sum(1.0 + item.distance for item in results if not item.satisfied))


def collision_costs(checker: CollisionChecker, states: Array) -> Array:
    """Returns the collision costs of robot states (n, joints), shape (n,)."""
    if isinstance(checker, CollisionCostEstimator):
        return checker.collision_costs(states)
    return np.array(
        [sum(item.depth + TOUCH_COST_M for item in checker.contacts(state, include_fixed=False)) for state in states],
        dtype=float,
    )
