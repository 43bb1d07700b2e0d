# SPDX-License-Identifier: BSD-3-Clause
"""Interface between pipelines and planners: planning problem, planned path, planner and validator."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import islice, product
from typing import Any, Protocol

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
from modular_framework_planning.robot_model.robot_model import GOAL_BOUNDS_TOLERANCE, JointGroup, RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

MAX_LONG_WAY_GOALS = 16


class SolutionValidator(Protocol):
    """Validates a timed motion before it is returned to the client."""

    def is_valid(self, problem: PlanningProblem, path: PlannedPath) -> bool:
        """Checks that the trajectory of a path is valid; takes the arguments of `fault`."""
        ...

    def fault(self, problem: PlanningProblem, path: PlannedPath) -> str:
        """Returns the fault of the trajectory of a path, empty if it is valid.

        Args:
            problem: Planning problem with the checker and the constraints.
            path: Path with a trajectory.

        Raises:
            PlanningError: The allowed time is over.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanningProblem:
    """A planning request prepared for a planner; belongs to one thread.

    Attributes:
        request: Planning request, whose scene holds the start positions.
        model: Robot model.
        group: Joints of the planning group, in the order of all joint vectors below.
        start: Start positions of the whole robot [rad or m].
        checker, motion: Collision checks of the whole robot and of the group.
        kinematics: Kinematics solvers of all groups.
        settings: Settings of the pipeline.
        max_velocity, max_acceleration: Limits of the group's joints with scaling applied, shape (joints,).
        rng: Random generator of the planner, so that a seed repeats a plan.
        start_time_s, end_s: Monotonic time at the start of the request and at the end of its allowed time [s].
        deadline_s: Monotonic time at which the planner must stop [s]; the remaining time is reserved for the
            validation.
        solution_validator: Validator of every timed motion.
        planner_id: Planner name, without "group[...]".
        planner_parameters: Settings of the planner from planner_configs.
        constraints: Path constraints, or None.
        step: Maximum joint displacement between collision checks of the search [rad or m].
        repeatable: Whether iterations bound the search instead of the clock.
        phases: Durations of the planning phases.
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
    start_time_s: float
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
        """Planning scene with the robot at the start."""
        return self.request.scene

    @property
    def start_values(self) -> Array:
        """Start joint vector of the group."""
        return self.start[self.group.indices]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the group's joints within the workspace, each of shape (joints,)."""
        return group_bounds(self.model, self.group, self.request.workspace)

    @property
    def compiled_world(self) -> World | None:
        """World for compiled edge checks; None if path constraints or the checker need checks in Python."""
        if self.constraints is not None:
            return None
        world: World | None = getattr(self.checker, "compiled_world", None)  # see the protocol CompiledChecks
        return world

    def search_bounds(self, joint_vectors: Array) -> tuple[Array, Array]:
        """Returns the bounds, limited to one rotation beyond the range of joint vectors; workspace bounds are kept.

        Args:
            joint_vectors: Joint vectors of the group, shape (n, joints).
        """
        low, high = self.bounds
        in_workspace = (high < UNBOUNDED_M) & (self.model.upper[self.group.indices] >= UNBOUNDED_M)
        margin = np.where(in_workspace, np.inf, 2.0 * np.pi)
        return np.maximum(low, joint_vectors.min(axis=0) - margin), np.minimum(high, joint_vectors.max(axis=0) + margin)

    def goal_states(self) -> Array:
        """Returns free goal joint vectors, nearest to the start first, shape (n, joints).

        Raises:
            PlanningError: No goal can be reached; gives the reason.
        """
        if not self._goals:
            with self.phases.measure(GOALS):
                self._goals.append(
                    GoalResolver(
                        self.request,
                        self.kinematics,
                        self.motion,
                        self.rng,
                        path_constraints=self.constraints,
                        must_stop=self._must_stop_resolving,
                    ).resolve()
                )
        return self._goals[0]

    def long_way_goals(self, goals: Array) -> Array:
        """Returns equivalent goals that continuous joints reach by the longer rotation, nearest first.

        Args:
            goals: Goal joint vectors of the group, shape (n, joints).

        Returns:
            At most MAX_LONG_WAY_GOALS joint vectors, shape (m, joints); none for a group without continuous joints.
        """
        start, continuous = self.start_values, self.model.continuous[self.group.indices]
        result: list[Array] = []
        for goal in goals if continuous.any() else ():
            offsets = np.where(continuous & (np.abs(goal - start) > GOAL_BOUNDS_TOLERANCE), goal - start, 0.0)
            shifts = [
                (0.0,) if offset == 0.0 else (0.0, -float(np.copysign(2.0 * np.pi, offset))) for offset in offsets
            ]
            result += [goal + shift for shift in islice(product(*shifts), 1, MAX_LONG_WAY_GOALS)]
        result.sort(key=lambda values: float(np.linalg.norm(values - start)))
        return np.array(result[:MAX_LONG_WAY_GOALS]).reshape(-1, len(start))

    def _must_stop_resolving(self) -> bool:
        """Checks whether the time for goals is over; the second half of the time is reserved for the search.

        A repeatable plan tries all goals, unless it is interrupted.
        """
        if self.repeatable and not self.interrupted():
            return False
        return self.cancelled() or time.monotonic() > 0.5 * (self.start_time_s + self.deadline_s)

    def state_is_valid(self, values: Array) -> bool:
        """Checks that a joint vector is free of collisions and satisfies the path constraints."""
        return self.motion.state_is_free(values) and (
            self.constraints is None or self.constraints.are_satisfied(self.motion.full_positions(values))
        )

    def edge_is_valid(self, first: Array, second: Array, step: float | None = None) -> bool:
        """Checks that an edge is free and satisfies the path constraints, including its end but not its start.

        Args:
            first: Joint vector at the start.
            second: Joint vector at the end.
            step: Maximum joint displacement between checked states [rad or m]; None for the problem's step. Constraints
                are checked no more finely than in the final validation.
        """
        step = step or self.step
        is_satisfied = self.constraints is None or self.satisfies_constraints(np.array([first, second]), step)
        return is_satisfied and self.motion.edge_is_free(first, second, step)

    def satisfies_constraints(self, polyline: Array, step: float) -> bool:
        """Checks that a polyline satisfies the path constraints; its start is not checked.

        Args:
            polyline: Joint vectors, shape (n, joints).
            step: Joint displacement between checked states [rad or m], at least the displacement of the final
                validation.
        """
        return self.constraints is None or self.constraints.edges_satisfied(
            self.motion.full_path(polyline), max(step, self.settings.motion_step)
        )

    def constrained_motion(self, step: float) -> ConstrainedMotion:
        """Returns motions of the group along the path constraints, checked at a distance of `step` [rad or m]."""
        assert self.constraints is not None
        finest = self.settings.motion_step
        return ConstrainedMotion(self.constraints, self.group.indices, self.start, max(step, finest), finest)

    def cancelled(self) -> bool:
        """Checks whether the client cancelled the request."""
        return self.request.cancelled()

    def interrupted(self) -> bool:
        """Checks whether the planner must stop, because the request is cancelled or the time is over."""
        return self.cancelled() or time.monotonic() > self.deadline_s

    def with_start(self, start: Array) -> PlanningProblem:
        """Returns the problem with a different start (positions of the whole robot)."""
        request = replace(self.request, scene=self.scene.with_positions(start))
        motion = MotionChecker(self.checker, self.group.indices, start)
        return replace(self, request=request, start=start, _goals=[], motion=motion)


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPath:
    """A planned path and, after time parameterization, its trajectory.

    Attributes:
        vertices: Joint vectors from start to goal, shape (n, joints).
        trajectory: Trajectory along the path, or None.
        path_prefix: Number of leading vertices that lead out of a colliding start and may collide.
        unconstrained_prefix: Number of leading vertices that may violate the path constraints.
        planner_id: Planner name in the response; empty for the problem's planner_id.
        found_s: Monotonic time at the end of the search [s].
        keep_shape: Whether the path must not be shortened, because the planner follows a given curve.
    """

    vertices: Array
    trajectory: Trajectory | None = None
    path_prefix: int = 0
    unconstrained_prefix: int = 0
    planner_id: str = ""
    found_s: float = 0.0
    keep_shape: bool = False


