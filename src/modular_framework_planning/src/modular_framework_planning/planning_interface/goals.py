# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of planning goals to free joint vectors.

The number of samples per goal is fixed and does not depend on the clock, so that a seed repeats its goals.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from modular_framework_planning.constraints.constraint_kinds import JointConstraint
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.contacts import describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics, KinematicsPool
from modular_framework_planning.kinematics.solution_choice import first_free
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planning_request import (
    ConstraintGoal,
    JointGoal,
    PlanningRequest,
    PoseGoal,
    group_bounds,
)
from modular_framework_planning.robot_model.robot_model import GOAL_BOUNDS_TOLERANCE

MAX_GOAL_STATES = 8
MAX_SAMPLES = 64  # states tried within the tolerances of a goal
MAX_POSES = 16  # poses tried within the tolerances of a goal


class GoalResolver:
    """Converts the goals of a request to joint vectors."""

    def __init__(
        self,
        request: PlanningRequest,
        kinematics: KinematicsPool,
        motion: MotionChecker,
        rng: np.random.Generator,
        *,
        path_constraints: KinematicConstraints | None = None,
        must_stop: Callable[[], bool] = lambda: False,
    ) -> None:
        """Stores the arguments.

        Args:
            request: Planning request with the goals.
            kinematics: Kinematics solvers of all groups.
            motion: Motion checker of the group.
            rng: Random generator.
            path_constraints: Path constraints that goal states must satisfy.
            must_stop: Returns True to skip the remaining goals.
        """
        self._must_stop = must_stop
        self._request, self._kinematics = request, kinematics
        self._checker, self._motion, self._rng = motion.checker, motion, rng
        self._path_constraints = path_constraints
        self._model = request.scene.model
        self._group = group = self._model.group(request.group)
        self._start = request.scene.positions[group.indices]
        self._bounds = group_bounds(self._model, group, request.workspace)

    def resolve(self) -> Array:
        """Returns free goal vectors of the group, nearest to the start first, shape (n, joints).

        Raises:
            PlanningError: The request has no goal, or no goal can be reached; gives the reason for the first goal.
        """
        if not self._request.goals:
            raise PlanningError(
                ErrorCode.INVALID_GOAL_CONSTRAINTS,
                "the request has no goal; add joint constraints, or a position and an orientation constraint",
            )
        vectors: list[Array] = []
        failures: list[PlanningError] = []
        for index, goal in enumerate(self._request.goals):
            if index and self._must_stop():
                if vectors:
                    break
                raise PlanningError(
                    ErrorCode.TIMED_OUT,
                    f"goal_constraints: {index} of {len(self._request.goals)} "
                    f"goals were tried in the allowed {self._request.allowed_time_s:.2f} s, "
                    f"and none can be reached ({failures[0].reason}); allow more time or request fewer goals",
                )
            try:
                vectors += self._vectors(goal)
            except PlanningError as error:
                failures.append(error)
        if not vectors:
            raise failures[0]
        vectors.sort(key=lambda values: float(np.linalg.norm(values - self._start)))
        return np.array(vectors[:MAX_GOAL_STATES])

    def _vectors(self, goal: JointGoal | PoseGoal | ConstraintGoal) -> list[Array]:
        match goal:
            case JointGoal():
                return [self._joint(goal)]
            case PoseGoal():
                return self._pose(goal)
            case ConstraintGoal():
                return self._region(goal.constraints)
        raise TypeError(f"{type(goal).__name__} is not a goal")

    def _is_valid(self, values: Array) -> bool:
        """Checks that a state satisfies the path constraints and is free."""
        constraints = self._path_constraints
        return (constraints is None or constraints.are_satisfied(self._motion.full_positions(values))) and (
            self._motion.state_is_free(values)
        )

    def _rejection(self, values: Array, subject: str) -> PlanningError:
        """Returns the error that explains why the best candidate of a goal is invalid."""
        full, constraints = self._motion.full_positions(values), self._path_constraints
        if constraints is not None and not constraints.are_satisfied(full):
            return PlanningError(
                ErrorCode.GOAL_VIOLATES_PATH_CONSTRAINTS,
                f"{subject} violates the path constraints: "
                f"{constraints.describe(full)}; move the goal or widen the tolerances",
            )
        contacts = self._checker.contacts(full, include_fixed=False)
        return PlanningError(
            ErrorCode.GOAL_IN_COLLISION, f"{subject} is in collision: {describe_contacts(contacts)}", contacts
        )

    def _joint(self, goal: JointGoal) -> Array:
        """Returns the target if it is valid, otherwise the first valid state found within the tolerances."""
        target, low, high = self._joint_ranges(goal)
        if self._is_valid(target):
            return target
        if (high > low).any():
            for index in range(MAX_SAMPLES):
                fraction = (index + 1) / MAX_SAMPLES
                values = target + fraction * (self._rng.uniform(low, high) - target)
                if self._is_valid(values):
                    return values
        raise self._rejection(target, "goal")

    def _joint_ranges(self, goal: JointGoal) -> tuple[Array, Array, Array]:
        """Returns target, minimum and maximum of the group's joints, with the nearest rotation of continuous joints."""
        goal = goal.without_mimic_joints(self._model.document.mimics)
        values = np.array(self._start)
        low, high = values.copy(), values.copy()
        for name, target_value in goal.positions.items():
            if name not in self._group.joints:
                raise PlanningError(
                    ErrorCode.INVALID_GOAL_CONSTRAINTS,
                    f"goal: joint '{name}' is not in group "
                    f"'{self._group.name}'; its joints are {', '.join(self._group.joints)}",
                )
            index, column = self._model.index[name], self._group.joints.index(name)
            bounds = self._bounds[0][column], self._bounds[1][column]
            if self._model.is_continuous(index):
                target_value += 2.0 * np.pi * np.round((values[column] - target_value) / (2.0 * np.pi))
            min_value = max(bounds[0], target_value - goal.below.get(name, 0.0))
            max_value = min(bounds[1], target_value + goal.above.get(name, 0.0))
            if min_value > max_value + GOAL_BOUNDS_TOLERANCE:
                raise PlanningError(
                    ErrorCode.GOAL_STATE_INVALID,
                    f"goal: joint '{name}' at {target_value:.6f} is outside "
                    f"[{bounds[0]:.6f}, {bounds[1]:.6f}]; it may exceed a bound by at most {GOAL_BOUNDS_TOLERANCE}"
                    + ("; workspace_parameters bound the base" if self._is_base_variable(name) else ""),
                )
            low[column], high[column] = np.clip((min(min_value, max_value), max(min_value, max_value)), *bounds)
            values[column] = np.clip(target_value, low[column], high[column])
        return values, low, high

    def _is_base_variable(self, joint: str) -> bool:
        return self._model.base is not None and joint in self._model.base.variables

    def _in_workspace(self, constraints: KinematicConstraints) -> KinematicConstraints:
        """Returns the constraints with bounds on the base position added, if the group moves the base."""
        base_joints = [
            name for name in (self._model.base.translations if self._model.base else ()) if name in self._group.joints
        ]
        if not base_joints:
            return constraints
        limits = []
        for name in base_joints:
            low, high = (float(values[self._group.joints.index(name)]) for values in self._bounds)
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            limits.append(JointConstraint(name, self._model.index[name], middle, half, half))
        return KinematicConstraints(
            self._model,
            (*constraints.joints, *limits),
            constraints.positions,
            constraints.orientations,
            constraints.name,
        )

    def _pose(self, goal: PoseGoal) -> list[Array]:
        """Returns free solutions at the target pose or, if none exists, at poses within the tolerances."""
        seed, allowed = self._request.scene.positions, goal.allowed
        try:
            solver = self._kinematics.solver(self._group.name)
            if solver.settings.position_only:
                return self._position(goal, solver)
            solutions = solver.solutions(
                goal.link, goal.target, seed, timeout_s=math.inf, rng=self._rng, bounds=self._bounds
            )
        except PlanningError:
            if allowed is None:
                raise
            return self._region(allowed)  # least squares, because no chain leads to the link
        candidates = [positions[self._group.indices] for positions in solutions]
        free = first_free(candidates, self._is_valid, MAX_GOAL_STATES)
        if allowed is not None and allowed.is_loose:
            nearest = self._in_workspace(allowed).project(seed, self._group.indices)
            if nearest is not None and self._is_valid(nearest[self._group.indices]):
                free.append(nearest[self._group.indices])
            if not free:
                alternatives = self._solutions_within_tolerances(goal, allowed, solver)
                free, candidates = first_free(alternatives, self._is_valid, MAX_GOAL_STATES), candidates + alternatives
        if free:
            return free
        if not candidates:
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, solver.explain_unreachable(goal.link, goal.target, seed))
        raise self._rejection(
            candidates[0],
            f"goal: all {len(candidates)} inverse kinematics solutions for '{goal.link}' collide; the nearest"
            if self._path_constraints is None
            else f"goal: all {len(candidates)} inverse kinematics solutions for '{goal.link}' are invalid; the nearest",
        )

    def _position(self, goal: PoseGoal, solver: InverseKinematics) -> list[Array]:
        """Returns free solutions that place the goal's point at its position, in any orientation."""
        seed, allowed, indices = self._request.scene.positions, goal.allowed, self._group.indices
        point, position = np.zeros(3), goal.target.translation
        if allowed is not None:
            offset, frame = allowed.positions[0].offset, allowed.pose_target(seed)
            point, position = (goal.target.inverse() * frame).act(offset), frame.act(offset)
        solutions = [item[indices] for item in solver.position_solutions(goal.link, point, position, seed, math.inf)]
        low, high = self._bounds
        candidates = [values for values in solutions if ((low <= values) & (values <= high)).all()]
        free = first_free(candidates, self._is_valid, MAX_GOAL_STATES)
        if free:
            return free
        if allowed is not None:
            return self._region(KinematicConstraints(self._model, (), allowed.positions, (), allowed.name))
        if candidates:
            raise self._rejection(
                candidates[0], f"goal: all solutions found for '{goal.link}' are invalid; the nearest"
            )
        raise PlanningError(ErrorCode.NO_IK_SOLUTION, solver.explain_unreachable(goal.link, goal.target, seed))

    def _solutions_within_tolerances(
        self, goal: PoseGoal, allowed: KinematicConstraints, solver: InverseKinematics
    ) -> list[Array]:
        """Returns solutions at random poses within the tolerances."""
        seed, indices = self._request.scene.positions, self._group.indices
        to_link = allowed.pose_target(seed).inverse() * goal.target
        result: list[Array] = []
        for _ in range(MAX_POSES):
            target = allowed.pose_target(seed, self._rng) * to_link
            solutions = solver.solutions(
                goal.link, target, seed, timeout_s=math.inf, rng=self._rng, bounds=self._bounds
            )
            result += [positions[indices] for positions in solutions if allowed.are_satisfied(positions)]
        return result

    def _region(self, constraints: KinematicConstraints) -> list[Array]:
        """Returns free states that satisfy the constraints: the state nearest to the start and random states."""
        seed, indices = self._request.scene.positions, self._group.indices
        constraints = self._in_workspace(constraints)
        free: list[Array] = []
        rejected: list[Array] = []
        for index in range(MAX_SAMPLES):
            state = (
                constraints.project(seed, indices) if index == 0 else (constraints.sample(self._rng, seed, indices, 1))
            )
            if state is not None:
                (free if self._is_valid(state[indices]) else rejected).append(state[indices])
            if len(free) >= MAX_GOAL_STATES:
                break
        if free:
            return free
        if rejected:
            raise self._rejection(
                rejected[0], f"goal: all {len(rejected)} states found in the goal region are invalid; the nearest"
            )
        raise PlanningError(
            ErrorCode.GOAL_CONSTRAINTS_VIOLATED,
            "goal region was empty: no state of group "
            f"'{self._group.name}' within its joint bounds satisfies all constraints; from the start, "
            f"{constraints.describe(seed)}",
        )
