# SPDX-License-Identifier: BSD-3-Clause
"""A search under path constraints, also such that random states rarely satisfy: each step is projected onto them.

Two trees grow from the start and from the goals as in CBiRRT (Berenson, Srinivasa, Ferguson, Kuffner: Manipulation
planning on constraint manifolds, ICRA 2009): the smaller one walks towards a random state, projects each step onto the
constraints and keeps it while it comes nearer; then the other one walks to what was reached. The walks are compiled.
"""

from __future__ import annotations

import numpy as np

from modular_framework_planning.constraints.compiled_constraints import nearest_state
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanningProblem, no_path

TIGHT_SHARE = 0.1  # constraints that fewer of the random states satisfy are searched by projection
SAMPLES = 100
STATES_AT_ONCE = 4  # of a walk, between two checks for collisions
NAME = "CBiRRT"


def constraints_are_tight(problem: PlanningProblem) -> bool:
    """Whether hardly any random state satisfies the path constraints."""
    constraints = problem.constraints
    if constraints is None:
        return False
    low, high = problem.search_bounds(problem.start_values[None])
    states = problem.rng.uniform(low, high, (SAMPLES, len(low)))
    kept = sum(constraints.satisfied(state) for state in problem.motion.full_path(states))
    return kept < TIGHT_SHARE * SAMPLES


class _Tree:
    """Joint vectors with their parents."""

    def __init__(self, roots: Array) -> None:
        self._values = np.empty((256, roots.shape[1]))
        self._values[: len(roots)] = roots
        self._parents = [-1] * len(roots)

    @property
    def values(self) -> Array:
        """The vertices, shape (n, joints)."""
        return self._values[: len(self._parents)]

    def add(self, values: Array, parent: int) -> int:
        """Adds a vertex; returns its number."""
        number = len(self._parents)
        if number == len(self._values):
            self._values = np.vstack([self._values, np.empty_like(self._values)])
        self._values[number] = values
        self._parents.append(parent)
        return number

    def nearest(self, values: Array) -> int:
        """Returns the number of the vertex nearest to a joint vector."""
        return int(nearest_state(self.values, values))

    def branch(self, number: int) -> Array:
        """Returns the vertices from the root to a vertex."""
        chain = []
        while number >= 0:
            chain.append(self._values[number])
            number = self._parents[number]
        return np.array(chain[::-1])


class ConstrainedSearch:
    """One search."""

    def __init__(
        self, problem: PlanningProblem, step: float, goals: Array | None = None, most_states: float = np.inf
    ) -> None:
        """Stores the problem.

        Args:
            problem: with constraints.
            step: distance of checks along an edge [rad or m].
            goals: others than the problem's.
            most_states: how many states to try.
        """
        self._problem, self._step, self._goals, self._most_states = problem, step, goals, most_states
        self._low, self._high = problem.search_bounds(problem.start_values[None])
        self._motion = problem.constrained_motion(step)
        self._states = 0

    def run(self) -> PlannedPath:
        """Returns a path whose edges satisfy the constraints; raises PlanningError when time or states are used up."""
        problem = self._problem
        goals = problem.goal_states() if self._goals is None else self._goals
        trees = _Tree(problem.start_values[None, :]), _Tree(goals)
        while not self._ends():
            forward = len(trees[0].values) <= len(trees[1].values)  # the tree in the narrower place keeps up
            grown, other = trees if forward else trees[::-1]
            reached = self._grow(grown, problem.rng.uniform(self._low, self._high))
            met = self._grow(other, grown.values[reached])
            if np.array_equal(other.values[met], grown.values[reached]):
                ends = (reached, met) if forward else (met, reached)
                first, last = (tree.branch(end) for tree, end in zip(trees, ends, strict=True))
                return PlannedPath(np.vstack([first, last[::-1][1:]]), planner_id=NAME)
        raise no_path(problem, NAME, self._states)

    def _ends(self) -> bool:
        return self._states >= self._most_states or self._problem.interrupted()

    def _grow(self, tree: _Tree, target: Array) -> int:
        """Walks from the nearest vertex to a target as far as that goes; returns the last vertex."""
        number = tree.nearest(target)
        while not self._ends():
            states = self._motion.steps_towards(tree.values[number].copy(), target, STATES_AT_ONCE)
            self._states += max(1, len(states))  # a walk that ends at once counts, too: the count may end the search
            for state in states:
                if not self._problem.motion.edge_is_free(tree.values[number], state, self._step):
                    return number
                number = tree.add(state, number)
            if len(states) < STATES_AT_ONCE:
                break
        return number
