# SPDX-License-Identifier: BSD-3-Clause
"""Searches the joint space of a group with OMPL's geometric planners."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import ompl.base as ob
import ompl.util as ou

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.ompl.constrained_search import NAME, ConstrainedSearch, constraints_are_tight
from modular_framework_planning.planners.ompl.planner_settings import (
    ANYTIME,
    DEFAULT_RANGE,
    PLANNERS,
    THREADED,
    connection_range,
    keeps_intermediate_states,
    make_planner,
    parameter_faults,
)
from modular_framework_planning.planners.ompl.projection import projection_evaluator
from modular_framework_planning.planners.rrt_connect.aorrtc import Aorrtc
from modular_framework_planning.planners.rrt_connect.rrt_connect import RrtConnect, SideBySide, can_search
from modular_framework_planning.planning_interface.path_repair import repaired
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanningProblem, no_path
from modular_framework_planning.trajectory_processing.path_shortening import path_length

CONNECTION_ITERATIONS, CONSTRAINED_CONNECTION_STATES = 500, 100  # of the search for a detour round one edge
LARGE_GROUP = 10  # joints from which on a search takes long enough for threads, as those of two arms
MOST_THREADS = 4  # that are chosen; each further search makes the first path come less sooner than the one before
ou.setLogLevel(ou.LogLevel.LOG_ERROR)


class OmplPlanner:
    """Samples the joint space of the group.

    Parameters below a planner's configuration or the group: those of the planner (see planner_settings.py),
    `projection_evaluator`, `longest_valid_segment_fraction` (edges are checked at least that finely, as a share of
    the extent of the joint space) and `maximum_waypoint_distance` [rad]; `seeded_iterations` of the pipeline.
    """

    planner_ids = tuple(PLANNERS)
    improving_ids = ANYTIME
    description = "OMPL"
    constrained_planner = NAME
    """Search that replaces any of them where it cannot keep the path constraints of a request."""

    @staticmethod
    def parameter_faults(planner_id: str, settings: Mapping[str, object]) -> list[str]:
        """Says which settings of a planner are unknown or unreadable."""
        return parameter_faults(planner_id, settings)

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        """Returns the shortest of the paths that `attempts` searches find; the straight motion where that is valid.

        Raises:
            PlanningError: no path was found, a setting is wrong, or the planner cannot do what is asked.
        """
        start, goals = problem.start_values, problem.goal_states()
        step = edge_step(problem)
        for goal in goals:
            if problem.edge_is_valid(start, goal, problem.settings.finest_step):
                return PlannedPath(np.vstack([start, goal]))
        if problem.constraints is not None and (problem.planner_id == "RRTConnect" or constraints_are_tight(problem)):
            problem.phases.searched_by(NAME)
            most_states = problem.request.most_iterations
            return ConstrainedSearch(problem, step, most_states=math.inf if most_states is None else most_states).run()
        if problem.repeatable and problem.planner_id in THREADED:
            raise PlanningError(
                ErrorCode.PLANNING_FAILED,
                f"planner_id '{problem.planner_id}' works in threads and "
                "cannot repeat a plan; choose another planner or do not set a seed",
            )
        states = 0
        for part, targets in _parts(problem, goals):
            paths, tried = _paths(part, targets, step)
            states += tried
            if paths:
                return PlannedPath(min(paths, key=path_length))
        raise no_path(problem, problem.planner_id, states)

    @staticmethod
    def repaired(problem: PlanningProblem, vertices: Array) -> Array:
        """Returns the path with every edge valid at the steps of the solution validator; raises EdgeError."""
        return repaired(problem, vertices, connection)


def _parts(problem: PlanningProblem, goals: Array) -> list[tuple[PlanningProblem, Array]]:
    """Returns the searches to make, one after the other: problem with its deadline, and goals.

    Joints without ends turn to their goals by the short way; where half of the time finds none, by either.
    """
    turned = problem.other_ways_round(goals)
    if not len(turned):
        return [(problem, goals)]
    both = np.vstack([goals, turned])
    if problem.repeatable:  # the clock must not decide
        return [(problem, both)]
    half = 0.5 * (time.monotonic() + problem.deadline_s)
    return [(replace(problem, deadline_s=half), goals), (problem, both)]


def _paths(problem: PlanningProblem, goals: Array, step: float) -> tuple[list[Array], int]:
    """Returns the paths that `attempts` searches find, and how many states they looked at."""
    paths, states = [], 0
    for _ in range(max(1, problem.request.attempts)):
        search = _search(problem, goals, step)
        problem.phases.searched_by("OMPL" if isinstance(search, _Search) else "compiled")
        path = search.run()
        states += search.states
        if path is not None:
            paths.append(path)
        if problem.interrupted():
            break
    return paths, states


def connection(problem: PlanningProblem, first: Array, second: Array) -> Array | None:
    """Returns a path between two free states, its edges checked as finely as the solution validator does, or None.

    The search ends after a number of iterations or states, so that a seed repeats it, or with the allowed time.
    """
    near = replace(
        problem.with_start(problem.motion.full_positions(first)),
        planner_id="RRTConnect",
        planner_parameters={},
        deadline_s=problem.end_s,
    )
    fine = problem.settings.finest_step
    if problem.constraints is not None:
        try:
            return ConstrainedSearch(near, fine, second[None], CONSTRAINED_CONNECTION_STATES).run().vertices
        except PlanningError:
            return None
    return _search(near, second[None], fine, CONNECTION_ITERATIONS).run()


def _search(
    problem: PlanningProblem, goals: Array, step: float, limit: int | None = None
) -> _Search | SideBySide | Aorrtc:
    """Returns the search of the problem's planner; RRTConnect and AORRTC are compiled where the checker allows it."""
    parameters, limit = problem.planner_parameters, _most_iterations(problem, limit)
    if problem.planner_id == "AORRTC" and can_search(problem):
        return Aorrtc(problem, goals, connection_range(parameters) or DEFAULT_RANGE, limit)
    if problem.planner_id == "RRTConnect" and can_search(problem) and not keeps_intermediate_states(parameters):
        wanted = connection_range(parameters)
        generators = [problem.rng, *problem.rng.spawn(search_threads(problem) - 1)]
        return SideBySide(
            problem,
            [
                RrtConnect(
                    replace(problem, rng=rng), goals, step, wanted or DEFAULT_RANGE, limit, wanted is None, number
                )
                for number, rng in enumerate(generators)
            ],
        )
    return _Search(problem, goals, step, limit)


