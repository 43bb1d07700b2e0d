# SPDX-License-Identifier: BSD-3-Clause
"""AORRTC on compiled collision checks: repeated RRT-Connect searches, each for a shorter path.

Edges are checked at the resolution of the final validation. Short paths pass close to obstacles, so a collision missed
by a coarser check would have to be repaired with a detour.

Hauser, Zhou: Asymptotically optimal planning by feasible kinodynamic planning in a state-cost space, IEEE T-RO 2016;
Wilson, Thomason, Kingston, Kavraki, Gammell: AORRTC: Almost-surely asymptotically optimal planning with RRT-Connect,
2025.
"""

from __future__ import annotations

import math

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.rrt_connect.rrt_connect import ParallelSearch, RrtConnect, TreeGrowth
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem
from modular_framework_planning.planning_interface.problem_shortening import shorten_path
from modular_framework_planning.trajectory_processing.path_shortening import path_length

BOUND_FACTOR = 0.995  # length bound of a search, as a fraction of the best path so far


class Aorrtc:
    """An anytime search for the shortest path to one of the goals."""

    def __init__(
        self, problem: PlanningProblem, goals: Array, max_extension: float, extension_limit: int | None = None
    ) -> None:
        """Stores the problem.

        Args:
            problem: Problem that `can_search` accepts.
            goals: Goal joint vectors, shape (n, joints) [rad or m].
            max_extension: Maximum length of a tree extension [rad or m].
            extension_limit: Maximum number of extensions to random states; None for no limit but time.
        """
        self._problem, self._goals, self._max_extension, self._remaining_extensions = (
            problem,
            goals,
            max_extension,
            extension_limit,
        )
        self.checks = 0

    def run(self) -> Array | None:
        """Returns the vertices of the shortest path found, shape (n, joints), or None.

        The search ends when the time or the extensions run out, or when the path is almost as short as a straight line.
        """
        problem, step, best, bound = self._problem, self._problem.settings.finest_step, None, np.inf
        shortest = float(np.linalg.norm(self._goals - problem.start_values, axis=1).min())
        while bound > shortest:
            growth = TreeGrowth(
                check_step=step,
                max_extension=self._max_extension,
                extension_limit=self._remaining_extensions,
                is_weighted=False,
            )
            search = RrtConnect(problem, self._goals, growth, length_bound=bound)
            path = ParallelSearch(problem, [search]).run()
            self.checks += search.checks
            if self._remaining_extensions is not None:
                self._remaining_extensions -= search.extensions
            if path is None:
                break
            best = shorten_path(problem, path, math.inf if problem.repeatable else problem.deadline_s, problem.rng)
            bound = BOUND_FACTOR * path_length(best)
        if problem.repeatable and problem.interrupted():
            return None  # a search stopped by the clock is not repeatable
        return best
