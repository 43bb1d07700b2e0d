# SPDX-License-Identifier: BSD-3-Clause
"""A state that sends a goal to an action server and waits for its end; a request to stop cancels the goal."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping
from typing import Any

import rospy
from actionlib import CommState, SimpleActionClient
from actionlib_msgs.msg import GoalID, GoalStatus

import smach
from modular_framework_ros.action_client import is_connected
from smach_ros.message_exchange import ExchangeError, MessageSink, MessageSource, ServerCallState
from smach_ros.waiting import POLL_PERIOD_S, RosTimeLimit, WallTimeLimit, seconds

__all__ = ["SimpleActionState"]

SERVER_LOST_S = 5.0
"""Time without the server after which its goal is abandoned [s]."""

_STATUS_NAMES = {value: name for name, value in vars(GoalStatus).items() if name.isupper() and isinstance(value, int)}


class SimpleActionState(ServerCallState):
    """Outcomes: succeeded, aborted, preempted, and the user's outcomes."""

    def __init__(
        self,
        action_name: str,
        action_spec: Any,
        goal: Any = None,
        goal_key: str | None = None,
        goal_slots: Iterable[str] = (),
        goal_cb: Any = None,
        goal_cb_args: Iterable[Any] = (),
        goal_cb_kwargs: Mapping[str, Any] | None = None,
        result_key: str | None = None,
        result_slots: Iterable[str] = (),
        result_cb: Any = None,
        result_cb_args: Iterable[Any] = (),
        result_cb_kwargs: Mapping[str, Any] | None = None,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcomes: Iterable[str] = (),
        exec_timeout: rospy.Duration | None = None,
        preempt_timeout: rospy.Duration | None = rospy.Duration(60.0),  # noqa: B008 - never changed
        server_wait_timeout: rospy.Duration | None = rospy.Duration(60.0),  # noqa: B008 - never changed
        io_keys: Iterable[str] = (),
    ) -> None:
        """Creates the state.

        Args:
            action_name: Name of the action.
            action_spec: Action class, such as ``FibonacciAction``.
            goal: Goal before the changes by keys and callback; None for an empty goal.
            goal_key: Userdata key of the goal.
            goal_slots: Goal fields that are read from userdata keys of the same names.
            goal_cb: Function that receives (userdata, goal, *args, **kwargs) and may modify or replace the goal.
            goal_cb_args: Additional positional arguments of ``goal_cb``.
            goal_cb_kwargs: Additional keyword arguments of ``goal_cb``.
            result_key: Userdata key that receives the result.
            result_slots: Result fields that are stored under userdata keys of the same names.
            result_cb: Function that receives (userdata, goal status, result, *args, **kwargs); may return an outcome.
            result_cb_args: Additional positional arguments of ``result_cb``.
            result_cb_kwargs: Additional keyword arguments of ``result_cb``.
            input_keys: Additional userdata keys that are read.
            output_keys: Additional userdata keys that are written.
            outcomes: Additional outcomes for ``result_cb``.
            exec_timeout: Maximum duration [ROS time], after which the goal is cancelled and the outcome is aborted.
            preempt_timeout: Maximum wait for the end of a cancelled goal [wall time]; then the outcome is aborted.
            server_wait_timeout: Maximum wait for the server [wall time]; then the outcome is aborted.
            io_keys: Additional userdata keys that are read and written.

        Raises:
            smach.InvalidStateError: An argument is invalid; the message names the allowed values.
        """
        super().__init__(input_keys, output_keys, io_keys, outcomes)
        self._action_name = action_name
        self._action_spec = action_spec
        self._exec_timeout_s = seconds("exec_timeout", exec_timeout)
        self._preempt_timeout_s = seconds("preempt_timeout", preempt_timeout)
        self._server_wait_timeout_s = seconds("server_wait_timeout", server_wait_timeout)
        empty_goal, empty_result = _empty_messages(action_name, action_spec)
        on_goal = self._user_callback("goal_cb", goal_cb, goal_cb_args, goal_cb_kwargs)
        on_result = self._user_callback("result_cb", result_cb, result_cb_args, result_cb_kwargs)
        self._use(
            MessageSource("goal", empty_goal, goal, key=goal_key, slots=goal_slots, callback=on_goal),
            MessageSink("result", empty_result, result_key, result_slots, on_result),
        )
        self._lock = threading.RLock()
        self._wake = threading.Event()
        self._goal_is_out = False
        self._client: SimpleActionClient | None = None
        if rospy.core.is_initialized():
            self._connect()  # finds the server while the rest of the machine is constructed

    def _connect(self) -> SimpleActionClient:
        if self._client is None:
            self._client = SimpleActionClient(self._action_name, self._action_spec)
        return self._client

    # ---- stopping ------------------------------------------------------------------------------------------
    def request_preempt(self) -> None:
        """Requests the state to stop and cancels its active goal."""
        with self._lock:
            super().request_preempt()
            if self._goal_is_out and self._client is not None:
                smach.loginfo(f"action '{self._action_name}': stopped; the goal is cancelled")
                _cancel(self._client)
        self._wake.set()

    # ---- running -------------------------------------------------------------------------------------------
    def execute(self, userdata: Any) -> str:
        """Waits for the server, sends the goal and waits for its end."""
        self.reason = ""
        self._wake.clear()
        try:
            if not self._wait_for_server(
                f"the server of action '{self._action_name}'",
                self._is_connected,
                self._server_wait_timeout_s,
                f"no server of type {self._action_spec._type} was at '{rospy.resolve_name(self._action_name)}'",
            ):
                return self._preempt_with(f"action '{self._action_name}': stopped before the goal was sent")
            goal = self._source.make(userdata)
            with self._lock:  # orders a request to stop either before this block or after the goal is active
                if self.preempt_requested():
                    return self._preempt_with(f"action '{self._action_name}': stopped before the goal was sent")
                client = self._connect()
                client.send_goal(goal, done_cb=lambda status, result: self._wake.set())
                self._goal_is_out = True
            return self._follow(client, userdata)
        except ExchangeError as error:
            return self._abort(f"action '{self._action_name}': {error}")
        finally:
            with self._lock:
                self._goal_is_out = False

    def _is_connected(self) -> bool:
        if is_connected(self._connect()):
            return True
        self._wake.wait(POLL_PERIOD_S)
        return False

    def _follow(self, client: SimpleActionClient, userdata: Any) -> str:
        """Waits for the end of the goal and returns the outcome."""
        too_late = self._wait_for_end(client)
        # The status is read last, because it can be final before the result arrives.
        status = client.get_state()
        result = client.get_result() if client.gh else None
        text = client.get_goal_status_text() if client.gh else ""
        chosen = self._sink.deliver(userdata, self.get_registered_outcomes(), result, status)
        outcome = self._outcome(status, text, too_late)
        return outcome if chosen is None else chosen

    def _wait_for_end(self, client: SimpleActionClient) -> str:
        """Waits for the end of the goal; returns the reason if the state cancelled it for lateness, otherwise "".

        Raises:
            ExchangeError: The goal did not end after its cancellation, or the server is lost.
        """
        limit = RosTimeLimit(self._exec_timeout_s)
        lost = WallTimeLimit(SERVER_LOST_S)
        cancelled: WallTimeLimit | None = None
        too_late = ""
        while not _has_ended(client):
            if cancelled is None and (self.preempt_requested() or smach.is_shutdown() or limit.over()):
                if not (self.preempt_requested() or smach.is_shutdown()):
                    too_late = f"was not done within {self._exec_timeout_s} s"
                    smach.logwarn(f"action '{self._action_name}' {too_late}; the goal is cancelled")
                _cancel(client)
                cancelled = WallTimeLimit(self._preempt_timeout_s)
            if cancelled is not None and (cancelled.over() or rospy.is_shutdown()):
                client.stop_tracking_goal()
                raise ExchangeError(
                    f"the goal was cancelled{', since it ' + too_late if too_late else ''}, but did not end within "
                    f"{self._preempt_timeout_s} s"
                )
            if is_connected(client):
                lost = WallTimeLimit(SERVER_LOST_S)
            elif lost.over():
                client.stop_tracking_goal()
                raise ExchangeError(f"the server went away {SERVER_LOST_S} s ago with the goal")
            self._wake.wait(POLL_PERIOD_S)
            self._wake.clear()
        return too_late

    def _outcome(self, status: int, text: str, too_late: str) -> str:
        if status == GoalStatus.SUCCEEDED:
            return "succeeded"
        detail = f": {text}" if text else ""
        if status in (GoalStatus.PREEMPTED, GoalStatus.RECALLED) and self._is_stopped():
            return self._preempt_with(f"action '{self._action_name}': the goal was stopped{detail}")
        why = too_late or f"ended with status {_STATUS_NAMES.get(status, status)}{detail}"
        return self._abort(f"action '{self._action_name}' {why}")


def _empty_messages(action_name: str, action_spec: Any) -> tuple[Any, Any]:
    """Returns an empty goal and result of an action class; raises ``InvalidStateError`` for other objects."""
    if not isinstance(action_name, str) or not action_name:
        raise smach.InvalidStateError(f"action_name must be the name of an action, got {action_name!r}")
    try:
        action = action_spec()
        return action.action_goal.goal, action.action_result.result
    except (AttributeError, TypeError) as error:
        raise smach.InvalidStateError(
            f"action_spec of '{action_name}' must be the class of an action such as FibonacciAction, "
            f"got {action_spec!r}"
        ) from error


def _has_ended(client: SimpleActionClient) -> bool:
    """Returns whether the goal has ended and its result has arrived.

    The goal handle is used, because the client misses the end of a goal that ends while it is being sent.
    """
    return client.gh is not None and client.gh.get_comm_state() == CommState.DONE


def _cancel(client: SimpleActionClient) -> None:
    """Cancels the goal.

    The client's `cancel_goal` treats a goal that is cancelled before the server's confirmation as lost.
    """
    handle = client.gh
    if handle is not None:
        client.action_client.pub_cancel.publish(GoalID(id=handle.comm_state_machine.action_goal.goal_id.id))
