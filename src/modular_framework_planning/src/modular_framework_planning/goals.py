# SPDX-License-Identifier: BSD-3-Clause
"""Turns the goals of a request into free joint vectors, or says why there is none."""
from __future__ import annotations

import numpy as np

from modular_framework_planning.collision import CollisionChecker
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.kinematics import KinematicsPool, first_free
from modular_framework_planning.motion_check import MotionChecker
from modular_framework_planning.planning_request import JointGoal, PlanningRequest, PoseGoal
from modular_framework_planning.robot_model import JointGroup
from modular_framework_planning.spatial import Array

MAX_GOAL_STATES = 8
IK_TIMEOUT_S = 0.2


class GoalResolver:
    """Resolves the goals of one request."""

    def __init__(self, request: PlanningRequest, group: JointGroup, kinematics: KinematicsPool,
                 checker: CollisionChecker, motion: MotionChecker, rng: np.random.Generator) -> None:
        self._request, self._group, self._kinematics = request, group, kinematics
        self._checker, self._motion, self._rng = checker, motion, rng
        self._model = request.scene.model

    def resolve(self) -> Array:
        """Returns free goal vectors of the group, nearest to the start first, shape (n, joints).

        Raises:
            PlanningError: no goal was given, or none can be reached; the first goal's reason is told.
        """
        if not self._request.goals:
            raise PlanningError(ErrorCode.INVALID_GOAL_CONSTRAINTS, "the request has no goal; give joint constraints "
                                "or a position and an orientation constraint")
        vectors: list[Array] = []
        failures: list[PlanningError] = []
        for goal in self._request.goals:
            try:
                vectors += [self._joint(goal)] if isinstance(goal, JointGoal) else self._pose(goal)
            except PlanningError as error:
                failures.append(error)
        if not vectors:
            raise failures[0]
        start = self._request.scene.positions[self._group.indices]
        vectors.sort(key=lambda values: float(np.linalg.norm(values - start)))
        return np.array(vectors[:MAX_GOAL_STATES])

    def _joint(self, goal: JointGoal) -> Array:
        values = np.array(self._request.scene.positions[self._group.indices])
        for name, target in goal.positions.items():
            if name not in self._group.joints:
                raise PlanningError(ErrorCode.INVALID_GOAL_CONSTRAINTS, f"goal: joint '{name}' is not in group "
                                    f"'{self._group.name}'; its joints are {', '.join(self._group.joints)}")
            number = self._model.index[name]
            low = max(self._model.lower[number], target - goal.below.get(name, 0.0))
            high = min(self._model.upper[number], target + goal.above.get(name, 0.0))
            if low > high + 1e-6:
                raise PlanningError(ErrorCode.GOAL_STATE_INVALID, f"goal: joint '{name}' at {target:.4f} is outside "
                                    f"[{self._model.lower[number]:.4f}, {self._model.upper[number]:.4f}]")
            values[self._group.joints.index(name)] = np.clip(target, min(low, high), max(low, high))
        self._require_free(values, "goal")
        return values

    def _require_free(self, values: Array, what: str) -> None:
        from modular_framework_planning.pipeline import describe_contacts

        if not self._motion.state_is_free(values):
            contacts = self._checker.contacts(self._motion.whole(values), include_fixed=False)
            raise PlanningError(ErrorCode.GOAL_IN_COLLISION, f"{what} in collision: {describe_contacts(contacts)}")

    def _pose(self, goal: PoseGoal) -> list[Array]:
        solver = self._kinematics.solver(self._group.name)
        seed = self._request.scene.positions
        found = solver.solutions(goal.link, goal.target, seed, IK_TIMEOUT_S, self._rng)
        if not found:
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, solver.explain_unreachable(goal.link, goal.target, seed))
        candidates = [positions[self._group.indices] for positions in found]
        free = first_free(candidates, self._motion.state_is_free, MAX_GOAL_STATES)
        if not free:
            self._require_free(candidates[0], f"goal: all {len(found)} inverse kinematics solutions "
                               f"for '{goal.link}' collide; the nearest is")
        return free
