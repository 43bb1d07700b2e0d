# SPDX-License-Identifier: BSD-3-Clause
"""What a state of a motion costs: depth in obstacles, violation of path constraints."""
from __future__ import annotations

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_collision import World
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.stomp.compiled_costs import cover_of, depths
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem

WIDEST_SPHERE = 0.07  # [m]; of those that stand for the bodies
DEPTH_WEIGHT = 10.0  # with 1, grazing an obstacle for a few states costs less than the accelerations of a detour


class StateCosts:
    """Costs of states; whether a state is valid is decided by the exact check."""

    def __init__(self, problem: PlanningProblem) -> None:
        self._problem = problem
        self._world = problem.checker.world
        self._cover = cover_of(self._world, WIDEST_SPHERE)

    def __call__(self, values: Array) -> Array:
        """Returns costs of joint vectors (n, joints), shape (n,)."""
        states = self._problem.motion.full_path(values)
        costs = DEPTH_WEIGHT * np.asarray(depths(self._world, self._cover, states))
        if self._problem.constraints is not None:
            costs += [self._violation(row) for row in values]
        return costs

    def _violation(self, values: Array) -> float:
        constraints = self._problem.constraints
        assert constraints is not None
        results = constraints.evaluate(self._problem.motion.full_positions(values))
        return float(sum(1.0 + item.distance for item in results if not item.satisfied))


def warm_up(world: World) -> None:
    """Compiles the loops of this module, or loads them; any world will do."""
    depths(world, cover_of(world, WIDEST_SPHERE), np.zeros((1, len(world.tree.parents))))
