# SPDX-License-Identifier: BSD-3-Clause
"""Joint-space planning of a group with OMPL's geometric planners."""

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
from modular_framework_planning.planners.rrt_connect.rrt_connect import (
    ParallelSearch,
    RrtConnect,
    TreeGrowth,
    can_search,
)
from modular_framework_planning.planning_interface.path_repair import repair_path
from modular_framework_planning.planning_interface.planner_interface import (
    PlannedPath,
    Planner,
    PlanningProblem,
    no_path,
)
from modular_framework_planning.trajectory_processing.path_shortening import path_length

CONNECTION_ITERATIONS, CONSTRAINED_CONNECTION_STATES = 500, 100  # limits of the search for a detour around one edge
LARGE_GROUP = 10  # minimum number of joints for parallel searches, such as two arms
MAX_THREADS = 4  # default limit; every additional search saves less time
ou.setLogLevel(ou.LogLevel.LOG_ERROR)


class OmplPlanner(Planner):
    """Plans with OMPL's sampling-based planners.

    Parameters of a planner configuration or of the group: the planner's settings (see planner_settings.py),
    `projection_evaluator`, `longest_valid_segment_fraction` (maximum distance between checks along an edge, as a
    fraction of the extent of the joint space) and `maximum_waypoint_distance` [rad]. Parameter of the pipeline:
    `seeded_iterations`.
    """

    planner_ids = tuple(PLANNERS)
    improving_ids = ANYTIME
    description = "OMPL"
    constrained_planner = NAME
    repairs_edges = True

    @staticmethod
    def parameter_faults(planner_id: str, settings: Mapping[str, object]) -> list[str]:
        """Returns messages about unknown and unreadable settings of a planner."""
        return parameter_faults(planner_id, settings)

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        """Returns the straight path to a goal if it is valid, otherwise the shortest path of `attempts` searches.

        Raises:
            PlanningError: No path was found, a setting is wrong, or the planner does not support the request.
        """
        start, goals = problem.start_values, problem.goal_states()
        step = edge_step(problem)
        for goal in goals:
            if problem.edge_is_valid(start, goal, problem.settings.finest_step):
                return PlannedPath(np.vstack([start, goal]))
        if problem.constraints is not None and (problem.planner_id == "RRTConnect" or constraints_are_tight(problem)):
            problem.phases.record_implementation(NAME)
            max_states = problem.request.max_iterations
            return ConstrainedSearch(problem, step, max_states=math.inf if max_states is None else max_states).run()
        if problem.repeatable and problem.planner_id in THREADED:
            raise PlanningError(
                ErrorCode.PLANNING_FAILED,
                f"planner_id '{problem.planner_id}' searches in threads and "
                "cannot repeat a plan; choose another planner or do not set a seed",
            )
        total_checks = 0
        for stage, targets in _stages(problem, goals):
            paths, checks = _paths(stage, targets, step)
            total_checks += checks
            if paths:
                return PlannedPath(min(paths, key=path_length))
        raise no_path(problem, problem.planner_id, total_checks)

    def repair_path(self, problem: PlanningProblem, vertices: Array) -> Array:
        """Returns the path with invalid edges replaced by detours, valid at the step of the final validation.

        Raises:
            EdgeError: An edge could not be repaired.
        """
        return repair_path(problem, vertices, connection)


def _stages(problem: PlanningProblem, goals: Array) -> list[tuple[PlanningProblem, Array]]:
    """Returns the problem and goals of each search stage.

    Continuous joints rotate to their goals in the shorter direction. If no path is found in half of the time, both
    directions are allowed.
    """
    long_way_goals = problem.long_way_goals(goals)
    if not len(long_way_goals):
        return [(problem, goals)]
    both = np.vstack([goals, long_way_goals])
    if problem.repeatable:  # the result must not depend on the clock
        return [(problem, both)]
    half = 0.5 * (time.monotonic() + problem.deadline_s)
    return [(replace(problem, deadline_s=half), goals), (problem, both)]


def _paths(problem: PlanningProblem, goals: Array, step: float) -> tuple[list[Array], int]:
    """Returns the paths found by `attempts` searches, and the number of checks."""
    paths, checks = [], 0
    for _ in range(max(1, problem.request.attempts)):
        search = _search(problem, goals, step)
        problem.phases.record_implementation("OMPL" if isinstance(search, _Search) else "compiled")
        path = search.run()
        checks += search.checks
        if path is not None:
            paths.append(path)
        if problem.interrupted():
            break
    return paths, checks


def connection(problem: PlanningProblem, first: Array, second: Array) -> Array | None:
    """Returns a path between two free states, or None.

    Edges are checked at the step of the final validation. The search is bounded by a number of iterations or states,
    so that a seed repeats it, and by the allowed time.

    Args:
        problem: Problem whose scene and path constraints apply.
        first: Start joint vector of the group [rad or m].
        second: Goal joint vector of the group [rad or m].
    """
    local_problem = replace(
        problem.with_start(problem.motion.full_positions(first)),
        planner_id="RRTConnect",
        planner_parameters={},
        deadline_s=problem.end_s,
    )
    fine = problem.settings.finest_step
    if problem.constraints is not None:
        try:
            return ConstrainedSearch(local_problem, fine, second[None], CONSTRAINED_CONNECTION_STATES).run().vertices
        except PlanningError:
            return None
    return _search(local_problem, second[None], fine, CONNECTION_ITERATIONS).run()


