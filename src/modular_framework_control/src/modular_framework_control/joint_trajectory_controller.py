# SPDX-License-Identifier: BSD-3-Clause
"""Makes joints follow trajectories, with tolerances, under the parameters of ros_controllers' trajectory controller.

Goals, commands and cancellations arrive from any thread in a mailbox that `update` empties; whatever depends on time is
decided in `update`, by the time given there.
"""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from modular_framework_control.controller import Controller, ControllerError
from modular_framework_control.controller_switch import LOGGER
from modular_framework_control.goal_ticket import GoalStatus
from modular_framework_control.hardware_interface import HardwareInterface, JointHandle, PositionJointInterface
from modular_framework_control.joint_limits import limits_from_urdf
from modular_framework_control.node_handle import NodeHandle, read_bool, read_names, read_number
from modular_framework_control.rates import next_due, period_of
from modular_framework_control.trajectory import (
    POSITION,
    SHORTEST_SEGMENT_S,
    Array,
    InvalidTrajectoryError,
    Spline,
    Track,
    check_points,
    splice,
    stop_ramp,
)
from modular_framework_control.trajectory_goal import (
    GoalRejectedError,
    TrajectoryErrorCode,
    TrajectoryGoal,
    TrajectorySnapshot,
    TrajectoryTicket,
)
from modular_framework_control.trajectory_tolerances import (
    Tolerances,
    read_tolerances,
    tolerances_of_goal,
    violations,
)


@dataclass(frozen=True, slots=True)
class _Order:
    """A checked goal in the mailbox; `spline` is None for "stop"."""

    joints: tuple[int, ...]
    stamp_s: float
    spline: Spline | None
    tolerances: Tolerances
    ticket: TrajectoryTicket | None


@dataclass(frozen=True, slots=True)
class _Stage:
    """The tracks in force from `from_s` on."""

    from_s: float
    tracks: tuple[Track, ...]