class Planner(ABC):
    """Base class of planners; only `plan` is required.

    Attributes:
        description: Description for clients; empty for the name of the class.
        planner_ids: Accepted planner names; empty if the planner accepts any name.
        improving_ids: Names of the planners that improve their path until the time is over.
        constrained_planner: Name of the search that replaces a planner if the planner cannot satisfy path constraints;
            empty if there is none.
        auxiliary_constraints: Names of path constraints that are planner inputs, such as the interim point of an arc,
            and do not constrain the motion.
        replaces_bad_values: Whether an unknown planner_id or a scaling factor out of range is replaced by the default
            with a warning, as in OMPL's planning contexts, or raises an error.
        repairs_edges: Whether `repair_path` is implemented. Without it, an invalid motion is a failure of the planner.
        collision_code: Error code for a start or goal in collision; None for the usual code.
        has_own_process: Whether the planner runs in a process of its own, which forked processes cannot share. Its
            plans repeat under a seed only if that process respects the seed.
    """

    description: str = ""
    planner_ids: tuple[str, ...] = ()
    improving_ids: Collection[str] = ()
    constrained_planner: str = ""
    auxiliary_constraints: tuple[str, ...] = ()
    replaces_bad_values: bool = True
    repairs_edges: bool = False
    collision_code: ErrorCode | None = None
    has_own_process: bool = False

    @classmethod
    def configure(cls, model: RobotModel, settings: PipelineSettings) -> Planner:  # noqa: ARG003
        """Creates the planner of a pipeline.

        Args:
            model: Robot model.
            settings: Settings of the pipeline.

        Raises:
            PlanningError: A parameter of the planner is invalid.
        """
        return cls()

    def start(self) -> None:
        """Starts the planner's own process in advance; no effect while it runs.

        Raises:
            PlanningError: The process does not start.
        """
        return

    def close(self) -> None:
        """Ends the planner's own process; may be called twice."""
        return

    @staticmethod
    def parameter_faults(planner_id: str, settings: Mapping[str, object]) -> list[str]:  # noqa: ARG004
        """Returns one message per invalid setting of a planner.

        Args:
            planner_id: Name of the planner.
            settings: Settings of the planner by name.
        """
        return []

    @abstractmethod
    def plan(self, problem: PlanningProblem) -> PlannedPath | Trajectory:
        """Returns a path to be timed, or a trajectory to be returned unchanged.

        Args:
            problem: Planning problem.

        Raises:
            PlanningError: There is no path; gives error code and reason.
        """

    def repair_path(self, problem: PlanningProblem, vertices: Array) -> Array:
        """Returns the path with all edges valid at the step of the final validation.

        Args:
            problem: Planning problem of the path.
            vertices: Joint vectors from start to goal, shape (n, joints).

        Raises:
            EdgeError: An edge could not be repaired.
        """
        raise NotImplementedError


