# SPDX-License-Identifier: BSD-3-Clause
"""Planning pipeline: runs request adapters and planner, and validates every motion before it is returned."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from modular_framework_planning.contacts import ATTACHED, WORLD, describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.plan_statistics import PlannerRun
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker, CollisionCheckerFactory
from modular_framework_planning.planning_interface.collision_detectors import DEFAULT_CHECKER, checker_name
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.path_repair import EdgeError
from modular_framework_planning.planning_interface.phase_times import SETUP, PhaseTimes
from modular_framework_planning.planning_interface.planner_configurations import (
    PlannerConfigurations,
    resolve_configuration,
    without_group,
)
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, Planner, PlanningProblem
from modular_framework_planning.planning_interface.planning_request import (
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
    PoseGoal,
)
from modular_framework_planning.planning_pipeline.adapters.limit_max_cartesian_link_speed import (
    LimitMaxCartesianLinkSpeed,
)
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter, chain
from modular_framework_planning.planning_pipeline.path_search import PathSearch
from modular_framework_planning.planning_pipeline.trajectory_validator import TrajectoryValidator
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import JointGroup
from modular_framework_ros.allowed_names import nearest

RESERVED_S, RESERVED_FRACTION = 0.25, 0.2  # time reserved for repair, timing and validation
ANYTIME_RESERVED_S = 1.0  # larger reserve for anytime planners, which always use all of their time
COLLISION_ERROR_CODES = (ErrorCode.START_STATE_IN_COLLISION, ErrorCode.GOAL_IN_COLLISION)
LOGGER = logging.getLogger("rosout.planning_pipeline")


class PlanningPipeline:
    """Plans motions of a robot; thread-safe, because each plan has its own collision checker."""

    def __init__(
        self,
        kinematics: KinematicsPool,
        settings: PipelineSettings,
        planner: Planner,
        *,
        adapters: Sequence[RequestAdapter] = (),
        name: str = "ompl",
        new_checker: CollisionCheckerFactory = DEFAULT_CHECKER,
    ) -> None:
        """Stores the components that PipelineSpec has created by name.

        Args:
            model: Robot model.
            kinematics: Kinematics solvers of the groups.
            settings: Settings of the pipeline.
            planner: Planner.
            adapters: Request adapters, outermost first.
            name: Name of the pipeline (`pipeline_id`).
            new_checker: Factory of collision checkers.
        """
        self._model = kinematics.model
        self._kinematics = kinematics
        self._planner = planner
        self._adapters = tuple(adapters)
        self._new_checker = new_checker
        self.name = name
        self.settings = settings
        self.configurations = PlannerConfigurations(settings.planner_configs)

    @property
    def planner_ids(self) -> tuple[str, ...]:
        """Accepted values of planner_id; empty if the planner accepts any value."""
        return self._planner.planner_ids

    @property
    def description(self) -> str:
        """Description of the planner."""
        return self._planner.description or type(self._planner).__name__

    @property
    def auxiliary_constraints(self) -> tuple[str, ...]:
        """Names of path constraints that are planner inputs and do not constrain the motion."""
        return self._planner.auxiliary_constraints

    @property
    def has_own_process(self) -> bool:
        """Whether the planner runs in a process of its own; see `Planner`."""
        return self._planner.has_own_process

    def start(self) -> None:
        """Starts the planner's own process in advance; raises PlanningError if it does not start."""
        self._planner.start()

    def close(self) -> None:
        """Ends the planner's own process; may be called twice."""
        self._planner.close()

    def group_planners(self, group: str) -> tuple[str, ...]:
        """Returns the planner_configs of a group, without those whose planner does not exist."""
        names = [str(name) for name in self.settings.groups.get(group, {}).get("planner_configs") or ()]
        allowed = self.planner_ids
        return tuple(name for name in names if not allowed or self._configuration(name, group)[0] in allowed)

    def parameter_faults(self, name: str, group: str = "") -> list[str]:
        """Returns one message per invalid setting of a planner."""
        return self._planner.parameter_faults(*self._configuration(name, group))

    def plan(self, request: PlanningRequest, repeatable: bool = False) -> PlanningResult:
        """Returns a validated motion, never a partial result.

        Args:
            request: Planning request.
            repeatable: Whether iterations instead of time limit the searches. A search that reaches the time limit then
                counts as failed.

        Raises:
            PlanningError: Planning failed; gives error code and reason.
        """
        phases = PhaseTimes(time.process_time if repeatable else time.thread_time)
        try:
            return self._plan(request, repeatable, phases)
        except PlanningError as error:
            error.statistics = phases.statistics()
            code = self._planner.collision_code
            if error.code in COLLISION_ERROR_CODES and code is not None:
                raise PlanningError(code, error.reason, error.contacts, error.statistics) from error
            raise

    def _plan(self, request: PlanningRequest, repeatable: bool, phases: PhaseTimes) -> PlanningResult:
        """Repeats search and repair until a motion passes the final validation or time runs out."""
        start_s = time.monotonic()
        with phases.measure(SETUP):
            problem = self._problem(request, start_s, repeatable, phases)
            phases.watch(problem.checker)
        adapters, fault, steps = self._adapters_for(request), "", list(self._edge_steps())
        search = PathSearch(self._planner)
        while steps:
            problem = replace(problem, step=steps.pop(0), _goals=[])
            try:
                path = chain(adapters, search)(problem)
                fault, answer = self._validated_result(problem, path, start_s)
            except EdgeError as error:
                fault, search = error.reason, PathSearch(self._planner)  # the next search checks edges more finely
                if problem.interrupted():
                    break
            except PlanningError as error:
                raise _with_fault(error, fault) from error
            else:
                if answer is not None:
                    return answer
                if path.keep_shape or problem.cancelled() or time.monotonic() > problem.end_s:
                    break
                if self._planner.repairs_edges:  # repair again with a finer step
                    problem = replace(
                        problem, settings=replace(problem.settings, motion_step=problem.settings.motion_step / 4.0)
                    )
                else:
                    search = PathSearch(self._planner)
        raise _validation_error(problem, fault)

    def _adapters_for(self, request: PlanningRequest) -> tuple[RequestAdapter, ...]:
        """Returns the request adapters, with the Cartesian speed limit added if the request needs it."""
        if request.max_cartesian_speed == 0.0 or any(
            isinstance(item, LimitMaxCartesianLinkSpeed) for item in self._adapters
        ):
            return self._adapters
        return LimitMaxCartesianLinkSpeed(), *self._adapters

    def _edge_steps(self) -> tuple[float, ...]:
        """Returns the edge step of each search; an edge that cannot be repaired begins the next search."""
        finest = self.settings.finest_step
        return self.settings.search_step, 0.4 * self.settings.search_step, finest, finest

    def _validated_result(
        self, problem: PlanningProblem, path: PlannedPath, start_s: float
    ) -> tuple[str, PlanningResult | None]:
        if path.trajectory is None:
            raise PlanningError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"pipeline '{self.name}': the path was not timed; add "
                "default_planner_request_adapters/AddTimeOptimalParameterization to request_adapters",
            )
        fault = problem.solution_validator.fault(problem, path)
        if fault:
            return fault, None
        start = problem.start.copy()
        start[problem.group.indices] = path.vertices[0]
        return "", PlanningResult(
            trajectory=path.trajectory,
            start=start,
            goal=problem.motion.full_positions(path.vertices[-1]),
            path=path.vertices,
            planner_id=path.planner_id or problem.planner_id,
            planning_time_s=path.found_s - start_s,
            total_time_s=time.monotonic() - start_s,
            statistics=problem.phases.statistics(),
        )

    def checker(
        self, scene: PlanningScene, group: JointGroup, start: Array, check_interrupt: Callable[[], None] = lambda: None
    ) -> CollisionChecker:
        """Returns a collision checker for the motion; it tolerates shallow contacts of attached objects.

        Args:
            scene: Planning scene.
            group: Moving joints.
            start: Start positions of the whole robot [rad or m].
            check_interrupt: Function called regularly during the build; it raises an exception to stop the build.

        Raises:
            PlanningError: Bodies are in contact at the start, and no motion of the group can separate them.
        """
        checker = self._new_checker(scene, group.indices)
        checker.build(check_interrupt)
        fixed = checker.fixed_contacts(start)
        if fixed:
            raise PlanningError(
                ErrorCode.START_STATE_IN_COLLISION,
                f"start state: {describe_contacts(fixed)}; no joint of group '{group.name}' can resolve this "
                "collision; allow the collision or move one of the bodies",
                fixed,
            )
        if checker.is_free(start):
            return checker
        shallow = [
            item
            for item in checker.contacts(start, include_fixed=False)
            if {item.first.kind, item.second.kind} == {ATTACHED, WORLD}
            and item.depth <= self.settings.start_state_contact_tolerance
        ]
        return self._new_checker(scene, group.indices, shallow) if shallow else checker

    def _problem(
        self, request: PlanningRequest, start_s: float, repeatable: bool, phases: PhaseTimes
    ) -> PlanningProblem:
        """Returns the planning problem of a request; raises PlanningError for an invalid request."""
        if not request.allowed_time_s > 0.0:
            raise PlanningError(
                ErrorCode.TIMED_OUT, f"allowed_planning_time is {request.allowed_time_s} s; it must be above 0"
            )
        group = self._model.group(request.group)
        if not group.joints:
            raise PlanningError(ErrorCode.INVALID_GROUP_NAME, f"group '{group.name}' has no movable joint")
        planner_id, parameters, replaced = self._chosen_planner(request.planner_id, group.name)
        adapters = tuple(type(item).__name__ for item in self._adapters_for(request))
        phases.run = PlannerRun(
            self.name,
            planner_id,
            parameters,
            adapters,
            replaced=replaced,
            solver=self._solver(request),
            collision_checker=checker_name(self._new_checker),
        )
        start = np.array(request.scene.positions)
        if not np.isfinite(start).all():
            raise PlanningError(ErrorCode.INVALID_ROBOT_STATE, "start state: a joint position is not finite")
        velocity, acceleration = self._scaled_limits(request, group)
        seed = self.settings.seed if request.seed is None else request.seed
        checker = self.checker(request.scene, group, start, partial(_require_time, request, start_s))
        return PlanningProblem(
            request=request,
            model=request.scene.model,
            group=group,
            start=start,
            checker=checker,
            motion=MotionChecker(checker, group.indices, start),
            kinematics=self._kinematics,
            settings=self.settings,
            max_velocity=velocity,
            max_acceleration=acceleration,
            rng=np.random.default_rng(seed),
            start_time_s=start_s,
            deadline_s=start_s + request.allowed_time_s - self._reserved_s(request.allowed_time_s, planner_id),
            end_s=start_s + request.allowed_time_s,
            solution_validator=TrajectoryValidator(),
            planner_id=planner_id,
            planner_parameters=parameters,
            constraints=request.path_constraints,
            repeatable=repeatable,
            phases=phases,
        )

    def _solver(self, request: PlanningRequest) -> str:
        """Returns the inverse kinematics method of pose goals, empty if the request has none."""
        if not any(isinstance(goal, PoseGoal) for goal in request.goals):
            return ""
        try:
            return self._kinematics.solver(request.group).method
        except PlanningError:
            return ""  # pose goals are projected, because the group is not a chain

    def _reserved_s(self, allowed_time_s: float, planner_id: str) -> float:
        """Returns the time reserved for path repair, time parameterization and validation [s]."""
        improves = planner_id in self._planner.improving_ids
        return min(ANYTIME_RESERVED_S if improves else RESERVED_S, RESERVED_FRACTION * allowed_time_s)

    def _chosen_planner(self, requested_planner: str, group: str) -> tuple[str, dict[str, Any], str]:
        """Returns the planner name, its settings, and the requested name if the default planner replaces it."""
        default, allowed = self.settings.default_planner(group), self.planner_ids
        planner_id, parameters = self._configuration(without_group(requested_planner or default), group)
        replaced = ""
        if requested_planner and allowed and planner_id not in allowed and self._planner.replaces_bad_values:
            planner_id, parameters = self._configuration(without_group(default), group)
            replaced = requested_planner
            LOGGER.warning(
                "planner_id '%s': pipeline '%s' has no such planner; allowed: %s%s; group '%s' uses "
                "the default planner '%s'",
                requested_planner,
                self.name,
                ", ".join(allowed),
                nearest(planner_id, allowed),
                group,
                planner_id or allowed[0],
            )
        planner_id = planner_id or (allowed[0] if allowed else "")
        if allowed and planner_id not in allowed:
            raise PlanningError(
                ErrorCode.PLANNING_FAILED,
                f"planner_id '{requested_planner}': pipeline '{self.name}' has no planner '{planner_id}'; "
                f"allowed: {', '.join(allowed)}{nearest(planner_id, allowed)}",
            )
        return planner_id, parameters, replaced

    def _configuration(self, name: str, group: str) -> tuple[str, dict[str, Any]]:
        """Returns the planner name of a configuration, and its settings merged with the group's settings."""
        return resolve_configuration(self.configurations.get(name, group), self.settings.groups, name, group)

    def _scaled_limits(self, request: PlanningRequest, group: JointGroup) -> tuple[Array, Array]:
        factors = []
        for name, value, default in (
            ("max_velocity_scaling_factor", request.velocity_scaling, self.settings.default_velocity_scaling_factor),
            (
                "max_acceleration_scaling_factor",
                request.acceleration_scaling,
                self.settings.default_acceleration_scaling_factor,
            ),
        ):
            if np.isfinite(value) and not 0.0 <= value <= 1.0 and self._planner.replaces_bad_values:
                LOGGER.warning(
                    "%s is %g; it must be in (0, 1], or 0 for the default %g; 1 is used", name, value, default
                )
                value = 1.0
            if not np.isfinite(value) or value < 0.0 or value > 1.0:
                raise PlanningError(
                    ErrorCode.INVALID_MOTION_PLAN,
                    f"{name} is {value}; it must be in (0, 1], or 0 for the default {default}",
                )
            factors.append(value if value > 0.0 else default)
        return (
            self._model.max_velocity[group.indices] * factors[0],
            self._model.max_acceleration[group.indices] * factors[1],
        )


