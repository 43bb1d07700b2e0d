# SPDX-License-Identifier: BSD-3-Clause
"""Planning under path constraints, including constraints that random states rarely satisfy.

Two trees grow from the start and from the goals as in CBiRRT (Berenson, Srinivasa, Ferguson, Kuffner: Manipulation
planning on constraint manifolds, ICRA 2009). The smaller tree walks towards a random state and projects each step onto
the constraints until a step comes no nearer; then the other tree walks towards the state reached. Walks are compiled.
"""

from __future__ import annotations

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanningProblem, no_path

TIGHT_FRACTION = 0.1  # constraints are tight if a smaller fraction of random states satisfies them
TIGHTNESS_SAMPLES = 100
STATES_PER_CHECK = 4  # maximum number of states of a walk between two collision checks
NAME = "CBiRRT"


def constraints_are_tight(problem: PlanningProblem) -> bool:
    """Checks whether hardly any random state satisfies the path constraints."""
    constraints = problem.constraints
    if constraints is None:
        return False
    low, high = problem.search_bounds(problem.start_values[None])
    states = problem.rng.uniform(low, high, (TIGHTNESS_SAMPLES, len(low)))
    satisfying = sum(constraints.are_satisfied(state) for state in problem.motion.full_path(states))
    return satisfying < TIGHT_FRACTION * TIGHTNESS_SAMPLES


class _Tree:
    """A search tree of joint vectors."""

    def __init__(self, roots: Array) -> None:
        self._values = np.empty((256, roots.shape[1]))
        self._values[: len(roots)] = roots
        self._parents = [-1] * len(roots)

    @property
    def values(self) -> Array:
        """Vertices, shape (n, joints)."""
        return self._values[: len(self._parents)]

    def add(self, values: Array, parent: int) -> int:
        """Adds a vertex and returns its index."""
        index = len(self._parents)
        if index == len(self._values):
            self._values = np.vstack([self._values, np.empty_like(self._values)])
        self._values[index] = values
        self._parents.append(parent)
        return index

    def nearest(self, values: Array) -> int:
        """Returns the index of the vertex nearest to a joint vector."""
        return int(np.square(self.values - values).sum(axis=1).argmin())

    def branch(self, index: int) -> Array:
        """Returns the vertices from the root to a vertex."""
        chain = []
        while index >= 0:
            chain.append(self._values[index])
            index = self._parents[index]
        return np.array(chain[::-1])


class ConstrainedSearch:
    """A bidirectional search along the path constraints of a problem."""

    def __init__(
        self, problem: PlanningProblem, step: float, goals: Array | None = None, max_states: float = np.inf
    ) -> None:
        """Stores the problem.

        Args:
            problem: Problem with path constraints.
            step: Distance between checks along an edge [rad or m].
            goals: Goal joint vectors, shape (n, joints) [rad or m]; None for the goals of the problem.
            max_states: Maximum number of states to try.
        """
        self._problem, self._step, self._goals, self._max_states = problem, step, goals, max_states
        self._low, self._high = problem.search_bounds(problem.start_values[None])
        self._motion = problem.constrained_motion(step)
        self._states = 0

    def run(self) -> PlannedPath:
        """Returns a path whose edges satisfy the constraints.

        Raises:
            PlanningError: The time or the states are used up.
        """
        problem = self._problem
        goals = problem.goal_states() if self._goals is None else self._goals
        trees = _Tree(problem.start_values[None, :]), _Tree(goals)
        while not self._is_over():
            forward = len(trees[0].values) <= len(trees[1].values)  # both ends are explored equally
            growing, other = trees if forward else trees[::-1]
            reached = self._grow(growing, problem.rng.uniform(self._low, self._high))
            connected = self._grow(other, growing.values[reached])
            if np.array_equal(other.values[connected], growing.values[reached]):
                ends = (reached, connected) if forward else (connected, reached)
                first, last = (tree.branch(end) for tree, end in zip(trees, ends, strict=True))
                return PlannedPath(np.vstack([first, last[::-1][1:]]), planner_id=NAME)
        raise no_path(problem, NAME, self._states)

    def _is_over(self) -> bool:
        return self._states >= self._max_states or self._problem.interrupted()

    def _grow(self, tree: _Tree, target: Array) -> int:
        """Extends the tree towards a target as far as possible; returns the index of the last vertex."""
        index = tree.nearest(target)
        while not self._is_over():
            states = self._motion.steps_towards(tree.values[index].copy(), target, STATES_PER_CHECK)
            self._states += max(1, len(states))  # an empty walk also counts, so that the search ends
            for state in states:
                if not self._problem.motion.edge_is_free(tree.values[index], state, self._step):
                    return index
                index = tree.add(state, index)
            if len(states) < STATES_PER_CHECK:
                break
        return index
