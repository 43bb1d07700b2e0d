# SPDX-License-Identifier: BSD-3-Clause
"""One planning pipeline: a planner, the request adapters around it, and the check every motion has to pass."""

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
from modular_framework_planning.planning_interface.collision_detectors import DEFAULT_CHECKER
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.path_repair import EdgeError
from modular_framework_planning.planning_interface.phase_times import SETUP, PhaseTimes
from modular_framework_planning.planning_interface.planner_configurations import (
    PlannerConfigurations,
    planner_kind,
    without_group,
)
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, Planner, PlanningProblem
from modular_framework_planning.planning_interface.planning_request import (
    PipelineSettings,
    PlanningAnswer,
    PlanningRequest,
    PoseGoal,
)
from modular_framework_planning.planning_pipeline.adapters.limit_max_cartesian_link_speed import (
    LimitMaxCartesianLinkSpeed,
)
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter, chain
from modular_framework_planning.planning_pipeline.path_search import PathSearch
from modular_framework_planning.planning_pipeline.trajectory_validator import TrajectoryValidator
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel

RESERVED_S, RESERVED_SHARE = 0.25, 0.2  # of the allowed time, for what follows the search
RESERVED_AFTER_IMPROVING_S = 1.0  # where the planner always uses all of its time, so that nothing else is left
COLLISIONS = (ErrorCode.START_STATE_IN_COLLISION, ErrorCode.GOAL_IN_COLLISION)
LOGGER = logging.getLogger("rosout.planning_pipeline")