def _most_iterations(problem: PlanningProblem, limit: int | None) -> int | None:
    """Returns after how many iterations a search ends; None where the clock ends it."""
    if limit is None and problem.repeatable and problem.planner_id in ANYTIME:
        return problem.settings.seeded_iterations
    return problem.request.most_iterations if limit is None else limit


def search_threads(problem: PlanningProblem) -> int:
    """Returns how many searches run at the same time for a problem: what the settings say, else as many as pay.

    Searches of small groups end too soon for that. With a seed it is one, whatever the machine has to do.
    """
    settings = problem.settings
    if settings.search_threads:
        return settings.search_threads
    is_seeded = problem.repeatable or settings.seed is not None or problem.request.seed is not None
    if is_seeded or len(problem.group.joints) < LARGE_GROUP:
        return 1
    free = len(os.sched_getaffinity(0)) - os.getloadavg()[0]
    return int(min(max(free, 1.0), MOST_THREADS))


def edge_step(problem: PlanningProblem) -> float:
    """Returns the distance of checks along an edge [rad or m] that the problem and the group's parameters ask for."""
    step = problem.step
    low, high = problem.bounds
    extent = float(np.linalg.norm(np.minimum(high - low, 4.0 * np.pi)))
    for key, unit in (("longest_valid_segment_fraction", extent), ("maximum_waypoint_distance", 1.0)):
        value = problem.planner_parameters.get(key)
        try:
            size = float(str(value)) * unit if value is not None else 0.0
        except ValueError as error:
            raise PlanningError(
                ErrorCode.PLANNING_FAILED,
                f"{key} of group '{problem.group.name}' is '{value}'; it must be a number above 0",
            ) from error
        step = min(step, size) if size > 0.0 else step
    return max(step, problem.settings.finest_step)


class _EdgeValidator(ob.MotionValidator):
    """OMPL's motion validator, for whole edges; `release` drops the reference to the collision world afterwards."""

    def __init__(self, information: Any, search: _Search) -> None:
        super().__init__(information)
        self._search: _Search | None = search

    def checkMotion(self, first: Any, second: Any) -> bool:  # noqa: N802 - OMPL calls it by this name
        """Whether the straight motion is free."""
        return self._search is not None and self._search.edge_is_valid(first, second)

    def release(self) -> None:
        """Drops the reference to the collision world."""
        self._search = None


