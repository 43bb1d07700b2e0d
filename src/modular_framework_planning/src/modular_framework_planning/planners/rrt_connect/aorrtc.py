# SPDX-License-Identifier: BSD-3-Clause
"""AORRTC on the arrays of a collision checker: RRT-Connect again and again, each time for a shorter path.

Edges are checked as finely as the motion is at last: short paths lie near obstacles, and what an edge that was checked
less finely hits there would have to be gone round.

Hauser, Zhou: Asymptotically optimal planning by feasible kinodynamic planning in a state-cost space, IEEE T-RO 2016;
Wilson, Thomason, Kingston, Kavraki, Gammell: AORRTC: Almost-surely asymptotically optimal planning with RRT-Connect,
2025.
"""

from __future__ import annotations

import math

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.rrt_connect.rrt_connect import RrtConnect, SideBySide
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem
from modular_framework_planning.planning_interface.problem_shortening import shortened
from modular_framework_planning.trajectory_processing.path_shortening import path_length

BETTER = 0.995  # each path is at least that much shorter than the one before


class Aorrtc:
    """One search for the shortest path; problem as for RrtConnect."""

    def __init__(self, problem: PlanningProblem, goals: Array, longest: float, limit: int | None = None) -> None:
        """Stores what to search.

        Args:
            problem: for which `can_search` holds.
            goals: joint vectors to reach, shape (n, joints).
            longest: most a tree grows by at once [rad or m].
            limit: of extensions to random states; None: the clock ends the search.
        """
        self._problem, self._goals, self._longest, self._left = problem, goals, longest, limit
        self.states = 0

    def run(self) -> Array | None:
        """Returns vertices of shape (n, joints) from the start to one of the goals, or None.

        It goes on until the time or the extensions are over, or until no path can be much shorter.
        """
        problem, step, best, bound = self._problem, self._problem.settings.finest_step, None, np.inf
        shortest = float(np.linalg.norm(self._goals - problem.start_values, axis=1).min())
        while bound > shortest:
            search = RrtConnect(problem, self._goals, step, self._longest, self._left, is_weighted=False, bound=bound)
            path = SideBySide(problem, [search]).run()
            self.states += search.states
            if self._left is not None:
                self._left -= search.extensions
            if path is None:
                break
            best = shortened(problem, path, math.inf if problem.repeatable else problem.deadline_s, problem.rng)
            bound = BETTER * path_length(best)
        if problem.repeatable and problem.interrupted():
            return None  # a search that the clock ends is not repeatable
        return best