class PlanningPipeline:
    """Plans for one robot; threads may share it, each plan has its own collision world."""

    def __init__(
        self,
        model: RobotModel,
        kinematics: KinematicsPool,
        settings: PipelineSettings,
        planner: Planner,
        adapters: Sequence[RequestAdapter] = (),
        name: str = "ompl",
        new_checker: CollisionCheckerFactory = DEFAULT_CHECKER,
    ) -> None:
        """Stores the parts; PipelineSpec builds them from their names.

        Args:
            model: the robot.
            kinematics: inverse kinematics of its groups.
            settings: the pipeline's parameters.
            planner: finds the path.
            adapters: outermost first.
            name: what `pipeline_id` calls it.
            new_checker: makes the collision checkers.
        """
        self._model = model
        self._kinematics = kinematics
        self._planner = planner
        self._adapters = tuple(adapters)
        self._new_checker = new_checker
        self.name = name
        self.settings = settings
        self.configurations = PlannerConfigurations(settings.planner_configs)

    @property
    def planner_ids(self) -> tuple[str, ...]:
        """Values of planner_id that the planner accepts; empty if it accepts any."""
        return tuple(getattr(self._planner, "planner_ids", ()))

    @property
    def description(self) -> str:
        """The planner's own description."""
        return str(getattr(self._planner, "description", type(self._planner).__name__))

    @property
    def _replaces_bad_values(self) -> bool:
        """Whether an unknown planner_id and scaling out of range are replaced by defaults, with a warning."""
        return bool(getattr(self._planner, "replaces_bad_values", True))

    @property
    def auxiliary_constraints(self) -> tuple[str, ...]:
        """Names of path constraints that are input of the planner and need not be kept."""
        return tuple(getattr(self._planner, "auxiliary_constraints", ()))

    def group_planners(self, group: str) -> tuple[str, ...]:
        """Returns the names in a group's planner_configs whose planner there is."""
        names = [str(name) for name in self.settings.groups.get(group, {}).get("planner_configs") or ()]
        known = self.planner_ids
        return tuple(name for name in names if not known or self._kind(name, group)[0] in known)

    def parameter_faults(self, name: str, group: str = "") -> list[str]:
        """Returns what is wrong with the settings of a planner, one sentence each; nothing without a check."""
        kind, parameters = self._kind(name, group)
        check = getattr(self._planner, "parameter_faults", None)
        return list(check(kind, parameters)) if check else []

    def plan(self, request: PlanningRequest, repeatable: bool = False) -> PlanningAnswer:
        """Plans a motion.

        Args:
            request: what to plan.
            repeatable: bound searches by iterations; the clock only ends them with a failure.

        Raises:
            PlanningError: with the code and the reason; a partial result is never returned.
        """
        phases = PhaseTimes(time.process_time if repeatable else time.thread_time)
        try:
            return self._plan(request, repeatable, phases)
        except PlanningError as error:
            error.statistics = phases.statistics()
            code = getattr(self._planner, "collision_code", error.code)
            if error.code in COLLISIONS and code != error.code:
                raise PlanningError(code, error.reason, error.contacts, error.statistics) from error
            raise

    def _plan(self, request: PlanningRequest, repeatable: bool, phases: PhaseTimes) -> PlanningAnswer:
        """Searches, and repairs what the check of the motion finds, until the motion passes or the time is over."""
        begun = time.monotonic()
        with phases.measured(SETUP):
            problem = self._problem(request, begun, repeatable, phases)
            phases.watch(problem.checker)
        adapters, fault, steps = self._adapters_for(request), "", list(self._steps())
        search = PathSearch(self._planner)
        while steps:
            problem = replace(problem, step=steps.pop(0), _goals=[])
            try:
                path = chain(adapters, search)(problem)
                fault, answer = self._checked(problem, path, begun)
            except EdgeError as error:
                fault, search = error.reason, PathSearch(self._planner)  # the next one checks edges more finely
                if problem.interrupted():
                    break
            except PlanningError as error:
                raise _with_fault(error, fault) from error
            else:
                if answer is not None:
                    return answer
                if path.keep_shape or problem.cancelled() or time.monotonic() > problem.end_s:
                    break
                if search.repairs:  # what the check saw between two samples of the repair, with finer ones
                    problem = replace(
                        problem, settings=replace(problem.settings, motion_step=problem.settings.motion_step / 4.0)
                    )
                else:
                    search = PathSearch(self._planner)
        raise _failed(problem, fault)

    def _adapters_for(self, request: PlanningRequest) -> tuple[RequestAdapter, ...]:
        """Returns the adapters; a speed limit that is asked for is kept even where no parameter names its adapter."""
        if request.max_cartesian_speed == 0.0 or any(
            isinstance(item, LimitMaxCartesianLinkSpeed) for item in self._adapters
        ):
            return self._adapters
        return LimitMaxCartesianLinkSpeed(), *self._adapters

    def _steps(self) -> tuple[float, ...]:
        """Edge steps of the search: the next one counts where an edge of a path could not be repaired."""
        finest = self.settings.finest_step
        return self.settings.search_step, 0.4 * self.settings.search_step, finest, finest

    def _checked(self, problem: PlanningProblem, path: PlannedPath, begun: float) -> tuple[str, PlanningAnswer | None]:
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
        return "", PlanningAnswer(
            path.trajectory,
            start,
            problem.motion.full_positions(path.vertices[-1]),
            path.vertices,
            path.planner_id or problem.planner_id,
            path.found_s - begun,
            time.monotonic() - begun,
            problem.phases.statistics(),
        )

    def checker(
        self, scene: PlanningScene, group: JointGroup, start: Array, check_interrupt: Callable[[], None] = lambda: None
    ) -> CollisionChecker:
        """Returns the collision world of a motion, with shallow contacts of held bodies tolerated.

        Args:
            scene: the world.
            group: the joints that will move.
            start: positions of the whole robot the motion begins at.
            check_interrupt: called now and then while the world is built; raises an exception to stop that.

        Raises:
            PlanningError: bodies touch that the group cannot separate.
        """
        checker = self._new_checker(scene, group.indices)
        checker.build(check_interrupt)
        fixed = checker.fixed_contacts(start)
        if fixed:
            raise PlanningError(
                ErrorCode.START_STATE_IN_COLLISION,
                f"start state: {describe_contacts(fixed)}; no "
                f"joint of group '{group.name}' can change that; allow the pair or move it",
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

    def _problem(self, request: PlanningRequest, begun: float, repeatable: bool, phases: PhaseTimes) -> PlanningProblem:
        """Reads the request; everything that can be refused without planning is refused here."""
        if not request.allowed_time_s > 0.0:
            raise PlanningError(
                ErrorCode.TIMED_OUT, f"allowed_planning_time is {request.allowed_time_s} s; it must be above 0"
            )
        group = self._model.group(request.group)
        if not group.joints:
            raise PlanningError(ErrorCode.INVALID_GROUP_NAME, f"group '{group.name}' has no joint that can be moved")
        planner_id, parameters, replaced = self._chosen_planner(request.planner_id, group.name)
        adapters = tuple(type(item).__name__ for item in self._adapters_for(request))
        phases.run = PlannerRun(
            self.name, planner_id, parameters, adapters, replaced=replaced, solver=self._solver(request)
        )
        start = np.array(request.scene.positions)
        if not np.isfinite(start).all():
            raise PlanningError(ErrorCode.INVALID_ROBOT_STATE, "start state: a joint position is not finite")
        velocity, acceleration = self._scaled_limits(request, group)
        seed = self.settings.seed if request.seed is None else request.seed
        checker = self.checker(request.scene, group, start, partial(_require_time, request, begun))
        return PlanningProblem(
            request,
            request.scene.model,
            group,
            start,
            checker,
            MotionChecker(checker, group.indices, start, self.settings.finest_step),
            self._kinematics,
            self.settings,
            velocity,
            acceleration,
            np.random.default_rng(seed),
            begun,
            begun + request.allowed_time_s - self._reserved(request.allowed_time_s, planner_id),
            begun + request.allowed_time_s,
            TrajectoryValidator(),
            planner_id,
            parameters,
            request.path_constraints,
            repeatable=repeatable,
            phases=phases,
        )

    def _solver(self, request: PlanningRequest) -> str:
        """Returns the method of the inverse kinematics of pose goals; "" without one."""
        if not any(isinstance(goal, PoseGoal) for goal in request.goals):
            return ""
        try:
            return self._kinematics.solver(request.group).method
        except PlanningError:
            return ""  # not a chain: pose goals are projected

    def _reserved(self, allowed_time_s: float, planner_id: str) -> float:
        """Returns how much of the allowed time is kept for repairing, timing and checking the path found [s]."""
        improves = planner_id in getattr(self._planner, "improving_ids", ())
        return min(RESERVED_AFTER_IMPROVING_S if improves else RESERVED_S, RESERVED_SHARE * allowed_time_s)

    def _chosen_planner(self, asked: str, group: str) -> tuple[str, dict[str, Any], str]:
        """Returns the planner's name and settings, and the name it replaces; raises PlanningError with known names."""
        default, known = self.settings.default_planner(group), self.planner_ids
        kind, parameters = self._kind(without_group(asked or default), group)
        replaced = ""
        if asked and known and kind not in known and self._replaces_bad_values:
            kind, parameters = self._kind(without_group(default), group)
            replaced = asked
            LOGGER.warning(
                "planner_id '%s': pipeline '%s' has no such planner, available: %s; group '%s' is planned "
                "for by the default planner '%s'",
                asked,
                self.name,
                ", ".join(known),
                group,
                kind or known[0],
            )
        kind = kind or (known[0] if known else "")
        if known and kind not in known:
            raise PlanningError(
                ErrorCode.PLANNING_FAILED,
                f"planner_id '{asked}': pipeline '{self.name}' has no planner '{kind}'; available: {', '.join(known)}",
            )
        return kind, parameters, replaced

    def _kind(self, name: str, group: str) -> tuple[str, dict[str, Any]]:
        """Returns the planner of a configuration's name, and its settings with those of the group."""
        return planner_kind(self.configurations.get(name, group), self.settings.groups, name, group)

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
            if np.isfinite(value) and not 0.0 <= value <= 1.0 and self._replaces_bad_values:
                LOGGER.warning(
                    "%s is %g; allowed is 0 < factor <= 1, or 0 for the default %g; 1 is used", name, value, default
                )
                value = 1.0
            if not np.isfinite(value) or value < 0.0 or value > 1.0:
                raise PlanningError(
                    ErrorCode.INVALID_MOTION_PLAN,
                    f"{name} is {value}; allowed is 0 < factor <= 1, or 0 for the default {default}",
                )
            factors.append(value if value > 0.0 else default)
        return (
            self._model.max_velocity[group.indices] * factors[0],
            self._model.max_acceleration[group.indices] * factors[1],
        )


def _require_time(request: PlanningRequest, begun_s: float) -> None:
    """Raises PlanningError when a request is over before its search began."""
    spent = time.monotonic() - begun_s
    if request.cancelled():
        raise PlanningError(
            ErrorCode.PREEMPTED, f"planning was cancelled after {spent:.2f} s, while the collision world was built"
        )
    if spent > request.allowed_time_s:
        raise PlanningError(
            ErrorCode.TIMED_OUT,
            f"the collision world of {len(request.scene.objects)} objects was "
            f"not built in {spent:.2f} s (allowed {request.allowed_time_s:.2f} s); allow more time, "
            "simplify meshes, or ask again: what was built is kept",
        )


def _with_fault(error: PlanningError, fault: str) -> PlanningError:
    """Adds the fault of an earlier path of the same request."""
    if not fault:
        return error
    return PlanningError(error.code, f"{error.reason}; a path was found before, but {fault}", error.contacts)


def _failed(problem: PlanningProblem, fault: str) -> PlanningError:
    """Describes why no motion is returned although paths were found."""
    if problem.cancelled():
        return PlanningError(ErrorCode.PREEMPTED, f"planning was cancelled; a path was found, but {fault}")
    spent = time.monotonic() - problem.begun_s
    if problem.interrupted():
        return PlanningError(
            ErrorCode.TIMED_OUT,
            f"a path was found, but {fault}; time ran out after "
            f"{spent:.2f} s (allowed {problem.request.allowed_time_s:.2f} s): allow more time",
        )
    return PlanningError(
        ErrorCode.INVALID_MOTION_PLAN,
        f"the motion found in {spent:.2f} s fails the last check: "
        f"{fault}; move the goal or the start away from contact",
    )
