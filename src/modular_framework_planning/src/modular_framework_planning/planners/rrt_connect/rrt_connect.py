# SPDX-License-Identifier: BSD-3-Clause
"""RRT-Connect on compiled collision checks; path constraints and other collision checkers need OMPL's RRT-Connect."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_collision import World, arguments
from modular_framework_planning.collision_detection.kernels.compiled_edges import (
    BLOCKED,
    FREE,
    UNKNOWN,
    GroupEdges,
)
from modular_framework_planning.collision_detection.reaches import reaches
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.rrt_connect.compiled_rrt_connect import (
    EDGE_CHECKS,
    EDGES_PER_CALL,
    EXTEND,
    EXTENSIONS,
    FOUND,
    LIMIT_REACHED,
    NEAREST,
    NEAREST_UNKNOWN,
    NEEDS_CAPACITY,
    NEEDS_SAMPLES,
    NEXT_PAUSE,
    PAUSED,
    SAMPLE,
    TREE,
    UNDECIDED,
    Space,
    Trees,
    grow,
    write_step,
)
from modular_framework_planning.planning_interface.collision_checker import CompiledChecks
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem
from modular_framework_planning.trajectory_processing.path_shortening import path_length

SAMPLE_BATCH = 256  # most samples fall outside the dynamic domain and are rejected cheaply
MIN_WEIGHT = 0.1  # lower limit of a joint's weight; limits the joint motion of an extension to ten times the range
INITIAL_TREE_CAPACITY = 1024
# The squared radius of the dynamic domain lies DOMAIN_DEVIATIONS standard deviations below the mean squared distance of
# two random states, because in 14 dimensions hardly any sample lies within a few extensions. The radius is at least
# MIN_DOMAIN_EXTENSIONS extensions (as in VAMP). Tuned on MotionBenchMaker's problems of a UR5, a Panda, a Fetch and a
# two-armed Baxter.
MIN_DOMAIN_EXTENSIONS, DOMAIN_DEVIATIONS = 4.0, 1.72
FULL_BOUNDS_PERIOD = 8  # period [batches] of samples over the full bounds, not only around start and goal


def can_search(problem: PlanningProblem) -> bool:
    """Checks that a problem has no path constraints and that compiled checks cover all body pairs."""
    return problem.compiled_world is not None


def warm_up(checker: CompiledChecks, positions: Array) -> None:
    """Compiles the loop or loads it from the cache.

    Args:
        checker: Collision checker of any scene.
        positions: Positions of the whole robot [rad or m].
    """
    space = Space(np.ones(1), 1.0, 1.0, np.inf, GroupEdges(positions, np.zeros((len(positions), 1)), 0.1))
    assert checker.compiled_world is not None
    grow(_trees(np.zeros(1), np.ones((1, 1)), 1), space, np.zeros((1, 1)), UNKNOWN, *arguments(checker.compiled_world))


def _trees(start: Array, goals: Array, extension_limit: int) -> Trees:
    states = np.empty((2, max(INITIAL_TREE_CAPACITY, 2 * len(goals)), len(start)))
    states[0, 0], states[1, : len(goals)] = start, goals
    return Trees(
        states=states,
        parents=np.full(states.shape[:2], -1),
        blocked=np.zeros(states.shape[:2], dtype=bool),
        lengths=np.zeros(states.shape[:2]),
        sizes=np.array([1, len(goals)]),
        cursor=np.array([0, 0, EXTEND, NEAREST_UNKNOWN]),
        target=start.copy(),
        counts=np.array([0, 0, extension_limit, EDGES_PER_CALL]),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeGrowth:
    """Rules by which a search grows its trees.

    Attributes:
        check_step: Distance between collision checks along an edge [rad or m].
        max_extension: Maximum length of an extension [rad or m], weighted if `is_weighted`.
        extension_limit: Maximum number of extensions to random states; None for no limit but time.
        is_weighted: Whether the weight of a joint is the square root of its reach, relative to the largest
            reach. A wrist then rotates farther per extension than a shoulder. Otherwise all weights are 1.
    """

    check_step: float
    max_extension: float
    extension_limit: int | None = None
    is_weighted: bool = True


class RrtConnect:
    """A bidirectional search for a collision-free path."""

    def __init__(
        self,
        problem: PlanningProblem,
        goals: Array,
        growth: TreeGrowth,
        *,
        search_index: int = 0,
        length_bound: float = np.inf,
    ) -> None:
        """Prepares the trees and the joint space.

        Args:
            problem: Problem that `can_search` accepts.
            goals: Goal joint vectors, shape (n, joints) [rad or m].
            growth: Rules by which the trees grow.
            search_index: Index among parallel searches. Searches above 0 fill their own counts.
            length_bound: Upper bound of the weighted path length [rad or m].
        """
        self._problem, self._goals = problem, goals
        start = problem.start_values
        world = problem.compiled_world
        assert world is not None
        if search_index > 0:
            world = world._replace(counts=np.zeros_like(world.counts), refusals=np.zeros_like(world.refusals))
        self._bodies, self._world = world, arguments(world)
        ends = np.vstack([start, goals])
        self._low, self._high = problem.search_bounds(ends)
        half_turn = np.where(world.tree.prismatic[problem.group.indices], np.inf, np.pi)
        self._local_bounds = (
            np.maximum(self._low, ends.min(axis=0) - half_turn),
            np.minimum(self._high, ends.max(axis=0) + half_turn),
        )
        self._space = self._search_space(world, growth, length_bound)
        limit = growth.extension_limit
        self._trees = _trees(start, goals, np.iinfo(np.int64).max if limit is None else limit)
        self._samples, self._batches = np.empty((0, len(self._low))), 0
        self._verdict, self._status = UNKNOWN, PAUSED

    @property
    def checks(self) -> int:
        """Number of edge checks."""
        return int(self._trees.counts[EDGE_CHECKS])

    @property
    def extensions(self) -> int:
        """Number of attempted extensions to random states."""
        return int(self._trees.counts[EXTENSIONS])

    @property
    def tree_sizes(self) -> tuple[int, int]:
        """Number of states in the start tree and in the goal tree."""
        return int(self._trees.sizes[0]), int(self._trees.sizes[1])

    def grow(self) -> None:
        """Grows the trees until they meet or the search pauses; searches may grow in parallel threads."""
        if self._status != UNDECIDED:  # the round continues after an undecided edge
            self._trees.counts[NEXT_PAUSE] = self._trees.counts[EDGE_CHECKS] + EDGES_PER_CALL
        self._status = grow(self._trees, self._space, self._samples, self._verdict, *self._world)
        self._verdict = UNKNOWN

    @property
    def path(self) -> Array | None:
        """Path vertices from the start to one of the goals, shape (n, joints); None until the trees meet."""
        return self._vertices() if self._status == FOUND else None

    @property
    def is_undecided(self) -> bool:
        """Whether the search waits for a call of `decide`."""
        return self._status == UNDECIDED

    def decide(self) -> None:
        """Runs the exact check of the edge that the compiled check leaves undecided."""
        self._verdict = FREE if self._undecided_edge_is_free() else BLOCKED

    def prepare(self) -> bool:
        """Provides the requested samples or tree capacity; returns False if the extension limit is reached."""
        if self._status == NEEDS_CAPACITY:
            self._add_capacity()
        elif self._status == NEEDS_SAMPLES:
            self._batches += 1
            self._samples = self._random_states() if self._space.length_bound == np.inf else self._states_within_bound()
            self._trees.cursor[SAMPLE] = 0
        return self._status != LIMIT_REACHED

    def add_counts(self, other: RrtConnect) -> None:
        """Adds the check counts of a parallel search to the counts of this search."""
        self._bodies.counts[:] += other._bodies.counts
        self._bodies.refusals[:] += other._bodies.refusals

    def run(self) -> Array | None:
        """Returns path vertices from the start to one of the goals, shape (n, joints), or None."""
        return ParallelSearch(self._problem, [self]).run()

    def _search_space(self, world: World, growth: TreeGrowth, length_bound: float) -> Space:
        problem, max_extension = self._problem, growth.max_extension
        count = len(self._low)
        edges, weights = problem.motion.edges(growth.check_step), np.ones(count)
        if growth.is_weighted:
            weights = np.sqrt((np.abs(edges.joint_map) * reaches(world)[:, None]).max(axis=0))
            weights = np.maximum(weights / (weights.max() or 1.0), MIN_WEIGHT)
        squares = (weights * (self._local_bounds[1] - self._local_bounds[0])) ** 2
        # Mean and variance of the squared distance of two uniform states: squares / 6 and 7 / 180 squares^2 per joint
        squared_radius = squares.sum() / 6.0 - DOMAIN_DEVIATIONS * np.sqrt(7.0 / 180.0 * (squares**2).sum())
        domain_radius = max(MIN_DOMAIN_EXTENSIONS * max_extension, float(np.sqrt(max(squared_radius, 0.0))))
        if length_bound < np.inf:  # short paths pass close to obstacles
            domain_radius = np.inf
        return Space(weights, max_extension, domain_radius, length_bound, edges)

    def _random_states(self) -> Array:
        low, high = (self._low, self._high) if self._batches % FULL_BOUNDS_PERIOD == 0 else self._local_bounds
        # Equal to rng.uniform(low, high), in a third of the time
        return low + (high - low) * self._problem.rng.random((SAMPLE_BATCH, len(low)))

    def _states_within_bound(self) -> Array:
        """Returns states on paths that can be shorter than the bound, each followed by a random number from 0 to 1.

        The states are uniform in the ellipsoid with the start and a random goal as foci, as in Gammell et al.:
        Informed RRT*, IROS 2014.
        """
        rng, start, weights = self._problem.rng, self._problem.start_values, self._space.weights
        offsets = weights * (self._goals - start)
        offsets = offsets[np.linalg.norm(offsets, axis=1) < self._space.length_bound]
        offset = offsets[rng.integers(len(offsets))]
        distance, count = float(np.linalg.norm(offset)), len(offset)
        radii = np.full(count, 0.5 * np.sqrt(self._space.length_bound**2 - distance**2))
        radii[0] = 0.5 * self._space.length_bound
        directions = rng.normal(size=(SAMPLE_BATCH, count))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        samples = directions * rng.random((SAMPLE_BATCH, 1)) ** (1.0 / count) * radii
        reflector = offset / distance - np.eye(count)[0]  # Householder reflection of the first axis onto the offset
        squared_norm = float(reflector @ reflector)
        if squared_norm > 0.0:
            samples -= np.outer(samples @ reflector, reflector) * (2.0 / squared_norm)
        states = np.clip(start + (0.5 * offset + samples) / weights, self._low, self._high)
        return np.column_stack([states, rng.random(SAMPLE_BATCH)])

    def _undecided_edge_is_free(self) -> bool:
        trees = self._trees
        start, end = trees.states[trees.cursor[TREE], trees.cursor[NEAREST]], np.empty_like(trees.target)
        write_step(start, trees.target, self._space, end)
        return self._problem.motion.edge_is_free(start, end, self._space.edges.step)

    def _add_capacity(self) -> None:
        trees = self._trees
        self._trees = trees._replace(
            states=np.concatenate([trees.states, np.empty_like(trees.states)], axis=1),
            parents=np.concatenate([trees.parents, np.full_like(trees.parents, -1)], axis=1),
            blocked=np.concatenate([trees.blocked, np.zeros_like(trees.blocked)], axis=1),
            lengths=np.concatenate([trees.lengths, np.zeros_like(trees.lengths)], axis=1),
        )

    def _vertices(self) -> Array:
        branches = []
        for tree in (0, 1):
            index, branch = int(self._trees.sizes[tree]) - 1, []
            while index >= 0:
                branch.append(self._trees.states[tree, index])
                index = int(self._trees.parents[tree, index])
            branches.append(branch)
        return np.array([*reversed(branches[0]), *branches[1][1:]])


class ParallelSearch:
    """Searches of one problem in parallel threads, which return the first path found.

    The searches run in rounds of equal numbers of edge checks, so that the winner does not depend on thread timing.
    """

    def __init__(self, problem: PlanningProblem, searches: Sequence[RrtConnect]) -> None:
        """Stores the searches; each search needs its own random generator."""
        self._problem, self._searches = problem, list(searches)

    @property
    def checks(self) -> int:
        """Number of edge checks of all searches."""
        return sum(search.checks for search in self._searches)

    def run(self) -> Array | None:
        """Returns the first path found, or the shortest of a round; None if time or extensions run out."""
        if len(self._searches) == 1:
            return self._run_rounds(map)
        with ThreadPoolExecutor(len(self._searches)) as threads:
            path = self._run_rounds(threads.map)
        first, *others = self._searches
        for search in others:
            first.add_counts(search)
        return path

    def _run_rounds(
        self, map_searches: Callable[[Callable[[RrtConnect], None], list[RrtConnect]], Iterable[None]]
    ) -> Array | None:
        problem, searches = self._problem, self._searches
        while searches:
            growing = searches
            while growing:  # undecided edges do not count, so that all rounds have the same length
                for _ in map_searches(RrtConnect.grow, growing):
                    pass
                growing = [search for search in growing if search.is_undecided and not problem.interrupted()]
                for search in growing:
                    search.decide()
            paths = [search.path for search in searches if search.path is not None]
            if paths:
                # A search stopped by the clock is not repeatable
                return None if problem.repeatable and problem.interrupted() else min(paths, key=path_length)
            if problem.interrupted():
                return None
            searches = [search for search in searches if search.prepare()]
        return None
