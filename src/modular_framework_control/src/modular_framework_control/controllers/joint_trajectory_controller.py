# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory controller with the parameters of ros_controllers' joint_trajectory_controller.

Goals, commands and cancellations from any thread go through a mailbox. `update` processes the mailbox and makes all
time-dependent decisions. A trajectory has its own clock, which slows down and stops with the robot.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.hardware_interface.handles import measurement_fault
from modular_framework_control.hardware_interface.interfaces import HardwareInterface, PositionJointInterface
from modular_framework_control.hardware_interface.joint_limits import limits_of
from modular_framework_control.hardware_interface.robot_hw import speed_scaling_handles
from modular_framework_control.realtime.goal_handle import GoalStatus
from modular_framework_control.realtime.mailbox import Mailbox
from modular_framework_control.realtime.schedule import Schedule
from modular_framework_control.trajectory.goal_validation import GoalRules, ValidatedGoal, validate_goal
from modular_framework_control.trajectory.joint_trajectory import (
    MIN_SEGMENT_S,
    POSITION,
    VELOCITY,
    Array,
    Track,
    splice,
)
from modular_framework_control.trajectory.motion_limits import MotionLimits, first_segment_violations
from modular_framework_control.trajectory.point_checks import drop_surplus_values
from modular_framework_control.trajectory.stop_motion import StopMotion
from modular_framework_control.trajectory.tolerances import foreign_tolerances, read_tolerances, violations
from modular_framework_control.trajectory.trajectory_clock import TrajectoryClock
from modular_framework_control.trajectory.trajectory_goal import (
    GoalRejectedError,
    TrajectoryErrorCode,
    TrajectoryGoal,
    TrajectoryGoalHandle,
    TrajectorySnapshot,
)
from modular_framework_control.trajectory.trajectory_plan import TrajectoryPlan
from modular_framework_ros.node_handle import NodeHandle, read_bool, read_names, read_number

LOGGER = logging.getLogger("rosout.joint_trajectory_controller")
AT_REST = 0.01
"""Speed below which a joint needs no braking when the controller starts [rad/s or m/s]."""


