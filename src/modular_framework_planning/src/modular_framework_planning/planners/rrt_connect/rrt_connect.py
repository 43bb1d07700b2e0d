# SPDX-License-Identifier: BSD-3-Clause
"""RRT-Connect on the arrays of a collision checker that offers them; other checkers and constraints need OMPL's."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_collision import World, arguments
from modular_framework_planning.collision_detection.reaches import reaches
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.rrt_connect.compiled_rrt_connect import (
    BLOCKED,
    EXTENDS,
    FOUND,
    FREE,
    NEEDS_ROOM,
    NEEDS_SAMPLES,
    NEW,
    UNDECIDED,
    UNKNOWN,
    Space,
    Trees,
    grow,
    write_step,
)
from modular_framework_planning.planning_interface.collision_checker import CompiledChecks
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem

SAMPLES = 32  # that are drawn at once
LEAST_WEIGHT = 0.1  # of a joint in a length, also of one that carries nothing: it turns ten times the range at most
ROOM = 1024  # of states in a tree, to begin with


def can_search(problem: PlanningProblem) -> bool:
    """Whether a problem has no path constraints and a checker whose arrays decide all pairs."""
    checker = problem.checker
    return problem.constraints is None and isinstance(checker, CompiledChecks) and checker.compiled_world is not None


def warm_up(checker: CompiledChecks, positions: Array) -> None:
    """Compiles the loop, or loads it from the cache.

    Args:
        checker: of a scene.
        positions: of the whole robot.
    """
    space = Space(np.ones(1), 1.0, 0.1, positions, np.zeros((len(positions), 1)))
    assert checker.compiled_world is not None
    grow(_trees(np.zeros(1), np.ones((1, 1))), space, np.zeros((1, 1)), UNKNOWN, *arguments(checker.compiled_world))


def _trees(start: Array, goals: Array) -> Trees:
    states = np.empty((2, max(ROOM, 2 * len(goals)), len(start)))
    states[0, 0], states[1, : len(goals)] = start, goals
    return Trees(
        states,
        np.full(states.shape[:2], -1),
        np.array([1, len(goals)]),
        np.array([0, 0, EXTENDS, NEW]),
        start.copy(),
        np.zeros(1, np.int64),
    )


class RrtConnect:
    """One search."""

    def __init__(
        self,
        problem: PlanningProblem,
        goals: Array,
        step: float,
        longest: float,
        limit: int | None = None,
        is_weighted: bool = True,
    ) -> None:
        """Stores what to search.

        Args:
            problem: for which `can_search` holds.
            goals: joint vectors to reach, shape (n, joints).
            step: distance of collision checks along an edge [rad or m].
            longest: most a tree grows by at once, in weighted length if `is_weighted` [rad or m].
            limit: of random states; None: the clock ends the search.
            is_weighted: whether joints count in a length by the root of their reach, the one that reaches farthest as
                1; else all count as 1. A wrist then turns further in one step than a shoulder.
        """
        self._problem, self._limit = problem, limit
        start = problem.start_values
        self._low, self._high = problem.search_bounds(np.vstack([start, goals]))
        checker = problem.checker
        assert isinstance(checker, CompiledChecks) and checker.compiled_world is not None
        self._world = arguments(checker.compiled_world)
        self._space = self._space_of(checker.compiled_world, step, longest, is_weighted)
        self._trees = _trees(start, goals)

    @property
    def states(self) -> int:
        """How many edges were checked."""
        return int(self._trees.counts[0])

    @property
    def tree_sizes(self) -> tuple[int, int]:
        """How many states the trees from the start and from the goals have."""
        return int(self._trees.sizes[0]), int(self._trees.sizes[1])

    def run(self) -> Array | None:
        """Returns vertices of shape (n, joints) from the start to one of the goals, or None."""
        problem = self._problem
        samples, verdict, drawn = np.empty((0, len(self._low))), UNKNOWN, 0
        while True:
            status = grow(self._trees, self._space, samples, verdict, *self._world)
            verdict = UNKNOWN
            if status == FOUND:
                # a search that the clock ends is not repeatable
                return None if problem.repeatable and problem.interrupted() else self._vertices()
            if problem.interrupted():
                return None
            if status == NEEDS_ROOM:
                self._add_room()
            elif status == NEEDS_SAMPLES:
                count = SAMPLES if self._limit is None else min(SAMPLES, self._limit - drawn)
                if count <= 0:
                    return None
                samples = problem.rng.uniform(self._low, self._high, (count, len(self._low)))
                drawn, self._trees.position[0] = drawn + count, 0
            elif status == UNDECIDED:
                verdict = FREE if self._undecided_edge_is_free() else BLOCKED

    def _space_of(self, world: World, step: float, longest: float, is_weighted: bool) -> Space:
        problem = self._problem
        count = len(self._low)
        rest = problem.motion.full_positions(np.zeros(count))
        columns = [problem.motion.full_positions(row) - rest for row in np.eye(count)]
        motions = np.array(columns).T.copy()
        weights = np.ones(count)
        if is_weighted:
            weights = np.sqrt((np.abs(motions) * reaches(world)[:, None]).max(axis=0))
            weights = np.maximum(weights / (weights.max() or 1.0), LEAST_WEIGHT)
        return Space(weights, longest, step, rest, motions)

    def _undecided_edge_is_free(self) -> bool:
        trees = self._trees
        here, end = trees.states[trees.position[1], trees.position[3]], np.empty_like(trees.target)
        write_step(here, trees.target, self._space, end)
        return self._problem.motion.edge_is_free(here, end, self._space.step)

    def _add_room(self) -> None:
        trees = self._trees
        self._trees = trees._replace(
            states=np.concatenate([trees.states, np.empty_like(trees.states)], axis=1),
            parents=np.concatenate([trees.parents, np.full_like(trees.parents, -1)], axis=1),
        )

    def _vertices(self) -> Array:
        branches = []
        for tree in (0, 1):
            number, branch = int(self._trees.sizes[tree]) - 1, []
            while number >= 0:
                branch.append(self._trees.states[tree, number])
                number = int(self._trees.parents[tree, number])
            branches.append(branch)
        return np.array([*reversed(branches[0]), *branches[1][1:]])
