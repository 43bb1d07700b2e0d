# SPDX-License-Identifier: BSD-3-Clause
"""Turns a request into a checked, timed motion: start, goals, search, shortening, rounding, timing, last check."""
from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from modular_framework_planning import ompl_planning
from modular_framework_planning.blended_path import choose_blends
from modular_framework_planning.collision import ATTACHED, WORLD, CollisionChecker, Contact
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.goals import GoalResolver
from modular_framework_planning.kinematics import KinematicsPool
from modular_framework_planning.motion_check import MotionChecker
from modular_framework_planning.path_shortening import path_length, shorten
from modular_framework_planning.planning_request import PipelineSettings, PlanningAnswer, PlanningRequest
from modular_framework_planning.robot_model import JointGroup, RobotModel
from modular_framework_planning.spatial import Array
from modular_framework_planning.time_parameterization import parameterize
from modular_framework_planning.trajectory import Trajectory

MAX_SHORTENING_S = 1.0
FINE_STEPS = 2.5  # shortening looks at states this many times further apart than the last check does


def describe_contacts(contacts: Sequence[Contact], most: int = 4) -> str:
    """Joins the deepest contacts into one sentence."""
    text = "; ".join(item.describe() for item in contacts[:most])
    return text + (f"; and {len(contacts) - most} more" if len(contacts) > most else "")


class PlanningPipeline:
    """Plans for one robot; threads may share it, each plan has its own collision world."""

    def __init__(self, model: RobotModel, kinematics: KinematicsPool, settings: PipelineSettings) -> None:
        self._model = model
        self._kinematics = kinematics
        self.settings = settings

    def plan(self, request: PlanningRequest) -> PlanningAnswer:
        """Plans a motion.

        Raises:
            PlanningError: with the code and the reason; nothing is returned by halves.
        """
        begun = time.monotonic()
        if not request.allowed_time_s > 0.0:
            raise PlanningError(ErrorCode.TIMED_OUT, f"allowed_planning_time is {request.allowed_time_s} s; "
                                "it must be above 0")
        group = self._model.group(request.group)
        if not group.joints:
            raise PlanningError(ErrorCode.INVALID_GROUP_NAME, f"group '{group.name}' has no joint that can be moved")
        default = self.settings.group_defaults.get(group.name, "")
        planner, parameters = ompl_planning.planner_name(request.planner_id or default,
                                                         self.settings.planner_configs)
        deadline = begun + request.allowed_time_s
        return _Attempt(self, request, group, planner, parameters, begun, deadline).run()

    def solver_pool(self) -> KinematicsPool:
        """Inverse kinematics of the robot's groups."""
        return self._kinematics


