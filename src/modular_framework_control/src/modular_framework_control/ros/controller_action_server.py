# SPDX-License-Identifier: BSD-3-Clause
"""Passes action goals to a controller in the control loop, and their status and results to the clients."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import rospy
from actionlib.server_goal_handle import ServerGoalHandle
from actionlib_msgs.msg import GoalStatus as GoalStatusMsg

from modular_framework_control.realtime.goal_handle import GoalStatus, RealtimeGoalHandle
from modular_framework_control.ros.outbox import Outbox
from modular_framework_ros.action_server import SteadyActionServer


@contextlib.contextmanager
def released_lock(lock: threading.RLock) -> Iterator[None]:
    """Releases a lock held once by the caller: a cancel request must not wait until a goal has been checked."""
    lock.release()
    try:
        yield
    finally:
        lock.acquire()


Submit = Callable[[Any, RealtimeGoalHandle[Any]], None]
MakeResult = Callable[[RealtimeGoalHandle[Any]], Any]


class GoalRefusedError(Exception):
    """Raised if a goal is rejected on arrival; carries the result to send."""

    def __init__(self, result: Any, text: str) -> None:
        super().__init__(text)
        self.result = result


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalCallbacks:
    """A controller's side of an action.

    Attributes:
        submit: Callback that passes a goal message and its goal handle to the controller, or raises GoalRefusedError.
        cancel: Callback that requests the controller to cancel a goal.
        make_result: Callback that returns the result message of a finished goal.
        is_fault: Callback that decides whether to log a warning for an aborted or rejected goal.
    """

    submit: Submit
    cancel: Callable[[Any], None]
    make_result: MakeResult
    is_fault: Callable[[RealtimeGoalHandle[Any]], bool] = lambda _: True


class ControllerActionServer:
    """Serves one action of a controller; a new goal preempts the previous goal.

    Args:
        name: Absolute action name.
        action: Message class of the action.
        callbacks: The controller's side of the action.
        outbox: Thread that publishes for the control loop.
    """

    def __init__(self, name: str, action: type[Any], callbacks: GoalCallbacks, outbox: Outbox) -> None:
        self._callbacks = callbacks
        self._outbox = outbox
        self._goals: dict[RealtimeGoalHandle[Any], ServerGoalHandle] = {}
        self._submitting = threading.Lock()  # goals keep their order
        self._server = SteadyActionServer(name, action, self._on_goal, self._on_cancel, auto_start=False)
        self._server.start()

    def close(self) -> None:
        """Shuts the action server down."""
        self._server.stop()

    def publish_feedback(self, goal_handle: RealtimeGoalHandle[Any], feedback: Any) -> None:
        """Sends feedback to the client of `goal_handle`, unless the goal has already ended."""
        goal = self._goals.get(goal_handle)
        if goal is not None:
            goal.publish_feedback(feedback)

    def _on_goal(self, goal: ServerGoalHandle) -> None:
        goal_handle: RealtimeGoalHandle[Any] = RealtimeGoalHandle(
            lambda changed: self._outbox.put(self._publish_status, changed, changed.status)
        )
        self._goals[goal_handle] = goal
        try:
            with released_lock(self._server.lock), self._submitting:
                self._callbacks.submit(goal.get_goal(), goal_handle)
            if goal.get_goal_status().status == GoalStatusMsg.RECALLING:  # canceled before it was submitted
                self._callbacks.cancel(goal_handle)
        except GoalRefusedError as error:
            del self._goals[goal_handle]
            rospy.logwarn("%s: goal rejected: %s", self._server.ns, error)
            goal.set_rejected(error.result, str(error))
        except Exception as error:  # the client needs a reply to any message
            del self._goals[goal_handle]
            rospy.logerr("%s: goal rejected: %s: %s", self._server.ns, type(error).__name__, error)
            goal.set_rejected(None, f"{type(error).__name__}: {error}")

    def _on_cancel(self, goal: ServerGoalHandle) -> None:
        for goal_handle, known in list(self._goals.items()):
            if known == goal:
                self._callbacks.cancel(goal_handle)

    def _publish_status(self, goal_handle: RealtimeGoalHandle[Any], status: GoalStatus) -> None:
        goal = self._goals[goal_handle]
        if status is GoalStatus.ACTIVE:
            goal.set_accepted()
            return
        del self._goals[goal_handle]
        finish = {
            GoalStatus.SUCCEEDED: goal.set_succeeded,
            GoalStatus.ABORTED: goal.set_aborted,
            GoalStatus.CANCELED: goal.set_canceled,
            GoalStatus.REJECTED: goal.set_rejected,
        }[status]
        if status in (GoalStatus.ABORTED, GoalStatus.REJECTED):
            log = rospy.logwarn if self._callbacks.is_fault(goal_handle) else rospy.logdebug
            log("%s: goal %s: %s", self._server.ns, status.value, goal_handle.text)
        finish(self._callbacks.make_result(goal_handle), goal_handle.text)
