# SPDX-License-Identifier: BSD-3-Clause
"""Execution of pickup and place goals: plans each grasp or location and executes the first feasible candidate."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import genpy
import numpy as np
from moveit_msgs.msg import RobotTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.constraint_conversions import constraints_from_message
from modular_framework_planning.messages.conversions import state_message, trajectory_message
from modular_framework_planning.messages.manipulation_messages import Hand
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.motion_watch import WatchedMotion
from modular_framework_planning.move_group.planning_options import check_options, scene_change
from modular_framework_planning.pick_place.manipulation import Arm, Manoeuvre, ManoeuvrePlanner, Stage
from modular_framework_planning.planning_interface.planning_request import PlanningRequest
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, SceneChange
from modular_framework_planning.robot_model.end_effectors import choose_end_effector, hand_links
from modular_framework_planning.robot_model.robot_model import JointGroup
from modular_framework_planning.trajectory_processing.rest_to_rest import shortest_cubic_s

DEFAULT_PLANNING_TIME_S = 5.0
FINGER_SETTLE_S = 0.5
MAX_REASONS = 10


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Task:
    """The differences between pickup and place.

    Attributes:
        kind: Kind of result for the report, pickup or place.
        goal: Goal message.
        group: Name of the planning group; may be empty.
        end_effector: Name of the end effector; may be empty.
        check: Function that raises PlanningError for goals without a feasible candidate.
        candidates: Indices of the grasps or locations in the goal, best first.
        read: Function that returns the manoeuvre of a candidate.
        accept: Function that writes the chosen candidate to the result.
    """

    kind: str
    goal: Any
    group: str
    end_effector: str
    check: Callable[[PlanningScene], None]
    candidates: Sequence[int]
    read: Callable[[PlanningScene, int, Hand], Manoeuvre]
    accept: Callable[[int], None]


def best_first(qualities: Iterable[float]) -> list[int]:
    """Returns the indices of the qualities in descending order; equal qualities keep their order."""
    values = list(qualities)
    return sorted(range(len(values)), key=lambda index: -values[index])


@dataclass(slots=True)
class _Attempts:
    """Failed candidates with their errors."""

    failures: list[tuple[str, PlanningError]] = field(default_factory=list)

    def error(self) -> PlanningError:
        """Returns an error with all reasons and their common code, or PLANNING_FAILED if the codes differ."""
        codes = {error.code for _, error in self.failures}
        reported = [error.reason for _, error in self.failures[:MAX_REASONS]]
        omitted = len(self.failures) - len(reported)
        return PlanningError(
            codes.pop() if len(codes) == 1 else ErrorCode.PLANNING_FAILED,
            f"none of {len(self.failures)} candidates is feasible: "
            + " | ".join(reported)
            + (f" | and {omitted} more" if omitted else ""),
        )

    def entries(self) -> list[dict[str, Any]]:
        """Returns the failures as JSON for the report."""
        return [{"id": name, "error_code": int(error.code), "reason": error.reason} for name, error in self.failures]


class Manipulation:
    """Plans and executes one goal."""

    def __init__(
        self, context: MoveGroupContext, task: Task, cancelled: threading.Event, feedback: Callable[[str], None]
    ) -> None:
        """Stores the goal.

        Args:
            context: Shared parts of the node.
            task: Goal of pickup or place.
            cancelled: Event that is set when the client cancels the goal.
            feedback: Function that publishes the state of the goal.
        """
        self._context, self._task, self._cancelled, self._feedback = context, task, cancelled, feedback
        self._attempts = _Attempts()
        self._grasped = False

    def run(self, result: Any) -> str:
        """Fills the result and returns a text for the client; failures are returned as a code in the result."""
        task, options = self._task, self._task.goal.planning_options
        details: dict[str, Any] = {"group": task.group}
        try:
            check_options(options)
            attempts = self._context.settings.plan_execution.attempts(options)
            for attempt in range(attempts):
                try:
                    self._plan_and_execute(result)
                    break
                except PlanningError as error:
                    is_last = attempt + 1 == attempts or self._grasped or self._cancelled.wait(options.replan_delay)
                    if is_last or error.code != ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE:
                        raise
        except Exception as error:  # noqa: BLE001 - the client must get a code; the reporter logs the error
            result.error_code.val = self._context.reporter.failure(
                task.kind, error, **details, attempts=self._attempts.entries()
            )
            return str(error)
        result.error_code.val = ErrorCode.SUCCESS
        self._context.reporter.report(
            task.kind,
            ErrorCode.SUCCESS,
            "",
            **details,
            attempts=self._attempts.entries(),
            stages=list(result.trajectory_descriptions),
        )
        return "planned" if options.plan_only else "planned and executed"

    def _plan_and_execute(self, result: Any) -> None:
        options = self._task.goal.planning_options
        self._attempts.failures.clear()
        self._feedback("PLANNING")
        self._context.monitor.wait_for_state()
        change = scene_change(options, not options.plan_only)
        scene = change(self._context.monitor.snapshot())
        stages = self._plan(scene, result)
        result.trajectory_start = state_message(scene)
        result.trajectory_stages = [self._message(stage) for stage in stages]
        result.trajectory_descriptions = [stage.name for stage in stages]
        if options.plan_only:
            return
        self._feedback("MONITOR")
        for stage, message in zip(stages, result.trajectory_stages, strict=True):
            self._execute(stage, message, change)

    # ---------------------------------------------------------------- planning
    def _plan(self, scene: PlanningScene, result: Any) -> tuple[Stage, ...]:
        """Returns the stages of the first feasible candidate; raises PlanningError with the reasons of all failures."""
        task, start = self._task, time.monotonic()
        model = self._context.model
        group, effector = choose_end_effector(model, task.group, task.end_effector)
        fingers = frozenset(model.group(effector.group).joints)
        hand = Hand(
            effector.parent_link,
            hand_links(model, effector),
            fingers,
            {name: mimic for name, mimic in model.document.mimics.items() if mimic.leader in fingers},
        )
        task.check(scene)
        candidates = [(candidate, task.read(scene, candidate, hand)) for candidate in task.candidates]
        planner = self._planner(scene, group, hand)
        for attempted, (candidate, manoeuvre) in enumerate(candidates):
            if self._cancelled.is_set():
                raise PlanningError(ErrorCode.PREEMPTED, "cancelled while planning")
            try:
                stages = planner.plan(manoeuvre, planner.remaining_s / (len(candidates) - attempted))
            except PlanningError as error:
                if error.code == ErrorCode.PREEMPTED:
                    raise
                self._attempts.failures.append((manoeuvre.name, error))
                continue
            task.accept(candidate)
            result.planning_time = time.monotonic() - start
            return stages
        raise self._attempts.error()

    def _planner(self, scene: PlanningScene, group: JointGroup, hand: Hand) -> ManoeuvrePlanner:
        goal, model = self._task.goal, self._context.model
        allowed_s = goal.allowed_planning_time
        if not np.isfinite(allowed_s):
            raise PlanningError(
                ErrorCode.TIMED_OUT, f"allowed_planning_time is {allowed_s}; give a finite number of seconds"
            )
        settings = self._context.pipeline("").settings
        constraints = constraints_from_message(scene, goal.path_constraints, "path_constraints")
        arm = Arm(
            group,
            hand.link,
            self._context.kinematics.solver(group.name),
            model.max_velocity[group.indices] * settings.default_velocity_scaling_factor,
            model.max_acceleration[group.indices] * settings.default_acceleration_scaling_factor,
        )
        request = PlanningRequest(
            scene,
            group.name,
            (),
            planner_id=goal.planner_id,
            attempts=1,
            allowed_time_s=allowed_s if allowed_s > 0.0 else DEFAULT_PLANNING_TIME_S,
            cancelled=self._cancelled.is_set,
            path_constraints=None if constraints.is_empty else constraints,
        )
        return ManoeuvrePlanner(
            arm,
            self._context.plan,
            request,
            contact_tolerance_m=settings.start_state_contact_tolerance,
            settings=self._context.settings.pick_place,
            new_checker=self._context.new_checker,
        )

    # ---------------------------------------------------------------- execution
    def _message(self, stage: Stage) -> RobotTrajectory:
        model = self._context.model
        if stage.motion is not None:
            return trajectory_message(stage.motion, model)
        message = RobotTrajectory()
        motion = message.joint_trajectory
        motion.header.frame_id, motion.joint_names = model.planning_frame, list(stage.fingers)
        if stage.fingers:
            motion.points = self._finger_points(stage.fingers, stage.scene.positions)
        return message

    def _finger_points(self, fingers: Mapping[str, float], positions: Any) -> list[JointTrajectoryPoint]:
        """Returns a motion of the fingers from rest to rest, which controllers interpolate by a cubic polynomial.

        Args:
            fingers: Final positions by joint name [rad or m].
            positions: Positions of all joints at the start, in the model's order [rad or m].
        """
        model = self._context.model
        indices = [model.index[name] for name in fingers]
        start, end = positions[indices], np.array(list(fingers.values()))
        shortest_s = shortest_cubic_s(np.abs(end - start), model.max_velocity[indices], model.max_acceleration[indices])
        return [
            JointTrajectoryPoint(
                positions=row.tolist(),
                velocities=[0.0] * len(indices),
                time_from_start=genpy.Duration.from_sec(time_s),
            )
            for time_s, row in ((0.0, start), (shortest_s + FINGER_SETTLE_S, end))
        ]

    def _execute(self, stage: Stage, message: RobotTrajectory, change: SceneChange) -> None:
        """Executes a stage and applies its effect to the monitored scene; raises PlanningError naming the stage."""
        try:
            if stage.motion is not None:
                WatchedMotion(self._context, message, stage.scene, lambda scene: stage.change(change(scene))).execute(
                    self._cancelled
                )
            elif stage.fingers:
                # a held object stops the fingers early
                message.joint_trajectory.points = self._finger_points(stage.fingers, self._context.monitor.positions())
                self._context.execution.execute(message, self._cancelled)
            if stage.effect is not None:
                self._context.monitor.apply(stage.effect)
                self._grasped = True
        except PlanningError as error:
            raise PlanningError(error.code, f"executing '{stage.name}': {error.reason}") from error
