# SPDX-License-Identifier: BSD-3-Clause
"""A search under path constraints that random states rarely satisfy: each step is projected onto the constraints.

Two trees grow from the start and from the goals as in CBiRRT (Berenson, Srinivasa, Ferguson, Kuffner: Manipulation
planning on constraint manifolds, ICRA 2009): a tree steps towards a target, projects the step onto the constraints and
keeps it while it comes nearer; then the other tree tries to reach what was added.
"""

from __future__ import annotations

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanningProblem, no_path

STEP = 0.1  # [rad or m] of a tree, before projection
TIGHT_SHARE = 0.1  # constraints that fewer of the random states satisfy are searched by projection
SAMPLES = 100
NAME = "CBiRRT"


def constraints_are_tight(problem: PlanningProblem) -> bool:
    """Whether hardly any random state satisfies the path constraints."""
    constraints = problem.constraints
    if constraints is None:
        return False
    low, high = problem.search_bounds(problem.start_values[None])
    states = problem.rng.uniform(low, high, (SAMPLES, len(low)))
    kept = sum(constraints.satisfied(problem.motion.full_positions(values)) for values in states)
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
        return int(np.argmin(((self.values - values) ** 2).sum(axis=1)))

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
            step: distance of collision checks along an edge [rad or m].
            goals: others than the problem's.
            most_states: how many states to try.
        """
        self._problem, self._step, self._goals, self._most_states = problem, step, goals, most_states
        self._low, self._high = problem.search_bounds(problem.start_values[None])
        self._states = 0

    def run(self) -> PlannedPath:
        """Returns a path whose edges satisfy the constraints; raises PlanningError when time or states are used up."""
        problem = self._problem
        grown, other = (
            _Tree(problem.start_values[None, :]),
            _Tree(problem.goal_states() if self._goals is None else self._goals),
        )
        forward = True
        while not self._ends():
            target = problem.rng.uniform(self._low, self._high)
            reached = self._grow(grown, target)
            met = self._grow(other, grown.values[reached])
            if np.abs(other.values[met] - grown.values[reached]).max() < 1e-9:
                first, last = grown.branch(reached), other.branch(met)
                if not forward:
                    first, last = last, first
                return PlannedPath(np.vstack([first, last[::-1][1:]]), planner_id=NAME)
            grown, other, forward = other, grown, not forward
        raise no_path(problem, NAME, self._states)

    def _ends(self) -> bool:
        return self._states >= self._most_states or self._problem.interrupted()

    def _grow(self, tree: _Tree, target: Array) -> int:
        """Steps from the nearest vertex to a target as far as that goes; returns the last vertex."""
        number = tree.nearest(target)
        while not self._ends():
            here = tree.values[number].copy()
            gap = target - here
            distance = float(np.linalg.norm(gap))
            if distance < 1e-9:
                break
            following = self._step_to(here, target if distance <= STEP else here + STEP / distance * gap)
            if following is None or np.linalg.norm(target - following) >= distance - 1e-6:
                break
            number = tree.add(following, number)
        return number

    def _step_to(self, here: Array, wanted: Array) -> Array | None:
        """Returns the projected step, or None where it is not valid; halved where the edge leaves the constraints."""
        problem = self._problem
        assert problem.constraints is not None
        for _ in range(4):
            self._states += 1
            full = problem.motion.full_positions(wanted)
            if not problem.constraints.satisfied(full):
                projected = problem.constraints.project(full, problem.group.indices)
                if projected is None:
                    return None
                wanted = projected[problem.group.indices]
            if np.linalg.norm(wanted - here) > 2.0 * STEP or not problem.motion.state_is_free(wanted):
                return None
            if problem.edge_is_valid(here, wanted, self._step):
                return wanted
            wanted = 0.5 * (here + wanted)
        return None
