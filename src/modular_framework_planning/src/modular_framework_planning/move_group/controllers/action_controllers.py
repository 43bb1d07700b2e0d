# SPDX-License-Identifier: BSD-3-Clause
"""The executor's interface to controllers, and the controllers of ~controller_list, commanded by actions."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Protocol

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, GripperCommandAction

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.execution_messages import MotionPart, gripper_goal, trajectory_goal
from modular_framework_planning.move_group.node_parameters import parameter
from modular_framework_planning.trajectory_execution.controllers import (
    ACTION_KINDS,
    GRIPPER,
    ControllerSpec,
    parse_controllers,
)
from modular_framework_ros.action_client import SteadyActionClient, is_connected
from modular_framework_ros.calls import wait_until

ACTION_TYPES = dict(zip(ACTION_KINDS, (FollowJointTrajectoryAction, GripperCommandAction), strict=True))


class RunningMotion(Protocol):
    """Motion of a single controller."""

    def is_done(self) -> bool:
        """Returns whether the controller has reported success; raises PlanningError if the motion failed."""

    def has_begun(self) -> bool:
        """Returns whether the controller has accepted or refused the motion."""

    def cancel(self) -> None:
        """Asks the controller to stop; has no effect on a finished motion."""


class ControllerManager(Protocol):
    """All controllers of a robot."""

    may_switch: bool

    def connect(self) -> None:
        """Starts connecting to the controllers."""

    def describe(self) -> str:
        """Returns a description of the controllers for the log."""

    def controllers(self) -> tuple[ControllerSpec, ...]:
        """Returns the current controllers; raises PlanningError if they cannot be listed."""

    def prepare(self, parts: Sequence[MotionPart]) -> None:
        """Waits until the controllers of these parts accept goals; raises PlanningError."""

    def begin(self, part: MotionPart) -> RunningMotion:
        """Starts a motion."""


def listed_controllers(kinds: Sequence[str] = ACTION_KINDS, default_kind: str = "") -> tuple[ControllerSpec, ...]:
    """Returns the valid controllers of ~controller_list; invalid entries are logged.

    Args:
        kinds: Accepted controller types.
        default_kind: Type of entries without a type.
    """
    source_name = rospy.resolve_name("~controller_list")
    specs, faults = parse_controllers(parameter("~controller_list") or [], kinds, default_kind)
    for fault in faults:
        rospy.logerr("%s: %s; this controller is left out", source_name, fault)
    return tuple(specs)


class ActionControllers:
    """The controllers of ~controller_list, which are assumed to be running.

    Action clients: <name>/<action_ns> of every controller (control_msgs/FollowJointTrajectory or GripperCommand).
    """

    may_switch = False

    def __init__(self, specs: tuple[ControllerSpec, ...], timeout_s: float) -> None:
        self._specs = specs
        self._timeout_s = timeout_s
        self._clients: dict[str, Any] = {}

    def connect(self) -> None:
        """Starts connecting to the actions."""
        for spec in self._specs:
            self._client(spec)

    def describe(self) -> str:
        """Returns the number of controllers as text."""
        return f"{len(self._specs)} controllers"

    def controllers(self) -> tuple[ControllerSpec, ...]:
        """Returns the listed controllers."""
        return self._specs

    def _client(self, spec: ControllerSpec) -> Any:
        if spec.action not in self._clients:
            self._clients[spec.action] = SteadyActionClient(spec.action, ACTION_TYPES[spec.kind])
        return self._clients[spec.action]

    def prepare(self, parts: Sequence[MotionPart]) -> None:
        """Waits for the actions; raises PlanningError naming a missing action."""
        for spec in (part.controller for part in parts):
            if not wait_until(partial(is_connected, self._client(spec)), self._timeout_s):
                raise PlanningError(
                    ErrorCode.CONTROL_FAILED,
                    f"action {rospy.resolve_name(spec.action)} of "
                    f"controller '{spec.name}' did not answer within {self._timeout_s:.1f} s; is "
                    "the controller running?",
                )

    def begin(self, part: MotionPart) -> RunningMotion:
        """Sends the goal."""
        client = self._client(part.controller)
        client.send_goal(gripper_goal(part) if part.controller.kind == GRIPPER else trajectory_goal(part))
        return ActionMotion(part.controller, client)


class ActionMotion:
    """A goal of a controller's action server."""

    def __init__(self, spec: ControllerSpec, client: Any) -> None:
        self._spec = spec
        self._client = client

    def is_done(self) -> bool:
        """Returns whether the goal has succeeded; raises PlanningError with the controller's message if it failed."""
        # DONE means that both the final status and the later result have arrived
        if self._client.simple_state != actionlib.SimpleGoalState.DONE:
            return False
        state, result = self._client.get_state(), self._client.get_result()
        is_gripper = self._spec.kind == GRIPPER
        if state == GoalStatus.SUCCEEDED and (is_gripper or getattr(result, "error_code", 0) == 0):
            return True
        if is_gripper and self._spec.allow_failure and state == GoalStatus.ABORTED:
            rospy.loginfo("controller '%s' aborted its goal, which allow_failure permits", self._spec.name)
            return True
        code = getattr(result, "error_code", None)
        text = getattr(result, "error_string", "") or self._client.get_goal_status_text()
        raise PlanningError(
            ErrorCode.PREEMPTED if state == GoalStatus.PREEMPTED else ErrorCode.CONTROL_FAILED,
            f"controller '{self._spec.name}' ended with {GoalStatus.to_string(state)}"
            f"{'' if code is None else f', error_code {code}'}: {text or 'no text'}",
        )

    def has_begun(self) -> bool:
        """Returns whether the goal is no longer pending."""
        return self._client.get_state() != GoalStatus.PENDING

    def cancel(self) -> None:
        """Cancels the goal."""
        self._client.cancel_goal()
