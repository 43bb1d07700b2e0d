# SPDX-License-Identifier: BSD-3-Clause
"""Gripper controller for one joint, with bounded effort and stall detection.

A grasp ends in a stall: the fingers stop short of the goal because they hold an object. As in ros_controllers, the goal
is then aborted with `stalled` set. With `allow_stalling`, a parameter of ros2_controllers, the goal succeeds instead.
In both cases, the command stays active, so that the fingers keep their grip.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.controller_interface.pid import PidGains
from modular_framework_control.controllers.joint_command_controllers import JointControlSnapshot
from modular_framework_control.hardware_interface.handles import JointHandle, measurement_fault
from modular_framework_control.hardware_interface.interfaces import HardwareInterface, PositionJointInterface
from modular_framework_control.hardware_interface.joint_limit_parameters import GOAL_TOLERANCE
from modular_framework_control.hardware_interface.joint_limits import limits_of
from modular_framework_control.realtime.goal_handle import GoalStatus, RealtimeGoalHandle
from modular_framework_control.realtime.mailbox import Mailbox
from modular_framework_control.realtime.schedule import Schedule
from modular_framework_control.trajectory.point_checks import MAX_VALUE
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names, read_bool, read_names, read_number


@dataclass(frozen=True, slots=True)
class GripperState:
    """Feedback and result of a gripper goal.

    Attributes:
        position: Measured position [rad|m].
        effort: Measured effort [Nm|N].
        stalled: Whether the joint is at rest but not at the goal.
        reached_goal: Whether the joint is within `goal_tolerance` of the goal.
    """

    position: float
    effort: float
    stalled: bool
    reached_goal: bool


GripperGoalHandle = RealtimeGoalHandle[GripperState]


class GripperGoalError(Exception):
    """A gripper goal cannot be accepted."""


@dataclass(frozen=True, slots=True)
class _Goal:
    position: float
    max_effort: float
    goal_handle: GripperGoalHandle


class GripperActionController(Controller):
    """position_controllers/GripperActionController.

    A joint is stalled if it stays within `stall_velocity_threshold * stall_timeout` of one position for
    `stall_timeout`. This criterion bounds the mean velocity instead of the velocity of one cycle, because contacts make
    the joint vibrate. The time counts from the start of the goal. Goals are not evaluated while measurements are stale,
    and this time does not count.

    A goal beyond the known limits of the joint is refused, as in the trajectory controller.

    During a hardware fault, the joint is held at its measured position, and goals are refused with the fault's reason.
    If the measured position is not a number, the goal is aborted and the joint is held at its last measured position.

    Parameters, below the controller's name: `joint`; `goal_tolerance` [rad|m] 0.01; `max_effort` [Nm|N] 0, the default
    for goals, where 0 means the hardware's default; `stall_velocity_threshold` [rad/s|m/s] 0.001; `stall_timeout` [s]
    1.0; `allow_stalling` false, whether a stalled goal succeeds; `action_monitor_rate` [1/s] 20; `state_publish_rate`
    [1/s] 50.

    Attributes:
        on_state: Function called in the control loop at `state_publish_rate` with a snapshot, whose gains are 0.
        on_feedback: Function called in the control loop at `action_monitor_rate` with the active goal handle and state.
    """

    interface_class: ClassVar[type[HardwareInterface[Any]]] = PositionJointInterface

    def __init__(self) -> None:
        self.on_state: Callable[[JointControlSnapshot], None] | None = None
        self.on_feedback: Callable[[GripperGoalHandle, GripperState], None] | None = None
        self._mailbox: Mailbox[_Goal | GripperGoalHandle] = Mailbox()
        self._active: _Goal | None = None
        self._running = False
        self._command = 0.0
        self._max_effort = 0.0
        self._measured = 0.0
        self._fault = ""

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        names = read_names(controller_nh, "joint")
        if len(names) != 1:
            source = join_names(controller_nh.namespace, "joint")
            raise ParameterError(f"parameter {source}: got {names!r}; expected the name of one joint")
        self._handle: JointHandle = hw.get_handle(names[0])
        (self._limits,) = limits_of([self._handle], root_nh)
        self._goal_tolerance = read_number(controller_nh, "goal_tolerance", 0.01)
        self._default_max_effort = abs(read_number(controller_nh, "max_effort", 0.0, None))
        self._stall_timeout_s = read_number(controller_nh, "stall_timeout", 1.0)
        self._allow_stalling = read_bool(controller_nh, "allow_stalling", False)
        threshold = read_number(controller_nh, "stall_velocity_threshold", 0.001)
        self._stall_distance = threshold * self._stall_timeout_s
        self._state_schedule = Schedule(read_number(controller_nh, "state_publish_rate", 50.0))
        self._feedback_schedule = Schedule(read_number(controller_nh, "action_monitor_rate", 20.0))
        return True

    # ---- any thread ----

    @property
    def moving(self) -> bool:
        """Whether the controller executes a goal."""
        return self._active is not None

    def submit(self, position: float, max_effort: float, goal_handle: GripperGoalHandle) -> None:
        """Hands a goal to the control loop.

        Args:
            position: Goal position [rad|m].
            max_effort: Bound of the magnitude of the effort [Nm|N]; 0 for the controller's default.
            goal_handle: Handle that receives the status of the goal.

        Raises:
            GripperGoalError: A value is not finite, the position is beyond the joint's limits, or the controller is
                stopped. If the controller is stopped during the call, the goal handle ends as rejected.
        """
        if not self._running:
            raise GripperGoalError("the controller is not running; start it first")
        if not math.isfinite(position) or not math.isfinite(max_effort):
            raise GripperGoalError(
                f"got position {position}, max_effort {max_effort}; expected finite numbers (effort 0 = default)"
            )
        min_position, max_position = self._limits.range_from(self._handle.position)
        if (
            position < max(min_position, -MAX_VALUE) - GOAL_TOLERANCE
            or position > min(max_position, MAX_VALUE) + GOAL_TOLERANCE
        ):
            raise GripperGoalError(
                f"position of joint '{self._handle.name}' is {position:.6g}; its limits are "
                f"{self._limits.min_position:.6g} to {self._limits.max_position:.6g}; give a position within the limits"
            )
        self._mailbox.put(_Goal(position, abs(max_effort), goal_handle))
        if not self._running:
            self._reject_pending("the controller was stopped")

    def cancel(self, goal_handle: GripperGoalHandle) -> None:
        """Requests that the control loop cancels the goal of `goal_handle`."""
        self._mailbox.put(goal_handle)

    # ---- control loop ----

    def starting(self, time_s: float) -> None:
        self._reject_pending("the goal was sent while the controller was stopping")
        self._active, self._fault = None, ""
        missing = measurement_fault([self._handle])
        if missing:
            raise ControllerError(missing)
        self._max_effort = self._default_max_effort
        self._hold()
        self._apply(0.0)
        self._state_schedule.start(time_s)
        self._running = True

    def stopping(self, time_s: float) -> None:
        self._end_goals(GoalStatus.CANCELED, "the controller was stopped")

    def interrupted(self, time_s: float, reason: str) -> None:
        self._end_goals(GoalStatus.CANCELED, reason)

    def failed(self, time_s: float, reason: str) -> None:
        self._end_goals(GoalStatus.ABORTED, f"the controller failed: {reason}")

    def on_hardware_fault(self, time_s: float, reason: str) -> None:
        self._fault = f"hardware fault: {reason}"
        self._finish(GoalStatus.ABORTED, self._state(False, False), self._fault)

    def on_hardware_recovered(self, time_s: float) -> None:
        self._fault = ""
        self._hold()

    def _end_goals(self, status: GoalStatus, text: str) -> None:
        self._running = False
        if self._active is not None:  # a gripper at its goal keeps its grip; a moving gripper stops
            self._hold()
            self._apply(0.0)
        self._finish(status, self._state(False, False), text)
        self._reject_pending(text)

    def _reject_pending(self, text: str) -> None:
        for goal in self._mailbox.drain():
            if isinstance(goal, _Goal):
                goal.goal_handle.finish(GoalStatus.REJECTED, self._state(False, False), text)

    def update(self, time_s: float, period_s: float) -> None:
        if self._active is not None:
            self._command = self._active.position
        self._mailbox.process(lambda goal: self._process(goal, time_s))
        missing = measurement_fault([self._handle])
        if missing and self._active is not None:
            self._finish(GoalStatus.ABORTED, self._state(False, False), missing)
            self._hold()
        elif not missing:
            self._measured = self._handle.position
        if self._fault:
            self._hold()
        self._apply(period_s)
        if self._active is not None:
            self._check(self._active, time_s, period_s)
        if self.on_state is not None and self._state_schedule.take_if_due(time_s):
            self.on_state(self._snapshot(time_s, period_s))

    def _snapshot(self, time_s: float, period_s: float) -> JointControlSnapshot:
        handle = self._handle
        error = self._command - handle.position
        return JointControlSnapshot(
            time_s=time_s,
            period_s=period_s,
            set_point=self._command,
            process_value=handle.position,
            process_value_dot=handle.velocity,
            error=error,
            command=handle.command,
            gains=PidGains(0.0),
        )

    def _process(self, goal: _Goal | GripperGoalHandle, time_s: float) -> None:
        if isinstance(goal, _Goal) and self._fault:
            goal.goal_handle.finish(GoalStatus.REJECTED, self._state(False, False), self._fault)
        elif isinstance(goal, _Goal):
            self._accept(goal, time_s)
        elif self._active is not None and self._active.goal_handle is goal:
            self._finish(GoalStatus.CANCELED, self._state(False, False), "canceled on request")
            self._hold()

    def _accept(self, goal: _Goal, time_s: float) -> None:
        self._finish(GoalStatus.CANCELED, self._state(False, False), "preempted by a new goal")
        self._active = goal
        position = self._handle.position
        if (self._command - position) * (goal.position - position) < 0.0:
            # The velocity limit is relative to the last command, which lies beyond the surface of the held object.
            self._hold()
        else:
            self._command = goal.position
        self._max_effort = goal.max_effort if goal.max_effort > 0.0 else self._default_max_effort
        self._rest_position = self._handle.position
        self._rest_since_s = time_s
        self._feedback_schedule.start(time_s)
        goal.goal_handle.activate()

    def _check(self, goal: _Goal, time_s: float, period_s: float) -> None:
        position = self._handle.position
        error = goal.position - position
        if self._handle.state.stale:
            self._rest_since_s += period_s
            return
        if abs(error) <= self._goal_tolerance:
            self._finish(GoalStatus.SUCCEEDED, self._state(False, True), "goal position reached")
            return
        if not abs(position - self._rest_position) <= self._stall_distance:
            self._rest_position = position
            self._rest_since_s = time_s
        elif time_s - self._rest_since_s > self._stall_timeout_s:
            self._finish(
                GoalStatus.SUCCEEDED if self._allow_stalling else GoalStatus.ABORTED,
                self._state(True, False),
                f"stalled: joint '{self._handle.name}' is at rest at {position:.6g}, {error:+.6g} short of its "
                f"goal (tolerance {self._goal_tolerance:.6g}), for {time_s - self._rest_since_s:.3g} s",
            )
            return
        if self.on_feedback is not None and self._feedback_schedule.take_if_due(time_s):
            self.on_feedback(goal.goal_handle, self._state(False, False))

    def _hold(self) -> None:
        """Holds the position without more effort than before, because the fingers may hold an object."""
        if math.isfinite(self._handle.position):
            self._measured = self._handle.position
        self._command = self._measured
        self._handle.held = True

    def _apply(self, period_s: float) -> None:
        """Commands the joint; `period_s` is the time since the last call, 0 at a start."""
        del period_s
        self._handle.command = self._command
        self._handle.max_effort = self._max_effort

    def _state(self, stalled: bool, reached_goal: bool) -> GripperState:
        return GripperState(self._handle.position, self._handle.effort, stalled, reached_goal)

    def _finish(self, status: GoalStatus, state: GripperState, text: str) -> None:
        goal, self._active = self._active, None
        if goal is not None:
            goal.goal_handle.finish(status, state, text)
