# SPDX-License-Identifier: BSD-3-Clause
"""STOMP planner: several attempts to deform a straight motion around obstacles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modular_framework_planning.contacts import describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.stomp.costs import StateCosts
from modular_framework_planning.planners.stomp.optimiser import Optimiser
from modular_framework_planning.planners.stomp.settings import StompSettings, read_settings
from modular_framework_planning.planning_interface.planner_interface import (
    PlannedPath,
    Planner,
    PlanningProblem,
    no_path,
)
from modular_framework_planning.planning_interface.planning_request import PipelineSettings
from modular_framework_planning.robot_model.robot_model import RobotModel

BOW_STDDEV = 1.0  # standard deviation of the curved initial guess of later attempts [rad or m]
NOISE_DECAY = 0.93  # noise factor after an iteration without progress
NOISE_SCALES = (1.0, 0.5, 0.25)  # noise factors of consecutive copies


class StompPlanner(Planner):
    """Plans by stochastic optimisation; see StompSettings and read_settings for the parameters."""

    planner_ids = ("stomp", "STOMP")

    def __init__(self, settings: Mapping[str, StompSettings] | None = None) -> None:
        """Stores the settings.

        Args:
            settings: Settings, keyed by planning group; other groups use MoveIt's defaults.
        """
        self._settings = dict(settings or {})

    @classmethod
    def configure(cls, model: RobotModel, settings: PipelineSettings) -> StompPlanner:
        """Returns the planner with the parameters of its pipeline; raises PlanningError for an invalid parameter."""
        return cls({group: read_settings(settings.parameters, group) for group in model.groups})

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        """Returns a smooth path of `num_timesteps` states.

        Raises:
            PlanningError: No attempt found a valid path; the message describes the invalid states of the best motion.
        """
        settings = self._settings.get(problem.group.name) or read_settings({})
        goals = problem.goal_states()
        best: Array | None = None
        min_invalid = 0
        for attempt in range(settings.num_attempts):
            search = _Attempt(problem, settings, goals[attempt % len(goals)], is_bowed=attempt >= len(goals))
            if search.run():
                return PlannedPath(search.motion, keep_shape=True)
            invalid = search.invalid_states()
            if best is None or invalid < min_invalid:
                best, min_invalid = search.motion, invalid
            if problem.interrupted():
                break
        assert best is not None
        raise _failure(problem, settings, best)


def _failure(problem: PlanningProblem, settings: StompSettings, motion: Array) -> PlanningError:
    """Returns the error that counts the invalid states of the best motion and explains one of them."""
    reason = (
        no_path(problem, "STOMP")
        if problem.interrupted()
        else PlanningError(
            ErrorCode.PLANNING_FAILED,
            f"STOMP found no path in {settings.num_attempts} attempts of "
            f"{settings.num_iterations} iterations; raise these numbers or choose another goal",
        )
    )
    invalid = [row for row in motion if not problem.state_is_valid(row)]
    if not invalid:
        return PlanningError(
            reason.code,
            f"{reason.reason}; its best motion is invalid only between timesteps: raise num_timesteps",
        )
    middle = problem.motion.full_positions(invalid[len(invalid) // 2])
    contacts = problem.checker.contacts(middle, include_fixed=False)
    violated = "" if problem.constraints is None else problem.constraints.describe(middle)
    return PlanningError(
        reason.code,
        f"{reason.reason}; in its best motion, {len(invalid)} of {len(motion)} timesteps "
        f"are invalid: {describe_contacts(contacts) if contacts else violated}",
        contacts,
    )


class _Attempt:
    """Optimisation of an initial guess to one goal."""

    def __init__(self, problem: PlanningProblem, settings: StompSettings, goal: Array, is_bowed: bool) -> None:
        self._problem, self._settings = problem, settings
        self._costs = StateCosts(problem)
        self._optimiser = Optimiser(settings, *problem.bounds, problem.rng)
        line = self._optimiser.line(problem.start_values, goal)
        self.motion = self._on_constraints(self._optimiser.noisy_copies(line, BOW_STDDEV)[0] if is_bowed else line)

    def run(self) -> bool:
        """Optimises `motion` and returns whether it is valid."""
        settings = self._settings
        valid = self.motion.copy() if self._is_valid() else None
        iterations_after_valid = 0
        cost = self._cost(self.motion)
        stddev = settings.stddev
        copies, costs = np.empty((0, *self.motion.shape)), np.empty((0, len(self.motion)))
        for _ in range(settings.num_iterations):
            if (
                valid is not None and iterations_after_valid >= settings.num_iterations_after_valid
            ) or self._problem.interrupted():
                break
            iterations_after_valid += valid is not None
            kept = np.argsort(costs.sum(axis=1))[: max(0, settings.max_rollouts - settings.num_rollouts)]
            stddevs = stddev * np.resize(NOISE_SCALES, settings.num_rollouts)
            new_copies = self._optimiser.noisy_copies(self.motion, stddevs)
            copies = np.concatenate([new_copies, copies[kept]])
            costs = np.concatenate([self._optimiser.costs(new_copies, self._costs), costs[kept]])
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
        """Replaces the motion by the weighted average or the best rollout if the cheaper of them improves the cost.

        Returns:
            Whether the motion improved, and its cost.
        """
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
        """Projects the inner states onto the path constraints; states whose projection fails stay unchanged."""
        constraints = self._problem.constraints
        if constraints is None:
            return motion
        result = motion.copy()
        indices = self._problem.group.indices
        for step in range(1, len(motion) - 1):
            moved = constraints.project(self._problem.motion.full_positions(motion[step]), indices)
            if moved is not None:
                result[step] = moved[indices]
        return result

    def _is_valid(self) -> bool:
        """Checks the motion exactly."""
        problem, fine = self._problem, self._problem.settings.motion_step
        if problem.motion.colliding_state(self.motion, problem.settings.finest_step) is not None:
            return False
        return problem.constraints is None or all(
            problem.edge_is_valid(first, second, fine)
            for first, second in zip(self.motion[:-1], self.motion[1:], strict=True)
        )

    def invalid_states(self) -> int:
        """Returns the number of invalid time steps."""
        return sum(not self._problem.state_is_valid(row) for row in self.motion)