def _search(
    problem: PlanningProblem, goals: Array, step: float, iteration_limit: int | None = None
) -> _Search | ParallelSearch | Aorrtc:
    """Returns the search of the problem's planner: compiled for RRTConnect and AORRTC if possible, otherwise OMPL's."""
    parameters, iteration_limit = problem.planner_parameters, _max_iterations(problem, iteration_limit)
    if problem.planner_id == "AORRTC" and can_search(problem):
        return Aorrtc(problem, goals, connection_range(parameters) or DEFAULT_RANGE, iteration_limit)
    if problem.planner_id == "RRTConnect" and can_search(problem) and not keeps_intermediate_states(parameters):
        configured_range = connection_range(parameters)
        growth = TreeGrowth(
            check_step=step,
            max_extension=configured_range or DEFAULT_RANGE,
            extension_limit=iteration_limit,
            is_weighted=configured_range is None,
        )
        generators = [problem.rng, *problem.rng.spawn(search_threads(problem) - 1)]
        return ParallelSearch(
            problem,
            [
                RrtConnect(replace(problem, rng=rng), goals, growth, search_index=index)
                for index, rng in enumerate(generators)
            ],
        )
    return _Search(problem, goals, step, iteration_limit)


def _max_iterations(problem: PlanningProblem, iteration_limit: int | None) -> int | None:
    """Returns the maximum number of iterations of a search; None if only the clock ends the search."""
    if iteration_limit is None and problem.repeatable and problem.planner_id in ANYTIME:
        return problem.settings.seeded_iterations
    return problem.request.max_iterations if iteration_limit is None else iteration_limit


def search_threads(problem: PlanningProblem) -> int:
    """Returns the number of parallel searches: the setting `search_threads` or a choice based on group size and load.

    Small groups get one search because their searches are short, seeded plans because load must not change the plan.
    """
    settings = problem.settings
    if settings.search_threads:
        return settings.search_threads
    is_seeded = problem.repeatable or settings.seed is not None or problem.request.seed is not None
    if is_seeded or len(problem.group.joints) < LARGE_GROUP:
        return 1
    idle = len(os.sched_getaffinity(0)) - os.getloadavg()[0]
    return int(min(max(idle, 1.0), MAX_THREADS))


def edge_step(problem: PlanningProblem) -> float:
    """Returns the distance between checks along an edge [rad or m], set by the problem and the group's parameters."""
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
    """OMPL motion validator that checks whole edges."""

    def __init__(self, information: Any, search: _Search) -> None:
        super().__init__(information)
        self._search: _Search | None = search

    def checkMotion(self, first: Any, second: Any) -> bool:  # noqa: N802 - OMPL calls it by this name
        """Checks that the straight motion is free."""
        return self._search is not None and self._search.edge_is_valid(first, second)

    def release(self) -> None:
        """Drops the reference to the collision world."""
        self._search = None


class _Search:
    """A run of an OMPL planner."""

    def __init__(
        self,
        problem: PlanningProblem,
        goals: Array,
        step: float,
        iteration_limit: int | None = None,
    ) -> None:
        """Stores the problem.

        Args:
            problem: Problem to plan for.
            goals: Goal joint vectors, shape (n, joints) [rad or m].
            step: Distance between checks along an edge [rad or m].
            iteration_limit: Maximum number of iterations; None for no limit but time.
        """
        self._problem, self._goals, self._step = problem, goals, step
        self._iteration_limit = iteration_limit
        self._joint_count = len(problem.group.joints)
        self._condition: Any = None
        self._iterations = 0
        self.checks = 0

    def run(self) -> Array | None:
        """Returns path vertices from the start to one of the goals, shape (n, joints), or None.

        Raises:
            PlanningError: A setting is wrong.
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
        """Returns the joint space, limited to one rotation beyond the start and the goals."""
        low, high = self._problem.search_bounds(np.vstack([self._problem.start_values, self._goals]))
        space, bounds = ob.RealVectorStateSpace(self._joint_count), ob.RealVectorBounds(self._joint_count)
        for index in range(self._joint_count):
            bounds.setLow(index, float(low[index]))
            bounds.setHigh(index, float(high[index]))
        space.setBounds(bounds)
        return space

    def _termination(self) -> Any:
        """Returns the termination condition: the deadline and, if set, the iteration limit."""
        problem = self._problem
        if problem.planner_id in THREADED:
            return ob.timedPlannerTerminationCondition(max(1e-3, problem.deadline_s - time.monotonic()))
        iteration_limit = self._iteration_limit
        if iteration_limit is None:
            return ob.PlannerTerminationCondition(problem.interrupted)

        def stop() -> bool:
            self._iterations += 1
            if problem.interrupted():
                return True
            return self._iterations > iteration_limit

        return ob.PlannerTerminationCondition(stop)

    def _state_is_valid(self, state: Any) -> bool:
        self.checks += 1
        if self._problem.cancelled() and self._condition is not None:
            self._condition.terminate()
            return False
        return self._problem.state_is_valid(np.array(state[0 : self._joint_count]))

    def edge_is_valid(self, first: Any, second: Any) -> bool:
        """Checks that the straight motion between two OMPL states is free and satisfies the constraints."""
        self.checks += 1
        return self._problem.edge_is_valid(
            np.array(first[0 : self._joint_count]), np.array(second[0 : self._joint_count]), self._step
        )

    def _state(self, information: Any, values: Array) -> Any:
        state = information.allocState()
        for index, value in enumerate(values):
            state[index] = float(value)
        return state

    def _vertices(self, definition: Any) -> Array | None:
        if not definition.hasExactSolution():
            return None
        if self._problem.repeatable and self._problem.interrupted():
            return None  # a search stopped by the clock is not repeatable
        return np.array([list(state[0 : self._joint_count]) for state in definition.getSolutionPath().getStates()])