class JointTrajectoryController(Controller):
    """position_controllers/JointTrajectoryController.

    Parameters, below the controller's name: `joints`; `constraints/{goal_time [s] 0.0, stopped_velocity_tolerance
    [rad/s] 0.01, <joint>/{trajectory, goal} [rad] 0 = not checked}`; `stop_trajectory_duration` [s] 0.0;
    `state_publish_rate` [1/s] 50; `action_monitor_rate` [1/s] 20; `allow_partial_joints_goal` false.

    Attributes:
        joint_names: the joints, in the order of all arrays.
        on_state: called in the control loop at `state_publish_rate` with a snapshot; must not block.
        on_feedback: called in the control loop at `action_monitor_rate` with the active ticket and a snapshot.
    """

    interface_class: ClassVar[type[HardwareInterface[Any]]] = PositionJointInterface

    def __init__(self) -> None:
        self.joint_names: list[str] = []
        self.on_state: Callable[[TrajectorySnapshot], None] | None = None
        self.on_feedback: Callable[[TrajectoryTicket, TrajectorySnapshot], None] | None = None
        self._handles: list[JointHandle] = []
        self._mailbox: deque[_Order | TrajectoryTicket] = deque()
        self._running = False
        self._stages: tuple[_Stage, ...] = ()
        self._active: _Order | None = None
        self._end_s = 0.0
        self._time_s = 0.0

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        self.joint_names = read_names(controller_nh, "joints")
        self._handles = [hw.get_handle(name) for name in self.joint_names]
        self._tolerances = read_tolerances(controller_nh, self.joint_names)
        self._stop_duration_s = read_number(controller_nh, "stop_trajectory_duration", 0.0)
        self._state_period_s = period_of(read_number(controller_nh, "state_publish_rate", 50.0))
        self._monitor_period_s = period_of(read_number(controller_nh, "action_monitor_rate", 20.0))
        self._allow_partial = read_bool(controller_nh, "allow_partial_joints_goal", False)
        description = root_nh.get_param("robot_description")
        limits = limits_from_urdf(description) if isinstance(description, str) else {}
        self._continuous = np.array([name in limits and limits[name].continuous for name in self.joint_names])
        self._any_continuous = bool(self._continuous.any())
        self._actual = np.zeros((2, len(self.joint_names)))
        return True

    # ---- any thread ----

    def submit(self, goal: TrajectoryGoal, ticket: TrajectoryTicket | None = None) -> None:
        """Hand a goal (with a ticket) or a command (without) to the control loop.

        Raises:
            GoalRejectedError: it is malformed or the controller does not run; the ticket is left as it is.
        """
        if not self._running:
            raise GoalRejectedError(TrajectoryErrorCode.INVALID_GOAL, "the controller is not running; start it first")
        trajectory = goal.trajectory
        if not trajectory.points and ticket is None:
            everything = tuple(range(len(self.joint_names)))
            self._mailbox.append(_Order(everything, 0.0, None, self._tolerances, None))
            return
        joints = self._indices(trajectory.joint_names)
        try:
            check_points(trajectory)
            if math.isnan(goal.goal_time_tolerance_s):
                raise InvalidTrajectoryError("goal_time_tolerance is not a number")
            tolerances = tolerances_of_goal(self._tolerances, self.joint_names, joints, goal.path_tolerance,
                                            goal.goal_tolerance, goal.goal_time_tolerance_s)
        except InvalidTrajectoryError as error:
            raise GoalRejectedError(TrajectoryErrorCode.INVALID_GOAL, str(error)) from error
        spline = Spline(trajectory) if trajectory.points else None
        self._mailbox.append(_Order(joints, trajectory.stamp_s, spline, tolerances, ticket))

    def _indices(self, names: tuple[str, ...]) -> tuple[int, ...]:
        faults = [f"unknown joint '{name}'" for name in names if name not in self.joint_names]
        faults += [f"joint '{name}' is named twice" for name in sorted(set(names)) if names.count(name) > 1]
        missing = [name for name in self.joint_names if name not in names]
        if missing and not (self._allow_partial and names):
            faults.append(f"joints missing: {', '.join(missing)} (allow_partial_joints_goal is "
                          f"{str(self._allow_partial).lower()})")
        if faults:
            raise GoalRejectedError(TrajectoryErrorCode.INVALID_JOINTS,
                                    f"{'; '.join(faults)}; joints of the controller: {', '.join(self.joint_names)}")
        return tuple(self.joint_names.index(name) for name in names)

    def cancel(self, ticket: TrajectoryTicket) -> None:
        """Ask the control loop to stop following the goal of `ticket`."""
        self._mailbox.append(ticket)

    def desired_at(self, time_s: float) -> Array:
        """Desired position, velocity and acceleration at `time_s` [s], shape (3, joints).

        Raises:
            ControllerError: the controller has not been started.
        """
        stages = self._stages
        if not stages:
            raise ControllerError("the controller has not been started; nothing is desired yet")
        return self._sample(stages, time_s)

    # ---- control loop ----

    def starting(self, time_s: float) -> None:
        self._reject_waiting("the goal was sent while the controller was being stopped")
        self._read_actual()
        everything = tuple(range(len(self.joint_names)))
        self._stages = (_Stage(time_s, (Track.hold(everything, self._actual[POSITION], time_s),)),)
        self._active = None
        self._time_s = time_s
        self._next_state_s = self._next_feedback_s = time_s
        self._running = True

    def stopping(self, time_s: float) -> None:
        del time_s
        self._end_all(GoalStatus.CANCELED, "the controller was stopped")

    def failed(self, time_s: float, reason: str) -> None:
        del time_s
        self._end_all(GoalStatus.ABORTED, f"the controller failed: {reason}")

    def _end_all(self, status: GoalStatus, text: str) -> None:
        self._running = False
        self._finish(status, TrajectoryErrorCode.INVALID_GOAL, text)
        self._reject_waiting(text)

    def _reject_waiting(self, text: str) -> None:
        while self._mailbox:
            order = self._mailbox.popleft()
            if isinstance(order, _Order) and order.ticket is not None:
                order.ticket.finish(GoalStatus.REJECTED, TrajectoryErrorCode.INVALID_GOAL, text)

    def update(self, time_s: float, period_s: float) -> None:
        self._time_s = time_s
        while self._mailbox:
            order = self._mailbox.popleft()
            if isinstance(order, _Order):
                self._take_up(order, time_s)
            elif self._active is not None and self._active.ticket is order:
                self._finish(GoalStatus.CANCELED, TrajectoryErrorCode.INVALID_GOAL, "canceled on request")
                self._stop(time_s)
        stages = self._stages
        if len(stages) > 1 and time_s >= stages[1].from_s:
            stages = self._stages = tuple(stage for i, stage in enumerate(stages)
                                          if i + 1 == len(stages) or stages[i + 1].from_s > time_s)
        desired = self._sample(stages, time_s)
        self._read_actual()
        error = desired[:2] - self._actual
        if self._any_continuous:
            turned = error[POSITION, self._continuous]
            error[POSITION, self._continuous] = turned - 2.0 * math.pi * np.round(turned / (2.0 * math.pi))
        self._command(desired, error, period_s)
        if self._active is not None:
            self._check(self._active, time_s, error)
        self._report(time_s, desired, error)

    def _command(self, desired: Array, error: Array, period_s: float) -> None:
        """Command the joints; `desired` is position, velocity and acceleration, `error` that of the first two."""
        del error, period_s
        for handle, position in zip(self._handles, desired[POSITION].tolist(), strict=True):
            handle.command = position

    def _read_actual(self) -> None:
        states = [handle.state for handle in self._handles]
        self._actual[0] = [state.position for state in states]
        self._actual[1] = [state.velocity for state in states]

    def _sample(self, stages: tuple[_Stage, ...], time_s: float) -> Array:
        stage = stages[0]
        for later in stages[1:]:
            if later.from_s <= time_s:
                stage = later
        if len(stage.tracks) == 1 and stage.tracks[0].joints == list(range(len(self.joint_names))):
            return stage.tracks[0].sample(time_s)
        state = np.zeros((3, len(self.joint_names)))
        for track in stage.tracks:
            state[:, track.joints] = track.sample(time_s)
        return state

    def _take_up(self, order: _Order, time_s: float) -> None:
        """Begin to follow a goal: replaces the goal before it, and its motion from the start of the new one on."""
        if order.spline is None:
            self._replace_active(order)
            self._stop(time_s)
            return
        origin_s = order.stamp_s if order.stamp_s > 0.0 else time_s
        end_s = origin_s + float(order.spline.times_s[-1])
        if end_s <= time_s + SHORTEST_SEGMENT_S:
            text = (f"all points lie in the past: the last one was due {time_s - end_s:.6g} s before the goal was "
                    f"taken up at {time_s:.6g} s; give a later header stamp or time_from_start")
            if order.ticket is None:
                LOGGER.warning("trajectory command ignored: %s", text)
            else:
                order.ticket.finish(GoalStatus.REJECTED, TrajectoryErrorCode.INVALID_GOAL, text)
            return
        splice_s = max(time_s, origin_s)
        if end_s <= splice_s + SHORTEST_SEGMENT_S:
            splice_s = time_s
        joints = list(order.joints)
        track = splice(order.spline, joints, origin_s, splice_s, self.desired_at(splice_s)[:, joints],
                       self._continuous[joints].tolist())
        self._replace_active(order)
        self._put_stage(splice_s, track)

    def _put_stage(self, from_s: float, track: Track) -> None:
        earlier = tuple(stage for stage in self._stages if stage.from_s < from_s) or self._stages[:1]
        others = (old.without(track.joints) for old in earlier[-1].tracks)
        self._stages = (*earlier, _Stage(from_s, (*(other for other in others if other is not None), track)))
        self._end_s = track.end_s

    def _replace_active(self, order: _Order) -> None:
        self._finish(GoalStatus.CANCELED, TrajectoryErrorCode.INVALID_GOAL, "preempted by a new goal")
        if order.ticket is not None:
            self._active = order
            order.ticket.activate()

    def _stop(self, time_s: float) -> None:
        everything = range(len(self.joint_names))
        state = self.desired_at(time_s)
        self._put_stage(time_s, stop_ramp(everything, state, time_s, self._stop_duration_s))

    def _check(self, order: _Order, time_s: float, error: Array) -> None:
        tolerances = order.tolerances
        if time_s < self._end_s:
            outside = violations(error, tolerances.path, self.joint_names) if tolerances.checks_path else ""
            if outside:
                self._finish(GoalStatus.ABORTED, TrajectoryErrorCode.PATH_TOLERANCE_VIOLATED,
                             f"path tolerance violated: {outside}")
                self._stop(time_s)
            return
        outside = violations(error, tolerances.goal, self.joint_names)
        if not outside:
            self._finish(GoalStatus.SUCCEEDED, TrajectoryErrorCode.SUCCESSFUL, "goal reached")
        elif time_s >= self._end_s + tolerances.goal_time_s:
            self._finish(GoalStatus.ABORTED, TrajectoryErrorCode.GOAL_TOLERANCE_VIOLATED,
                         f"goal tolerance violated {time_s - self._end_s:.6g} s after the end of the trajectory "
                         f"(goal_time {tolerances.goal_time_s:.6g} s): {outside}")

    def _finish(self, status: GoalStatus, code: TrajectoryErrorCode, text: str) -> None:
        order, self._active = self._active, None
        if order is not None and order.ticket is not None:
            order.ticket.finish(status, code, text)

    def _report(self, time_s: float, desired: Array, error: Array) -> None:
        state_due = self.on_state is not None and time_s >= self._next_state_s
        feedback_due = self._active is not None and self.on_feedback is not None and time_s >= self._next_feedback_s
        if not state_due and not feedback_due:
            return
        snapshot = TrajectorySnapshot(time_s, desired, self._actual.copy(), error)
        if state_due and self.on_state is not None:
            self._next_state_s = next_due(self._next_state_s, self._state_period_s, time_s)
            self.on_state(snapshot)
        ticket = self._active.ticket if self._active is not None else None
        if feedback_due and self.on_feedback is not None and ticket is not None:
            self._next_feedback_s = next_due(self._next_feedback_s, self._monitor_period_s, time_s)
            self.on_feedback(ticket, snapshot)