class JointTrajectoryController(Controller):
    """position_controllers/JointTrajectoryController.

    Parameters, below the controller's name: `joints`; `constraints/{goal_time [s] 0.0, stopped_velocity_tolerance
    [rad/s] 0.01, <joint>/{trajectory, goal} [rad] 0 = not checked}`; `stop_trajectory_duration` [s] 0.0;
    `state_publish_rate` [1/s] 50; `action_monitor_rate` [1/s] 20; `allow_partial_joints_goal` false.

    A goal beyond the known limits of its joints is refused. A cancellation, an abort or an empty trajectory stops the
    motion from the measured positions, within the limits. With `stop_trajectory_duration` 0, each joint brakes at its
    maximum deceleration, or is held at once if that is unknown.

    During a hardware fault, the joints are held at their measured positions, and goals are refused with the fault's
    reason. If a measured position is not a number, the goal is aborted, the joints stop, and goals are refused until
    all positions are valid.

    Attributes:
        joint_names: Joints, in the order of all arrays.
        on_state: Function called in the control loop at `state_publish_rate` with a snapshot; must not block.
        on_feedback: Function called in the control loop at `action_monitor_rate` with active goal handle and snapshot.
    """

    interface_class: ClassVar[type[HardwareInterface[Any]]] = PositionJointInterface

    def __init__(self) -> None:
        self.joint_names: list[str] = []
        self.on_state: Callable[[TrajectorySnapshot], None] | None = None
        self.on_feedback: Callable[[TrajectoryGoalHandle, TrajectorySnapshot], None] | None = None
        self._handles: list[Any] = []
        self._mailbox: Mailbox[ValidatedGoal | TrajectoryGoalHandle] = Mailbox()
        self._running = False
        self._active: ValidatedGoal | None = None
        self._fault = ""
        self._unmeasured = ""

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        self._namespace = controller_nh.namespace
        self.joint_names = read_names(controller_nh, "joints")
        self._handles = [hw.get_handle(name) for name in self.joint_names]
        joint_limits = limits_of(self._handles, root_nh)
        self._limits = MotionLimits.of(joint_limits)
        self._rules = GoalRules(
            tuple(self.joint_names),
            read_tolerances(controller_nh, self.joint_names),
            self._limits,
            read_bool(controller_nh, "allow_partial_joints_goal", False),
        )
        self._stop_motion = StopMotion(read_number(controller_nh, "stop_trajectory_duration", 0.0), self._limits)
        self._state_schedule = Schedule(read_number(controller_nh, "state_publish_rate", 50.0))
        self._feedback_schedule = Schedule(read_number(controller_nh, "action_monitor_rate", 20.0))
        self._continuous = np.array([limits.continuous for limits in joint_limits])
        self._any_continuous = bool(self._continuous.any())
        self._clock = TrajectoryClock(speed_scaling_handles(self.robot_hw, self.joint_names))
        self._plan = TrajectoryPlan(len(self.joint_names))
        self._actual = np.zeros((2, len(self.joint_names)))
        return True

    # ---- any thread ----

    @property
    def moving(self) -> bool:
        """Whether the controller follows a goal, a command or a stop ramp."""
        return self._active is not None or (self._running and self._clock.now_s < self._plan.end_s)

    def submit(self, goal: TrajectoryGoal, goal_handle: TrajectoryGoalHandle | None = None) -> None:
        """Hands a goal (with a goal handle) or a command (without goal handle) to the control loop.

        Raises:
            GoalRejectedError: The goal is malformed or the controller is stopped; the goal handle is unchanged. If the
                controller is stopped during the call, the goal handle ends as rejected.
        """
        if not self._running:
            raise GoalRejectedError(TrajectoryErrorCode.INVALID_GOAL, "the controller is not running; start it first")
        trajectory, surplus_warning = goal.trajectory, ""
        if self._rules.allow_partial:
            trajectory, surplus_warning = drop_surplus_values(trajectory)
        for warning in (
            foreign_tolerances(self.joint_names, goal.path_tolerance, goal.goal_tolerance),
            surplus_warning,
        ):
            if warning:
                LOGGER.warning("%s: %s", self._namespace, warning)
        measured = np.array([handle.position for handle in self._handles])
        self._mailbox.put(validate_goal(replace(goal, trajectory=trajectory), goal_handle, self._rules, measured))
        if not self._running:
            self._reject_pending("the controller was stopped")

    def cancel(self, goal_handle: TrajectoryGoalHandle) -> None:
        """Requests that the control loop cancels the goal of `goal_handle`."""
        self._mailbox.put(goal_handle)

    def desired_at(self, time_s: float) -> Array:
        """Returns the desired position, velocity and acceleration at `time_s`, shape (3, joints).

        The result assumes that the robot keeps its current speed scaling.

        Raises:
            ControllerError: The controller is stopped, or the motion at this time is no longer stored.
        """
        if not self._running:
            raise ControllerError("the controller is not running and has no desired state; start it first")
        trajectory_s, stored_from_s = self._clock.expected_time_at(time_s), self._plan.stored_from_s
        if stored_from_s is not None and trajectory_s < stored_from_s - MIN_SEGMENT_S:
            raise ControllerError(
                f"got {time_s:.9g} s, which is before the start of the current motion, by "
                f"{stored_from_s - trajectory_s:.6g} s of its trajectory; give a later time"
            )
        return self._clock.scale_state(self._plan.sample(trajectory_s))

    # ---- control loop ----

    def starting(self, time_s: float) -> None:
        self._reject_pending("the goal was sent while the controller was stopping")
        self._active, self._fault = None, ""
        self._clock.start(time_s)
        self._state_schedule.start(time_s)
        self._feedback_schedule.start(time_s)
        self._read_actual()
        self._unmeasured = measurement_fault(self._handles)
        if self._unmeasured:
            raise ControllerError(self._unmeasured)
        self._plan.hold(self._actual[POSITION], time_s)
        self._hold_joints()
        if np.abs(self._actual[VELOCITY]).max(initial=0.0) > AT_REST:
            self._stop()
        self._running = True

    def stopping(self, time_s: float) -> None:
        del time_s
        self._end_goals(GoalStatus.CANCELED, "the controller was stopped")

    def interrupted(self, time_s: float, reason: str) -> None:
        del time_s
        self._end_goals(GoalStatus.CANCELED, reason)

    def failed(self, time_s: float, reason: str) -> None:
        del time_s
        self._end_goals(GoalStatus.ABORTED, f"the controller failed: {reason}")

    def on_hardware_fault(self, time_s: float, reason: str) -> None:
        self._fault = f"hardware fault: {reason}"
        self._finish(GoalStatus.ABORTED, TrajectoryErrorCode.INVALID_GOAL, self._fault)

    def on_hardware_recovered(self, time_s: float) -> None:
        self._fault = ""
        self._clock.advance(time_s)
        self._read_actual()
        self._hold_joints()

    def _end_goals(self, status: GoalStatus, text: str) -> None:
        self._running = False
        self._finish(status, TrajectoryErrorCode.INVALID_GOAL, text)
        self._reject_pending(text)
        self._read_actual()
        if self._plan.stored_from_s is not None:
            self._command_rest()

    def _reject_pending(self, text: str) -> None:
        for goal in self._mailbox.drain():
            if isinstance(goal, ValidatedGoal) and goal.goal_handle is not None:
                goal.goal_handle.finish(GoalStatus.REJECTED, TrajectoryErrorCode.INVALID_GOAL, text)

    def update(self, time_s: float, period_s: float) -> None:
        self._clock.advance(time_s)
        self._read_actual()
        self._watch_positions()
        self._mailbox.process(self._process)
        if self._fault:
            self._hold_joints()
        self._plan.forget_before(self._clock.now_s)
        desired, error = self._desired_and_error()
        if self._active is not None and self._check(self._active, self._clock.now_s, error):
            self._stop()
            desired, error = self._desired_and_error()
        if not self._fault:
            self._command(desired, error, period_s)
        self._report(time_s, desired, error)

    def _watch_positions(self) -> None:
        """Stops the motion when a measured position becomes invalid, and again when all positions are valid."""
        missing = "" if np.isfinite(self._actual[POSITION]).all() else measurement_fault(self._handles)
        if bool(missing) != bool(self._unmeasured):
            self._unmeasured = missing
            self._finish(GoalStatus.ABORTED, TrajectoryErrorCode.INVALID_GOAL, missing)
            self._stop()

    def _desired_and_error(self) -> tuple[Array, Array]:
        """Returns the desired position, velocity and acceleration, and the position and velocity errors."""
        desired = self._clock.scale_state(self._plan.sample(self._clock.now_s))
        error = desired[:2] - self._actual
        if self._any_continuous:
            unwrapped = error[POSITION, self._continuous]
            error[POSITION, self._continuous] = unwrapped - 2.0 * math.pi * np.round(unwrapped / (2.0 * math.pi))
        return desired, error

    def _desired_and_measured(self) -> tuple[Array, Array]:
        """Returns the desired state, and the measured positions and velocities.

        Measured positions of continuous joints are shifted to within pi of the desired positions. Measured values that
        are not numbers are replaced by desired values.
        """
        desired, error = self._desired_and_error()
        actual = desired[:2] - error
        return desired, np.where(np.isfinite(actual), actual, desired[:2])

    def _command(self, desired: Array, error: Array, period_s: float) -> None:
        """Commands the joints.

        Args:
            desired: Desired positions, velocities and accelerations, shape (3, joints).
            error: Position and velocity errors, shape (2, joints).
            period_s: Time since the last call.
        """
        del error, period_s
        for handle, position in zip(self._handles, desired[POSITION].tolist(), strict=True):
            handle.command = position

    def _command_rest(self) -> None:
        """Commands the joints to hold their measured positions, also while the controller is stopped."""
        _, actual = self._desired_and_measured()
        for handle, position in zip(self._handles, actual[POSITION].tolist(), strict=True):
            handle.hold(position)

    def _read_actual(self) -> None:
        states = [handle.state for handle in self._handles]
        self._actual[0] = [state.position for state in states]
        self._actual[1] = [state.velocity for state in states]

    def _hold_joints(self) -> None:
        _, actual = self._desired_and_measured()
        self._plan.hold(actual[POSITION], self._clock.now_s)
        self._command_rest()

    def _process(self, goal: ValidatedGoal | TrajectoryGoalHandle) -> None:
        if isinstance(goal, ValidatedGoal):
            refusal = self._fault or self._unmeasured or self._accept(goal)
            if refusal:
                self._refuse(goal, refusal)
        elif self._active is not None and self._active.goal_handle is goal:
            self._finish(GoalStatus.CANCELED, TrajectoryErrorCode.INVALID_GOAL, "canceled on request")
            self._stop()

    def _accept(self, goal: ValidatedGoal) -> str:
        """Replaces the active goal, and from the goal's start on the current motion; returns a refusal or ""."""
        if goal.spline is None:
            self._replace_active(goal)
            self._stop()
            return ""
        now_s = self._clock.now_s
        origin_s = self._clock.time_at(goal.stamp_s) if goal.stamp_s != 0.0 else now_s
        end_s = origin_s + float(goal.spline.times_s[-1])
        if end_s <= now_s + MIN_SEGMENT_S:
            return (
                f"all {len(goal.spline.times_s)} points lie in the past: the last point was due "
                f"{now_s - end_s:.6g} s before the goal was accepted; give a later header stamp or time_from_start"
            )
        splice_s = max(now_s, origin_s)
        if end_s <= splice_s + MIN_SEGMENT_S:
            splice_s = now_s
        joints = list(goal.joints)
        track = splice(
            goal.spline,
            joints,
            origin_s=origin_s,
            splice_s=splice_s,
            state=self._plan.sample(splice_s)[:, joints],
            continuous=self._continuous[joints].tolist(),
        )
        refusal = self._beyond_limits(goal, track, splice_s - origin_s)
        if refusal:
            return refusal
        self._warn_of_late_points(goal, splice_s - origin_s)
        self._replace_active(goal)
        self._plan.follow([track], splice_s)
        return ""

    def _beyond_limits(self, goal: ValidatedGoal, track: Track, late_s: float) -> str:
        """Returns a description of limit violations of a goal joined to the current motion, or ""."""
        if goal.spline is None or goal.violations is None:
            return ""
        first = int(np.searchsorted(goal.spline.times_s, late_s, side="right"))
        joints = list(goal.joints)
        return goal.violations.text(first, first + 1) or first_segment_violations(
            track,
            [self.joint_names[joint] for joint in joints],
            self._limits.of_joints(joints),
            self._actual[POSITION, joints],
            first,
        )

    def _warn_of_late_points(self, goal: ValidatedGoal, late_s: float) -> None:
        times_s = goal.spline.times_s if goal.spline is not None else np.zeros(0)
        late = int(np.searchsorted(times_s, late_s, side="right"))
        if late > 1 or (late == 1 and late_s > 0.0):
            LOGGER.warning(
                "%s: the first %d of %d points are in the past and left out; the next point is due in %.3f s",
                self._namespace,
                late,
                len(times_s),
                times_s[late] - late_s,
            )

    def _refuse(self, goal: ValidatedGoal, reason: str) -> None:
        if goal.goal_handle is None:
            LOGGER.warning("%s/command ignored: %s", self._namespace, reason)
        else:
            goal.goal_handle.finish(GoalStatus.REJECTED, TrajectoryErrorCode.INVALID_GOAL, reason)

    def _replace_active(self, goal: ValidatedGoal) -> None:
        self._finish(GoalStatus.CANCELED, TrajectoryErrorCode.INVALID_GOAL, "preempted by a new goal")
        if goal.goal_handle is not None:
            self._active = goal
            goal.goal_handle.activate()

    def _stop(self) -> None:
        """Stops the motion, starting at the measured positions."""
        desired, actual = self._desired_and_measured()
        now_s = self._clock.now_s
        tracks = self._stop_motion.tracks(desired, actual, now_s, self._clock.rate)
        self._plan.follow(tracks, now_s)
        for joint in (joint for track in tracks if track.end_s <= now_s for joint in track.joints):
            self._handles[joint].held = True

    def _check(self, goal: ValidatedGoal, now_s: float, error: Array) -> bool:
        """Ends a goal that is reached or violates its tolerances; returns whether the motion must stop."""
        if any(handle.state.stale for handle in self._handles):
            return False
        tolerances, late_s = goal.tolerances, now_s - self._plan.end_s
        if late_s < 0.0:
            outside = violations(error, tolerances.path, self.joint_names) if tolerances.checks_path else ""
            if outside:
                self._finish(
                    GoalStatus.ABORTED,
                    TrajectoryErrorCode.PATH_TOLERANCE_VIOLATED,
                    f"path tolerance violated: {outside}{self._possible_cause()}",
                )
            return bool(outside)
        outside = violations(error, tolerances.goal, self.joint_names)
        if not outside:
            self._finish(GoalStatus.SUCCEEDED, TrajectoryErrorCode.SUCCESSFUL, "goal reached")
        elif late_s >= tolerances.goal_time_s:
            self._finish(
                GoalStatus.ABORTED,
                TrajectoryErrorCode.GOAL_TOLERANCE_VIOLATED,
                f"goal tolerance violated {late_s:.6g} s after the end of the trajectory (goal_time "
                f"{tolerances.goal_time_s:.6g} s): {outside}{self._possible_cause()}",
            )
            return True
        return False

    def _possible_cause(self) -> str:
        warning = self.robot_hw.warning()
        return f"; {warning}" if warning else ""

    def _finish(self, status: GoalStatus, code: TrajectoryErrorCode, text: str) -> None:
        goal, self._active = self._active, None
        if goal is not None and goal.goal_handle is not None:
            goal.goal_handle.finish(status, code, text)

    def _report(self, time_s: float, desired: Array, error: Array) -> None:
        goal_handle = self._active.goal_handle if self._active is not None else None
        on_state = self.on_state if self._state_schedule.take_if_due(time_s) else None
        on_feedback = (
            self.on_feedback if goal_handle is not None and self._feedback_schedule.take_if_due(time_s) else None
        )
        if on_state is None and on_feedback is None:
            return
        elapsed_s = self._plan.elapsed_s(self._clock.now_s)
        snapshot = TrajectorySnapshot(time_s, desired, self._actual.copy(), error, elapsed_s)
        if on_state is not None:
            on_state(snapshot)
        if on_feedback is not None and goal_handle is not None:
            on_feedback(goal_handle, snapshot)
