# SPDX-License-Identifier: BSD-3-Clause
"""Runs OMPL's geometric planners on a joint-space problem, by MoveIt's planner names."""
from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import ompl.base as ob
import ompl.geometric as og
import ompl.util as ou

from modular_framework_planning.path_shortening import path_length
from modular_framework_planning.planner_interface import PlannedPath, PlanningProblem, no_path
from modular_framework_planning.spatial import Array

# PRM and PRMstar are left out: they wait for a thread of their own that needs the interpreter lock they hold.
PLANNERS: dict[str, type] = {
    "AORRTC": og.AORRTC, "BFMT": og.BFMT, "BITstar": og.BITstar, "BKPIECE": og.BKPIECE1, "FMT": og.FMT,
    "InformedRRTstar": og.InformedRRTstar, "KPIECE": og.KPIECE1, "LBKPIECE": og.LBKPIECE1, "RRT": og.RRT,
    "RRTConnect": og.RRTConnect, "RRTstar": og.RRTstar, "SORRTstar": og.SORRTstar,
}
DEFAULT_PLANNER = "RRTConnect"
DEFAULT_RANGE = 0.5  # [rad or m]; a fifth of the space, OMPL's own choice, makes edges so long that few are free
_SETTERS = {"range": "setRange", "goal_bias": "setGoalBias", "border_fraction": "setBorderFraction",
            "num_samples": "setNumSamples", "radius_multiplier": "setRadiusMultiplier"}

ou.setLogLevel(ou.LogLevel.LOG_ERROR)


@dataclass(frozen=True, slots=True)
class JointProblem:
    """A start, goals and tests in the joint space of one group.

    Attributes:
        lower, upper: bounds of the search, shape (joints,).
        start: joint vector; goals: alternatives, shape (n, joints).
        state_is_free, edge_is_free: the tests.
        cancelled: true when somebody asked to stop.
    """

    lower: Array
    upper: Array
    start: Array
    goals: Array
    state_is_free: Callable[[Array], bool]
    edge_is_free: Callable[[Array, Array], bool]
    cancelled: Callable[[], bool] = field(default=lambda: False)


class _EdgeValidator(ob.MotionValidator):
    """Hands whole edges to the problem's test; `release` breaks the tie to the collision world afterwards."""

    def __init__(self, information: Any, problem: JointProblem) -> None:
        super().__init__(information)
        self._test: Callable[[Array, Array], bool] | None = problem.edge_is_free
        self._count = len(problem.start)

    def checkMotion(self, first: Any, second: Any) -> bool:  # noqa: N802 - OMPL calls it by this name
        """Whether the straight motion is free."""
        if self._test is None:
            return False
        return bool(self._test(np.array(first[0:self._count]), np.array(second[0:self._count])))

    def release(self) -> None:
        """Lets go of the collision world."""
        self._test = None


def _make_planner(kind: str, settings: Mapping[str, Any], information: Any) -> Any:
    planner = PLANNERS[kind](information)
    if hasattr(planner, "setRange"):
        planner.setRange(DEFAULT_RANGE)
    for key, value in settings.items():
        setter = getattr(planner, _SETTERS.get(key, ""), None)
        number = float(value) if isinstance(value, int | float | str) and str(value).strip() else 0.0
        if setter is not None and not (key == "range" and number <= 0.0):  # range 0: the default below stays
            setter(int(number) if key == "num_samples" else number)
    return planner


def solve(problem: JointProblem, planner_id: str, settings: Mapping[str, Any], deadline: float) -> Array | None:
    """Searches for a path.

    Args:
        problem: what to solve.
        planner_id: key of PLANNERS.
        settings: its parameters in ompl_planning.yaml's words.
        deadline: monotonic time [s] at which to give up.

    Returns:
        Vertices of shape (n, joints) from the start to one of the goals, or None when the time ran out.
    """
    count = len(problem.start)
    space = ob.RealVectorStateSpace(count)
    bounds = ob.RealVectorBounds(count)
    for number in range(count):
        bounds.setLow(number, float(problem.lower[number]))
        bounds.setHigh(number, float(problem.upper[number]))
    space.setBounds(bounds)
    information = ob.SpaceInformation(space)
    validator = _EdgeValidator(information, problem)
    information.setStateValidityChecker(lambda state: bool(problem.state_is_free(np.array(state[0:count]))))
    information.setMotionValidator(validator)
    information.setup()
    definition = ob.ProblemDefinition(information)
    definition.addStartState(_state(information, problem.start))
    goal = ob.GoalStates(information)
    for values in problem.goals:
        goal.addState(_state(information, values))
    definition.setGoal(goal)
    planner = _make_planner(planner_id, settings, information)
    planner.setProblemDefinition(definition)
    planner.setup()
    condition = ob.PlannerTerminationCondition(lambda: bool(time.monotonic() > deadline or problem.cancelled()))
    try:
        planner.solve(condition)
        return _vertices(definition, count)
    finally:
        validator.release()
        information.setStateValidityChecker(lambda state: False)


def _state(information: Any, values: Array) -> Any:
    state = information.allocState()
    for number, value in enumerate(values):
        state[number] = float(value)
    return state


def _vertices(definition: Any, count: int) -> Array | None:
    if not definition.hasExactSolution():
        return None
    return np.array([list(state[0:count]) for state in definition.getSolutionPath().getStates()])


class OmplPlanner:
    """Samples the joint space of the group with one of OMPL's geometric planners."""

    planner_ids = (DEFAULT_PLANNER, *sorted(name for name in PLANNERS if name != DEFAULT_PLANNER))

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        """Returns the shortest of `attempts` paths; the straight way where that is valid."""
        begun = time.monotonic()
        start, goals = problem.start_values, problem.goal_states()
        for goal in goals:
            if problem.edge_is_valid(start, goal):
                return PlannedPath(np.vstack([start, goal]))
        lower, upper = problem.bounds
        lower = np.maximum(lower, np.minimum(start, goals.min(axis=0)) - 2.0 * np.pi)
        upper = np.minimum(upper, np.maximum(start, goals.max(axis=0)) + 2.0 * np.pi)
        search = JointProblem(lower, upper, start, goals, problem.state_is_valid, problem.edge_is_valid,
                              problem.cancelled)
        paths = []
        for _ in range(max(1, problem.request.attempts)):
            path = solve(search, problem.planner_id, problem.planner_parameters, problem.deadline_s)
            if path is not None:
                paths.append(path)
            if problem.interrupted():
                break
        if not paths:
            raise no_path(problem, begun, problem.planner_id)
        return PlannedPath(min(paths, key=path_length))