class _Attempt:
    """The work on one request."""

    def __init__(self, pipeline: PlanningPipeline, request: PlanningRequest, group: JointGroup, planner: str,
                 parameters: dict[str, object], begun: float, deadline: float) -> None:
        self._settings = pipeline.settings
        self._kinematics = pipeline.solver_pool()
        self._request, self._group, self._planner, self._parameters = request, group, planner, parameters
        self._begun, self._deadline = begun, deadline
        self._model = request.scene.model
        self._rng = np.random.default_rng(self._settings.seed)
        self._steps = (self._settings.search_step, 0.4 * self._settings.search_step, self._settings.motion_step)

    def run(self) -> PlanningAnswer:
        """Plans; a path that fails the last check is searched again on a finer grid."""
        start_all = self._start_within_bounds()
        checker, contacts = self._start_checker(start_all)
        motion = MotionChecker(checker, self._group.indices, start_all)
        start = start_all[self._group.indices]
        lead_in = self._leave_collision(checker, motion, start, contacts)
        goals = GoalResolver(self._request, self._group, self._kinematics, checker, motion, self._rng).resolve()
        for step in self._steps:
            path = self._best_path(motion, lead_in[-1], goals, step)
            found = time.monotonic()
            path = self._shortened(motion, path, step)
            trajectory = self._timed(motion, path, lead_in)
            if trajectory is not None:
                whole = np.vstack([lead_in[:-1], path])
                return PlanningAnswer(trajectory, start_all, motion.whole(path[-1]), whole, self._planner,
                                      found - self._begun, time.monotonic() - self._begun)
        raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, "every path found touched an obstacle when checked at "
                            f"{self._settings.motion_step} rad steps; move the goal or the start away from contact")

    def _start_within_bounds(self) -> Array:
        positions = np.array(self._request.scene.positions)
        if not np.isfinite(positions).all():
            raise PlanningError(ErrorCode.INVALID_ROBOT_STATE, "start state: a joint position is not finite")
        inner = np.clip(positions, self._model.lower, self._model.upper)
        indices = self._group.indices
        if np.abs(positions - inner)[indices].max() > self._settings.start_state_max_bounds_error:
            problems = self._model.bound_violations(positions, indices)
            raise PlanningError(ErrorCode.START_STATE_INVALID, f"start state: {'; '.join(problems)}; at most "
                                f"{self._settings.start_state_max_bounds_error} beyond a bound is pulled back")
        positions[indices] = inner[indices]
        return positions

    def _start_checker(self, start: Array) -> tuple[CollisionChecker, list[Contact]]:
        """Builds the collision world of this plan, with shallow contacts of held bodies tolerated."""
        checker = CollisionChecker(self._request.scene, self._group.indices)
        fixed = checker.fixed_contacts(start)
        if fixed:
            raise PlanningError(ErrorCode.START_STATE_IN_COLLISION, f"start state: {describe_contacts(fixed)}; no "
                                f"joint of group '{self._group.name}' can change that; allow the pair or move it")
        if checker.is_free(start):
            return checker, []
        contacts = checker.contacts(start, include_fixed=False)
        shallow = [item for item in contacts if {item.first.kind, item.second.kind} == {ATTACHED, WORLD}
                   and item.depth <= self._settings.start_state_contact_tolerance]
        if shallow:
            checker = CollisionChecker(self._request.scene, self._group.indices, shallow)
        return checker, [item for item in contacts if item not in shallow]

    def _leave_collision(self, checker: CollisionChecker, motion: MotionChecker, start: Array,
                         contacts: list[Contact]) -> Array:
        """Returns vertices from the start to a free state; only the start itself where that is free."""
        if not contacts and motion.state_is_free(start):
            return start[None, :]
        low, high = self._model.lower[self._group.indices], self._model.upper[self._group.indices]
        reach = self._settings.jiggle_fraction * np.minimum(high - low, 2.0 * np.pi)
        shallow = all(item.depth <= self._settings.start_state_collision_depth for item in contacts)
        for number in range(self._settings.max_sampling_attempts if shallow else 0):
            share = (number + 1) / self._settings.max_sampling_attempts
            moved = np.clip(start + share * self._rng.uniform(-reach, reach), low, high)
            if motion.state_is_free(moved):
                return np.vstack([start, moved])
        raise PlanningError(ErrorCode.START_STATE_IN_COLLISION, "start state in collision: "
                            f"{describe_contacts(contacts)}; " + (
                                f"no free state within {self._settings.jiggle_fraction:.0%} of the joints' ranges"
                                if shallow else "too deep to move out of; allow the pair or move the object"))

    def _best_path(self, motion: MotionChecker, start: Array, goals: Array, step: float) -> Array:
        def edge(first: Array, second: Array) -> bool:
            return motion.edge_is_free(first, second, step)

        for goal in goals:
            if edge(start, goal):
                return np.vstack([start, goal])
        lower = np.maximum(self._model.lower[self._group.indices], np.minimum(start, goals.min(axis=0)) - 2.0 * np.pi)
        upper = np.minimum(self._model.upper[self._group.indices], np.maximum(start, goals.max(axis=0)) + 2.0 * np.pi)
        problem = ompl_planning.JointProblem(lower, upper, start, goals, motion.state_is_free, edge,
                                             self._request.cancelled)
        paths = []
        for _ in range(max(1, self._request.attempts)):
            path = ompl_planning.solve(problem, self._planner, self._parameters, self._deadline)
            if path is not None:
                paths.append(path)
            if self._request.cancelled() or time.monotonic() > self._deadline:
                break
        if not paths:
            raise self._no_path()
        return min(paths, key=path_length)

    def _no_path(self) -> PlanningError:
        spent = time.monotonic() - self._begun
        if self._request.cancelled():
            return PlanningError(ErrorCode.PREEMPTED, f"planning was cancelled after {spent:.2f} s")
        code = ErrorCode.TIMED_OUT if time.monotonic() > self._deadline else ErrorCode.PLANNING_FAILED
        return PlanningError(code, f"{self._planner} found no path in {spent:.2f} s (allowed "
                             f"{self._request.allowed_time_s:.2f} s); start and goal are free, so the way between them "
                             "is blocked or narrow: allow more time or choose another goal")

    def _shortened(self, motion: MotionChecker, path: Array, step: float) -> Array:
        """Shortens; what it accepts was also looked at on the fine grid."""
        limit = min(max(self._deadline, time.monotonic() + 0.05), time.monotonic() + MAX_SHORTENING_S)
        fine = min(step, FINE_STEPS * self._settings.motion_step)

        def edge(first: Array, second: Array) -> bool:
            return motion.edge_is_free(first, second, step) and motion.edge_is_free(first, second, fine)

        return shorten(path, edge, limit, self._rng)

    def _timed(self, motion: MotionChecker, path: Array, lead_in: Array) -> Trajectory | None:
        """Rounds, times and checks a path; None where it touches something on the fine grid."""
        fine = self._settings.motion_step
        vertices = np.vstack([lead_in[:-1], path])
        if len(vertices) == 2 and np.abs(vertices[1] - vertices[0]).max() < 1e-9:
            vertices = vertices[1:]
        velocity, acceleration = self._scaled_limits()
        blends = choose_blends(vertices, self._settings.blend_deviation,
                               lambda curve: motion.first_collision(curve, fine) is None)
        for candidate in (blends, np.zeros_like(blends)):
            try:
                trajectory = parameterize(self._group.joints, vertices, candidate, velocity, acceleration)
            except PlanningError:
                if not candidate.any():
                    raise
                continue
            samples = trajectory.positions
            if len(lead_in) > 1:
                samples = samples[np.argmin(np.linalg.norm(samples - lead_in[-1], axis=1)):]
            if motion.first_collision(samples, fine) is None:
                return trajectory
            if not candidate.any():
                return None
        return None

    def _scaled_limits(self) -> tuple[Array, Array]:
        factors = []
        for name, value, default in (
                ("max_velocity_scaling_factor", self._request.velocity_scaling,
                 self._settings.default_velocity_scaling_factor),
                ("max_acceleration_scaling_factor", self._request.acceleration_scaling,
                 self._settings.default_acceleration_scaling_factor)):
            if not np.isfinite(value) or value < 0.0 or value > 1.0:
                raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"{name} is {value}; allowed is 0 < factor <= 1, "
                                    f"or 0 for the default {default}")
            factors.append(value if value > 0.0 else default)
        return (self._model.max_velocity[self._group.indices] * factors[0],
                self._model.max_acceleration[self._group.indices] * factors[1])
