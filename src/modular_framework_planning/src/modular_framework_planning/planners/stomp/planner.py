# SPDX-License-Identifier: BSD-3-Clause
"""The planner of the pipeline `stomp`: several attempts to deform a straight motion around obstacles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modular_framework_planning.contacts import describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.stomp.costs import StateCosts
from modular_framework_planning.planners.stomp.optimiser import Optimiser
from modular_framework_planning.planners.stomp.settings import StompSettings, read_settings
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanningProblem, no_path
from modular_framework_planning.planning_interface.planning_request import PipelineSettings
from modular_framework_planning.robot_model.robot_model import RobotModel

BOW_STDDEV = 1.0  # [rad or m]; standard deviation of the bow that later attempts begin with
NOISE_DECAY = 0.93  # of the noise after an iteration without progress
SCALES = (1.0, 0.5, 0.25)  # of the noise of neighbouring copies


class StompPlanner:
    """Parameters: see StompSettings and read_settings."""

    planner_ids = ("stomp", "STOMP")

    def __init__(self, settings: Mapping[str, StompSettings] | None = None) -> None:
        """Stores the settings.

        Args:
            settings: by planning group; MoveIt's for groups that are not named.
        """
        self._settings = dict(settings or {})

    @classmethod
    def configure(cls, model: RobotModel, settings: PipelineSettings) -> StompPlanner:
        """Makes the planner from the parameters of its pipeline; raises PlanningError where one is not allowed."""
        return cls({group: read_settings(settings.parameters, group) for group in model.groups})

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        """Returns a smooth path of `num_timesteps` states.

        Raises:
            PlanningError: no attempt gave a valid path; says how many states of the best one are invalid and why.
        """
        settings = self._settings.get(problem.group.name) or read_settings({})
        goals = problem.goal_states()
        best: Array | None = None
        fewest = 0
        for attempt in range(settings.num_attempts):
            search = _Attempt(problem, settings, goals[attempt % len(goals)], is_bowed=attempt >= len(goals))
            if search.run():
                return PlannedPath(search.motion, is_short=True)
            invalid = search.invalid_states()
            if best is None or invalid < fewest:
                best, fewest = search.motion, invalid
            if problem.interrupted():
                break
        assert best is not None
        raise _failure(problem, settings, best)


def _failure(problem: PlanningProblem, settings: StompSettings, motion: Array) -> PlanningError:
    """Says why there is no path: how many states of the best motion are invalid, and what is wrong with one of them."""
    reason = (
        no_path(problem, "STOMP")
        if problem.interrupted()
        else PlanningError(
            ErrorCode.PLANNING_FAILED,
            f"STOMP found no path in {settings.num_attempts} attempts of "
            f"{settings.num_iterations} iterations; allow more or choose another goal",
        )
    )
    invalid = [row for row in motion if not problem.state_is_valid(row)]
    if not invalid:
        return PlanningError(
            reason.code,
            f"{reason.reason}; in its best motion only the ways between timesteps are invalid: raise num_timesteps",
        )
    middle = problem.motion.full_positions(invalid[len(invalid) // 2])
    contacts = problem.checker.contacts(middle, include_fixed=False)
    violated = "" if problem.constraints is None else problem.constraints.describe(middle)
    return PlanningError(
        reason.code,
        f"{reason.reason}; in its best motion {len(invalid)} of {len(motion)} timesteps "
        f"are invalid: {describe_contacts(contacts) if contacts else violated}",
        contacts,
    )


class _Attempt:
    """Iterations from one first guess to one goal."""

    def __init__(self, problem: PlanningProblem, settings: StompSettings, goal: Array, is_bowed: bool) -> None:
        self._problem, self._settings = problem, settings
        self._costs = StateCosts(problem)
        self._optimiser = Optimiser(settings, *problem.bounds, problem.rng)
        line = self._optimiser.line(problem.start_values, goal)
        self.motion = self._on_constraints(self._optimiser.disturbed(line, BOW_STDDEV)[0] if is_bowed else line)

    def run(self) -> bool:
        """Whether `motion` became valid."""
        settings = self._settings
        valid = self.motion.copy() if self._is_valid() else None
        after = 0
        cost = self._cost(self.motion)
        stddev = settings.stddev
        copies, costs = np.empty((0, *self.motion.shape)), np.empty((0, len(self.motion)))
        for _ in range(settings.num_iterations):
            if (valid is not None and after >= settings.num_iterations_after_valid) or self._problem.interrupted():
                break
            after += valid is not None
            kept = np.argsort(costs.sum(axis=1))[: max(0, settings.max_rollouts - settings.num_rollouts)]
            sizes = stddev * np.resize(SCALES, settings.num_rollouts)
            fresh = self._optimiser.disturbed(self.motion, sizes)
            copies = np.concatenate([fresh, copies[kept]])
            costs = np.concatenate([self._optimiser.costs(fresh, self._costs), costs[kept]])
            stepped, cost = self._step(copies, costs, cost)
            if not stepped:
                stddev *= NOISE_DECAY
            if self._is_valid():
                valid = self.motion.copy()
            cost = self._cost(self.motion)
        if valid is not None:
            self.motion = valid
        return valid is not None

    def _step(self, copies: Array, costs: Array, cost: float) -> tuple[bool, float]:
        """Replaces the motion by the weighted average or the best rollout, whichever is cheaper, if cheaper at all."""
        candidates = [
            self._on_constraints(item)
            for item in (self._optimiser.update(self.motion, copies, costs), copies[int(np.argmin(costs.sum(axis=1)))])
        ]
        candidate_costs = [self._cost(item) for item in candidates]
        best = int(np.argmin(candidate_costs))
        if candidate_costs[best] >= cost:
            return False, cost
        self.motion = candidates[best]
        return True, candidate_costs[best]

    def _cost(self, motion: Array) -> float:
        return float(self._optimiser.costs(motion[None], self._costs).sum())

    def _on_constraints(self, motion: Array) -> Array:
        """Projects the states onto the path constraints where that succeeds; the ends stay."""
        constraints = self._problem.constraints
        if constraints is None:
            return motion
        result = motion.copy()
        indices = self._problem.group.indices
        for number in range(1, len(motion) - 1):
            moved = constraints.project(self._problem.motion.full_positions(motion[number]), indices)
            if moved is not None:
                result[number] = moved[indices]
        return result

    def _is_valid(self) -> bool:
        """Whether the motion passes the exact check."""
        problem, fine = self._problem, self._problem.settings.motion_step
        if problem.motion.colliding_state(self.motion, problem.settings.finest_step) is not None:
            return False
        return problem.constraints is None or all(
            problem.edge_is_valid(first, second, fine)
            for first, second in zip(self.motion[:-1], self.motion[1:], strict=True)
        )

    def invalid_states(self) -> int:
        """Number of time steps that are not valid."""
        return sum(not self._problem.state_is_valid(row) for row in self.motion)