PlanNext = Callable[[PlanningProblem], PlannedPath]


def no_path(problem: PlanningProblem, planner_name: str, checks: int | None = None) -> PlanningError:
    """Returns the error of a search without a path: cancelled, timed out or exhausted.

    Args:
        problem: Planning problem.
        planner_name: Name of the planner.
        checks: Number of checked states and edges, if known.
    """
    elapsed_s = time.monotonic() - problem.start_time_s
    effort = "" if checks is None else f" after {checks} checks"
    if problem.cancelled():
        return PlanningError(ErrorCode.PREEMPTED, f"planning was cancelled after {elapsed_s:.2f} s{effort}")
    timed_out = time.monotonic() > problem.deadline_s
    advice = (
        "start and goal are free, but the passage between them is blocked or narrow: allow more time or change the goal"
        if problem.constraints is None
        else "start and goal are free and satisfy the path constraints, but few or no paths "
        "between them do: allow more time, change the goal or widen the tolerances"
    )
    return PlanningError(
        ErrorCode.TIMED_OUT if timed_out else ErrorCode.PLANNING_FAILED,
        f"{planner_name} found no path in {elapsed_s:.2f} s (allowed {problem.request.allowed_time_s:.2f} s, the last "
        f"{problem.end_s - problem.deadline_s:.2f} s of which are reserved for the validation)"
        f"{': time ran out' if timed_out else ': the search is exhausted'}{effort}; {advice}",
    )