def _require_time(request: PlanningRequest, start_time_s: float) -> None:
    """Raises PlanningError if a request is cancelled or out of time before the search."""
    elapsed_s = time.monotonic() - start_time_s
    if request.cancelled():
        raise PlanningError(
            ErrorCode.PREEMPTED,
            f"planning was cancelled after {elapsed_s:.2f} s, during the build of the collision world",
        )
    if elapsed_s > request.allowed_time_s:
        raise PlanningError(
            ErrorCode.TIMED_OUT,
            f"the collision world of {len(request.scene.objects)} objects was "
            f"not built in {elapsed_s:.2f} s (allowed {request.allowed_time_s:.2f} s); allow more time, "
            "simplify meshes, or repeat the request, which continues the build",
        )


def _with_fault(error: PlanningError, fault: str) -> PlanningError:
    """Appends the fault of an earlier path of the same request to an error."""
    if not fault:
        return error
    return PlanningError(error.code, f"{error.reason}; a path was found before, but {fault}", error.contacts)


def _validation_error(problem: PlanningProblem, fault: str) -> PlanningError:
    """Returns the error of a request whose paths all failed the validation."""
    if problem.cancelled():
        return PlanningError(ErrorCode.PREEMPTED, f"planning was cancelled; a path was found, but {fault}")
    elapsed_s = time.monotonic() - problem.start_time_s
    if problem.interrupted():
        return PlanningError(
            ErrorCode.TIMED_OUT,
            f"a path was found, but {fault}; time ran out after "
            f"{elapsed_s:.2f} s (allowed {problem.request.allowed_time_s:.2f} s): allow more time",
        )
    return PlanningError(
        ErrorCode.INVALID_MOTION_PLAN,
        f"the motion found in {elapsed_s:.2f} s fails the final validation: "
        f"{fault}; move the goal or the start away from contact",
    )
