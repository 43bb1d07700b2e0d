# SPDX-License-Identifier: BSD-3-Clause
"""Problem, path and protocols: the interface between pipelines and planners."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import islice, product
from typing import Any, Protocol, runtime_checkable

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_collision import World
from modular_framework_planning.constraints.constrained_motion import ConstrainedMotion
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker
from modular_framework_planning.planning_interface.goals import GoalResolver
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.phase_times import GOALS, PhaseTimes
from modular_framework_planning.planning_interface.planning_request import (
    PipelineSettings,
    PlanningRequest,
    group_bounds,
)
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.multi_dof_joint import UNBOUNDED_M
from modular_framework_planning.robot_model.robot_model import BEYOND_BOUND, JointGroup, RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

MAX_TURNED = 16  # goals by the longer way round that are searched for


class SolutionValidator(Protocol):
    """Checks a timed motion before a client gets it."""

    def is_valid(self, problem: PlanningProblem, path: PlannedPath) -> bool:
        """Whether nothing is wrong with the timed motion of a path; takes the same arguments as `fault`."""
        ...

    def fault(self, problem: PlanningProblem, path: PlannedPath) -> str:
        """Returns what is wrong with the timed motion of a path; empty where nothing is.

        Args:
            problem: the problem that was planned; its checker and constraints are used.
            path: with a trajectory.

        Raises:
            PlanningError: the check takes longer than the request allows.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class PlanningProblem:
    """One request made ready for a planner; belongs to one thread.

    Attributes:
        request: what was asked; its scene holds the start positions.
        group: the joints to move; joint vectors below have their order.
        start: positions of the whole robot [rad or m].
        checker, motion: answer whether states and edges are free of collisions.
        max_velocity, max_acceleration: limits of the group's joints, scaling applied, shape (joints,).
        rng: the only source of random numbers a planner uses, so that a seed repeats its plan.
        begun_s, end_s: time.monotonic() at which the request came, and at which its allowed time ends.
        deadline_s: time.monotonic() at which the planner gives up: what is left then is for the check of the motion.
        planner_id: the planner chosen (without "group[...]" around it); planner_parameters: its entry in
            planner_configs.
        constraints: path constraints every state must satisfy, or None.
        step: distance of collision checks along an edge of the search [rad or m].
        solution_validator: what every timed motion must pass.
        repeatable: the search is bounded by iterations and not by the clock.
        phases: how long the parts of the plan took so far.
    """

    request: PlanningRequest
    model: RobotModel
    group: JointGroup
    start: Array
    checker: CollisionChecker
    motion: MotionChecker
    kinematics: KinematicsPool
    settings: PipelineSettings
    max_velocity: Array
    max_acceleration: Array
    rng: np.random.Generator
    begun_s: float
    deadline_s: float
    end_s: float
    solution_validator: SolutionValidator
    planner_id: str = ""
    planner_parameters: Mapping[str, Any] = field(default_factory=dict)
    constraints: KinematicConstraints | None = None
    step: float = 0.05
    repeatable: bool = False
    phases: PhaseTimes = field(default_factory=PhaseTimes)
    _goals: list[Array] = field(default_factory=list)

    @property
    def scene(self) -> PlanningScene:
        """The world, with the robot at the start."""
        return self.request.scene

    @property
    def start_values(self) -> Array:
        """The start as a joint vector of the group."""
        return self.start[self.group.indices]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the group's joints within the request's workspace, each of shape (joints,)."""
        return group_bounds(self.model, self.group, self.request.workspace)

    @property
    def compiled_world(self) -> World | None:
        """The world in which compiled loops may check straight motions; None where these have to do more than that."""
        if self.constraints is not None:
            return None
        world: World | None = getattr(self.checker, "compiled_world", None)  # see the protocol CompiledChecks
        return world

    def search_bounds(self, around: Array) -> tuple[Array, Array]:
        """Returns the bounds, no wider than two turns around joint vectors; a workspace is kept whole.

        Args:
            around: joint vectors of the group, shape (n, joints).
        """
        low, high = self.bounds
        in_workspace = (high < UNBOUNDED_M) & (self.model.upper[self.group.indices] >= UNBOUNDED_M)
        reach = np.where(in_workspace, np.inf, 2.0 * np.pi)
        return np.maximum(low, around.min(axis=0) - reach), np.minimum(high, around.max(axis=0) + reach)

    def goal_states(self) -> Array:
        """Returns free joint vectors that reach a goal, nearest to the start first, shape (n, joints).

        Raises:
            PlanningError: there is none; says why.
        """
        if not self._goals:
            with self.phases.measured(GOALS):
                self._goals.append(
                    GoalResolver(
                        self.request,
                        self.group,
                        self.kinematics,
                        self.checker,
                        self.motion,
                        self.rng,
                        self.constraints,
                        self._goals_must_end,
                    ).resolve()
                )
        return self._goals[0]

    def other_ways_round(self, goals: Array) -> Array:
        """Returns the same goals with joints without ends turned to them by the longer way, the nearest first.

        Args:
            goals: joint vectors of the group, shape (n, joints).

        Returns:
            At most MAX_TURNED joint vectors, shape (m, joints); none where no joint of the group turns without end.
        """
        start, endless = self.start_values, self.model.endless[self.group.indices]
        found: list[Array] = []
        for goal in goals if endless.any() else ():
            gaps = np.where(endless & (np.abs(goal - start) > BEYOND_BOUND), goal - start, 0.0)
            turns = [(0.0,) if gap == 0.0 else (0.0, -float(np.copysign(2.0 * np.pi, gap))) for gap in gaps]
            found += [goal + shift for shift in islice(product(*turns), 1, MAX_TURNED)]
        found.sort(key=lambda values: float(np.linalg.norm(values - start)))
        return np.array(found[:MAX_TURNED]).reshape(-1, len(start))

    def _goals_must_end(self) -> bool:
        """Whether no further goal may be tried: half the time is for the search.

        Where the plan must be repeatable, all goals are tried, or none is used.
        """
        if self.repeatable and not self.interrupted():
            return False
        return self.cancelled() or time.monotonic() > 0.5 * (self.begun_s + self.deadline_s)

    def state_is_valid(self, values: Array) -> bool:
        """Whether a joint vector is free of collisions and satisfies the path constraints."""
        return self.motion.state_is_free(values) and (
            self.constraints is None or self.constraints.satisfied(self.motion.full_positions(values))
        )

    def edge_is_valid(self, first: Array, second: Array, step: float | None = None) -> bool:
        """Whether the straight motion is free and satisfies the path constraints (its start is not checked).

        Constraints are checked no more finely than the solution validator does.
        """
        step = step or self.step
        keeps = self.constraints is None or self.keeps_constraints(np.array([first, second]), step)
        return keeps and self.motion.edge_is_free(first, second, step)

    def keeps_constraints(self, polyline: Array, step: float) -> bool:
        """Whether straight motions satisfy the path constraints (their start is not checked).

        Args:
            polyline: joint vectors, shape (n, joints).
            step: distance of samples [rad or m]; it is never finer than the solution validator's.
        """
        return self.constraints is None or self.constraints.edges_hold(
            self.motion.full_path(polyline), max(step, self.settings.motion_step)
        )

    def constrained_motion(self, step: float) -> ConstrainedMotion:
        """Returns motions of the group along the path constraints, which are looked at `step` apart [rad or m]."""
        assert self.constraints is not None
        finest = self.settings.motion_step
        return ConstrainedMotion(self.constraints, self.group.indices, self.start, max(step, finest), finest)

    def cancelled(self) -> bool:
        """Whether a stop was requested."""
        return self.request.cancelled()

    def interrupted(self) -> bool:
        """Whether the planner must stop: cancelled, or the time is over."""
        return self.cancelled() or time.monotonic() > self.deadline_s

    def with_start(self, start: Array) -> PlanningProblem:
        """Returns the problem from another start (positions of the whole robot)."""
        request = replace(self.request, scene=self.scene.with_positions(start))
        motion = MotionChecker(self.checker, self.group.indices, start, self.settings.finest_step)
        return replace(self, request=request, start=start, _goals=[], motion=motion)


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPath:
    """A path, timed or not yet.

    Attributes:
        vertices: joint vectors from start to goal, shape (n, joints).
        trajectory: the timed motion, once there is one.
        path_prefix: number of vertices before the first that has to be free: those that lead out of a colliding start.
        unconstrained: number of vertices before the first that has to satisfy the path constraints.
        planner_id: the planner's name in the response; empty for the problem's own planner_id.
        found_s: time.monotonic() when the planner was done.
        is_short: the path must not be shortened (the planner follows a given line).
    """

    vertices: Array
    trajectory: Trajectory | None = None
    path_prefix: int = 0
    unconstrained: int = 0
    planner_id: str = ""
    found_s: float = 0.0
    is_short: bool = False


@runtime_checkable
class Planner(Protocol):
    """A planner: one class with one method.

    A class may also have, each optional:
        planner_ids: names it takes as planner_id; any name when it is absent or empty.
        improving_ids: those of them that improve their path until their time is over.
        replaces_bad_values: whether an unknown planner_id and scaling out of range give a warning and defaults, as in
            OMPL's planning contexts, or are refused; true when it is absent.
        configure(model, settings): class method that makes it; without one it is made without arguments.
        auxiliary_constraints: names of path constraints that are input of the planner (such as the interim point of
            a circle), which then need not be kept by the motion.
        collision_code: the error code for a start or goal in collision, where it is not the one of that name.
        repaired(problem, vertices): the path with every edge valid at the steps of the solution validator, or
            EdgeError. The pipeline repairs nothing by itself: a motion that fails the check is the planner's failure.
    """

    def plan(self, problem: PlanningProblem) -> PlannedPath | Trajectory:
        """Plans, or raises PlanningError with code and reason. A Trajectory is timed and stays as it is."""
        ...


PlanNext = Callable[[PlanningProblem], PlannedPath]


def no_path(problem: PlanningProblem, what: str, states: int | None = None) -> PlanningError:
    """Says why a search ended without a path: cancelled, time over, or nothing left to try.

    Args:
        problem: what was searched.
        what: name of the planner.
        states: how many states were tried, where that is known.
    """
    spent = time.monotonic() - problem.begun_s
    tried = "" if states is None else f" after {states} states"
    if problem.cancelled():
        return PlanningError(ErrorCode.PREEMPTED, f"planning was cancelled after {spent:.2f} s{tried}")
    timed_out = time.monotonic() > problem.deadline_s
    where = (
        "start and goal are free, so the way between them is blocked or narrow: allow more time or choose another goal"
        if problem.constraints is None
        else "start and goal are free and satisfy the path constraints, but no or hardly a way "
        "between them does: allow more time, choose another goal or widen the tolerances"
    )
    return PlanningError(
        ErrorCode.TIMED_OUT if timed_out else ErrorCode.PLANNING_FAILED,
        f"{what} found no path in {spent:.2f} s (allowed {problem.request.allowed_time_s:.2f} s, the last "
        f"{problem.end_s - problem.deadline_s:.2f} s of them for the check of a motion)"
        f"{': time ran out' if timed_out else ': nothing was left to try'}{tried}; {where}",
    )
