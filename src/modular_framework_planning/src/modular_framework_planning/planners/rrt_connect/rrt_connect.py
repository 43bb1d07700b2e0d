# SPDX-License-Identifier: BSD-3-Clause
"""RRT-Connect on the arrays of a collision checker that offers them; other checkers and constraints need OMPL's."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_collision import World, arguments
from modular_framework_planning.collision_detection.kernels.compiled_distance_field import DistanceField
from modular_framework_planning.collision_detection.kernels.compiled_edges import (
    BLOCKED,
    FREE,
    UNKNOWN,
    GroupEdges,
)
from modular_framework_planning.collision_detection.reaches import reaches
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.rrt_connect.compiled_rrt_connect import (
    AT_LIMIT,
    EDGES,
    EXTENDS,
    FOUND,
    NEEDS_ROOM,
    NEEDS_SAMPLES,
    NEW,
    PAUSED,
    UNDECIDED,
    Space,
    Trees,
    grow,
    write_step,
)
from modular_framework_planning.planning_interface.collision_checker import CompiledChecks
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem
from modular_framework_planning.trajectory_processing.path_shortening import path_length

SAMPLES = 256  # that are drawn at once; most of them are too far from blocked states, and cost nothing
LEAST_WEIGHT = 0.1  # of a joint in a length, also of one that carries nothing: it turns ten times the range at most
ROOM = 1024  # of states in a tree, to begin with
# Of the domain of blocked states: four extensions (as in VAMP), or so many standard deviations below the mean squared
# distance of two random states: in 14 dimensions hardly any lie within four extensions. Tuned on MotionBenchMaker's
# problems of a UR5, a Panda, a Fetch and a two-armed Baxter.
LEAST_DOMAIN, DEVIATIONS = 4.0, 1.72
WIDE_EVERY = 8  # how many batches of samples there are to one from the whole bounds


def can_search(problem: PlanningProblem) -> bool:
    """Whether a problem has no path constraints and a checker whose arrays decide all pairs."""
    return problem.compiled_world is not None


def warm_up(checker: CompiledChecks, positions: Array) -> None:
    """Compiles the loop, or loads it from the cache.

    Args:
        checker: of a scene.
        positions: of the whole robot.
    """
    space = Space(np.ones(1), 1.0, 1.0, np.inf, GroupEdges(positions, np.zeros((len(positions), 1)), 0.1))
    assert checker.compiled_world is not None
    grow(_trees(np.zeros(1), np.ones((1, 1)), 1), space, np.zeros((1, 1)), UNKNOWN, *arguments(checker.compiled_world))


def _trees(start: Array, goals: Array, most_extensions: int) -> Trees:
    states = np.empty((2, max(ROOM, 2 * len(goals)), len(start)))
    states[0, 0], states[1, : len(goals)] = start, goals
    return Trees(
        states,
        np.full(states.shape[:2], -1),
        np.zeros(states.shape[:2], dtype=bool),
        np.zeros(states.shape[:2]),
        np.array([1, len(goals)]),
        np.array([0, 0, EXTENDS, NEW]),
        start.copy(),
        np.array([0, 0, most_extensions, EDGES]),
    )


def empty_field(field: DistanceField) -> DistanceField:
    """Returns a field of the same solids of which no cell is filled yet."""
    return field._replace(
        known=np.zeros_like(field.known), nearest=np.empty_like(field.nearest), distances=np.empty_like(field.distances)
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
        number: int = 0,
        bound: float = np.inf,
    ) -> None:
        """Stores what to search.

        Args:
            problem: for which `can_search` holds.
            goals: joint vectors to reach, shape (n, joints).
            step: distance of collision checks along an edge [rad or m].
            longest: most a tree grows by at once, in weighted length if `is_weighted` [rad or m].
            limit: of extensions to random states; None: the clock ends the search.
            is_weighted: whether joints count in a length by the root of their reach, the one that reaches farthest as
                1; else all count as 1. A wrist then turns further in one step than a shoulder.
            number: of the search among those that run at the same time; all but number 0 have a distance field and
                counts of their own, which they fill.
            bound: the path has to be shorter, in weighted length [rad or m].
        """
        self._problem, self._goals = problem, goals
        start = problem.start_values
        world = problem.compiled_world
        assert world is not None
        if number > 0:
            world = world._replace(
                field=empty_field(world.field),
                counts=np.zeros_like(world.counts),
                refusals=np.zeros_like(world.refusals),
            )
        self._bodies, self._world = world, arguments(world)
        around = np.vstack([start, goals])
        self._low, self._high = problem.search_bounds(around)
        turn = np.where(world.tree.prismatic[problem.group.indices], np.inf, np.pi)
        self._near = np.maximum(self._low, around.min(axis=0) - turn), np.minimum(self._high, around.max(axis=0) + turn)
        self._space = self._space_of(world, step, longest, is_weighted, bound)
        self._trees = _trees(start, goals, np.iinfo(np.int64).max if limit is None else limit)
        self._samples, self._batches = np.empty((0, len(self._low))), 0
        self._verdict, self._status = UNKNOWN, PAUSED

    @property
    def states(self) -> int:
        """How many edges were checked."""
        return int(self._trees.counts[0])

    @property
    def extensions(self) -> int:
        """How many extensions to random states were tried."""
        return int(self._trees.counts[1])

    @property
    def tree_sizes(self) -> tuple[int, int]:
        """How many states the trees from the start and from the goals have."""
        return int(self._trees.sizes[0]), int(self._trees.sizes[1])

    def grow(self) -> None:
        """Grows the trees until they meet, or for some edges; other searches may do the same in other threads."""
        if self._status != UNDECIDED:  # else the same turn goes on
            self._trees.counts[3] = self._trees.counts[0] + EDGES
        self._status = grow(self._trees, self._space, self._samples, self._verdict, *self._world)
        self._verdict = UNKNOWN

    @property
    def path(self) -> Array | None:
        """Vertices of shape (n, joints) from the start to one of the goals; None as long as the trees have not met."""
        return self._vertices() if self._status == FOUND else None

    @property
    def is_undecided(self) -> bool:
        """Whether the search waits for `decide`."""
        return self._status == UNDECIDED

    def decide(self) -> None:
        """Asks the exact check about the edge that the bounds leave open."""
        self._verdict = FREE if self._undecided_edge_is_free() else BLOCKED

    def prepare(self) -> bool:
        """Provides what the trees need to grow on; returns whether they may."""
        if self._status == NEEDS_ROOM:
            self._add_room()
        elif self._status == NEEDS_SAMPLES:
            self._batches += 1
            self._samples = self._random_states() if self._space.bound == np.inf else self._states_within_bound()
            self._trees.position[0] = 0
        return self._status != AT_LIMIT

    def add_counts_of(self, other: RrtConnect) -> None:
        """Adds the checks of a search that ran at the same time to those of this one."""
        self._bodies.counts[:] += other._bodies.counts
        self._bodies.refusals[:] += other._bodies.refusals

    def run(self) -> Array | None:
        """Returns vertices of shape (n, joints) from the start to one of the goals, or None."""
        return SideBySide(self._problem, [self]).run()

    def _space_of(self, world: World, step: float, longest: float, is_weighted: bool, bound: float) -> Space:
        problem = self._problem
        count = len(self._low)
        edges, weights = problem.motion.edges(step), np.ones(count)
        if is_weighted:
            weights = np.sqrt((np.abs(edges.map) * reaches(world)[:, None]).max(axis=0))
            weights = np.maximum(weights / (weights.max() or 1.0), LEAST_WEIGHT)
        squares = (weights * (self._near[1] - self._near[0])) ** 2
        near = squares.sum() / 6.0 - DEVIATIONS * np.sqrt(7.0 / 180.0 * (squares**2).sum())  # of two random states
        domain = max(LEAST_DOMAIN * longest, float(np.sqrt(max(near, 0.0))))
        if bound < np.inf:  # the shortest paths lie near obstacles
            domain = np.inf
        return Space(weights, longest, domain, bound, edges)

    def _random_states(self) -> Array:
        low, high = (self._low, self._high) if self._batches % WIDE_EVERY == 0 else self._near
        # what rng.uniform(low, high) gives, in a third of its time
        return low + (high - low) * self._problem.rng.random((SAMPLES, len(low)))

    def _states_within_bound(self) -> Array:
        """Random states over which a path may be shorter than the bound, and a number in 0 to 1 behind each.

        They are uniform in the ellipsoid whose focal points are the start and one of the goals, as in Gammell et al.:
        Informed RRT*, IROS 2014.
        """
        rng, start, weights = self._problem.rng, self._problem.start_values, self._space.weights
        ways = weights * (self._goals - start)
        ways = ways[np.linalg.norm(ways, axis=1) < self._space.bound]
        way = ways[rng.integers(len(ways))]
        distance, count = float(np.linalg.norm(way)), len(way)
        radii = np.full(count, 0.5 * np.sqrt(self._space.bound**2 - distance**2))
        radii[0] = 0.5 * self._space.bound
        directions = rng.normal(size=(SAMPLES, count))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        ball = directions * rng.random((SAMPLES, 1)) ** (1.0 / count) * radii
        mirror = way / distance - np.eye(count)[0]  # Householder's: it takes the first axis to the way
        square = float(mirror @ mirror)
        if square > 0.0:
            ball -= np.outer(ball @ mirror, mirror) * (2.0 / square)
        states = np.clip(start + (0.5 * way + ball) / weights, self._low, self._high)
        return np.column_stack([states, rng.random(SAMPLES)])

    def _undecided_edge_is_free(self) -> bool:
        trees = self._trees
        here, end = trees.states[trees.position[1], trees.position[3]], np.empty_like(trees.target)
        write_step(here, trees.target, self._space, end)
        return self._problem.motion.edge_is_free(here, end, self._space.edges.step)

    def _add_room(self) -> None:
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
            number, branch = int(self._trees.sizes[tree]) - 1, []
            while number >= 0:
                branch.append(self._trees.states[tree, number])
                number = int(self._trees.parents[tree, number])
            branches.append(branch)
        return np.array([*reversed(branches[0]), *branches[1][1:]])


class SideBySide:
    """Searches of one problem that run at the same time, in a thread each; the first path that one of them finds wins.

    They take turns of some edges, after which all are waited for: which one is first does not depend on the machine.
    """

    def __init__(self, problem: PlanningProblem, searches: Sequence[RrtConnect]) -> None:
        """Stores the searches; each needs a random generator of its own."""
        self._problem, self._searches = problem, list(searches)

    @property
    def states(self) -> int:
        """How many edges were checked."""
        return sum(search.states for search in self._searches)

    def run(self) -> Array | None:
        """Returns the first path that is found, the shortest of several; None where time or samples are over."""
        if len(self._searches) == 1:
            return self._take_turns(map)
        with ThreadPoolExecutor(len(self._searches)) as threads:
            path = self._take_turns(threads.map)
        first, *others = self._searches
        for search in others:
            first.add_counts_of(search)
        return path

    def _take_turns(
        self, each: Callable[[Callable[[RrtConnect], None], list[RrtConnect]], Iterable[None]]
    ) -> Array | None:
        problem, searches = self._problem, self._searches
        while searches:
            growing = searches
            while growing:  # a turn does not depend on which edges the bounds leave open
                for _ in each(RrtConnect.grow, growing):
                    pass
                growing = [search for search in growing if search.is_undecided and not problem.interrupted()]
                for search in growing:
                    search.decide()
            paths = [search.path for search in searches if search.path is not None]
            if paths:
                # a search that the clock ends is not repeatable
                return None if problem.repeatable and problem.interrupted() else min(paths, key=path_length)
            if problem.interrupted():
                return None
            searches = [search for search in searches if search.prepare()]
        return None