class _Search:
    """One run of one planner."""

    def __init__(
        self,
        problem: PlanningProblem,
        goals: Array,
        step: float,
        limit: int | None = None,
    ) -> None:
        """Stores what to search.

        Args:
            problem: what to plan.
            goals: joint vectors to reach, shape (n, joints).
            step: distance of checks along an edge [rad or m].
            limit: of iterations; None: the clock ends the search.
        """
        self._problem, self._goals, self._step = problem, goals, step
        self._limit = limit
        self._count = len(problem.group.joints)
        self._condition: Any = None
        self._iterations = 0
        self.states = 0

    def run(self) -> Array | None:
        """Returns vertices of shape (n, joints) from the start to one of the goals, or None.

        Raises:
            PlanningError: a setting is wrong.
        """
        problem = self._problem
        information = ob.SpaceInformation(self._space())
        validator = _EdgeValidator(information, self)
        information.setStateValidityChecker(self._state_is_valid)
        information.setMotionValidator(validator)
        information.setup()
        definition = ob.ProblemDefinition(information)
        definition.addStartState(self._state(information, problem.start_values))
        goal = ob.GoalStates(information)
        for values in self._goals:
            goal.addState(self._state(information, values))
        definition.setGoal(goal)
        planner = make_planner(problem.planner_id, problem.planner_parameters, information, DEFAULT_RANGE)
        text = str(problem.planner_parameters.get("projection_evaluator") or "")
        projection = None
        if text and hasattr(planner, "setProjectionEvaluator"):
            projection = projection_evaluator(text, problem, information.getStateSpace())
            planner.setProjectionEvaluator(projection)
        try:
            planner.setProblemDefinition(definition)
            planner.setup()
            self._condition = self._termination()
            planner.solve(self._condition)
            return self._vertices(definition)
        finally:
            self._condition = None
            validator.release()
            if projection is not None and hasattr(projection, "release"):
                projection.release()
            information.setStateValidityChecker(lambda state: False)

    def _space(self) -> Any:
        """Returns the joint space, no wider than two turns around the start and the goals."""
        low, high = self._problem.search_bounds(np.vstack([self._problem.start_values, self._goals]))
        space, bounds = ob.RealVectorStateSpace(self._count), ob.RealVectorBounds(self._count)
        for number in range(self._count):
            bounds.setLow(number, float(low[number]))
            bounds.setHigh(number, float(high[number]))
        space.setBounds(bounds)
        return space

    def _termination(self) -> Any:
        """Returns when to stop: the clock, or a number of iterations where the plan must be repeatable."""
        problem = self._problem
        if problem.planner_id in THREADED:
            return ob.timedPlannerTerminationCondition(max(1e-3, problem.deadline_s - time.monotonic()))
        limit = self._limit
        if limit is None:
            return ob.PlannerTerminationCondition(problem.interrupted)

        def stop() -> bool:
            self._iterations += 1
            if problem.interrupted():
                return True
            return self._iterations > limit

        return ob.PlannerTerminationCondition(stop)

    def _state_is_valid(self, state: Any) -> bool:
        self.states += 1
        if self._problem.cancelled() and self._condition is not None:
            self._condition.terminate()
            return False
        return self._problem.state_is_valid(np.array(state[0 : self._count]))

    def edge_is_valid(self, first: Any, second: Any) -> bool:
        """Whether the straight motion between two OMPL states is free and keeps the constraints."""
        self.states += 1
        return self._problem.edge_is_valid(
            np.array(first[0 : self._count]), np.array(second[0 : self._count]), self._step
        )

    def _state(self, information: Any, values: Array) -> Any:
        state = information.allocState()
        for number, value in enumerate(values):
            state[number] = float(value)
        return state

    def _vertices(self, definition: Any) -> Array | None:
        if not definition.hasExactSolution():
            return None
        if self._problem.repeatable and self._problem.interrupted():
            return None  # a search that the clock ends is not repeatable
        return np.array([list(state[0 : self._count]) for state in definition.getSolutionPath().getStates()])
