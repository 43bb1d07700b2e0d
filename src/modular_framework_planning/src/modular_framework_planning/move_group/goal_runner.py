# SPDX-License-Identifier: BSD-3-Clause
"""An action server with a thread per goal, so that a cancel request arrives while a goal runs."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import rospy

from modular_framework_planning.errors import ErrorCode
from modular_framework_ros.action_server import SteadyActionServer
from modular_framework_ros.publishing import going_down
from modular_framework_ros.running_goals import RunningGoals, overlap

PREVIOUS_GOAL_TIMEOUT_S = 10.0


def error_code_of(result: Any) -> Any:
    """Returns the moveit_msgs/MoveItErrorCodes of an action's result; in a sequence it is a field of `response`."""
    return getattr(result, "response", result).error_code


class GoalEnd(NamedTuple):
    """The end of a goal.

    Attributes:
        result: Result message.
        succeeded: Whether the goal succeeded.
        text: Text for the client.
    """

    result: Any
    succeeded: bool
    text: str


class GoalRunner:
    """Runs goals; a new goal cancels earlier goals that share a resource with it and starts when they have ended."""

    def __init__(
        self,
        name: str,
        kind: Any,
        execute: Callable[[Any, threading.Event, Callable[[Any], None]], GoalEnd],
        resources: Callable[[Any], frozenset[str] | None] = lambda goal: None,
    ) -> None:
        """Creates the server without starting it.

        Args:
            name: Name of the action.
            kind: Action type.
            execute: Called with the goal, an event that is set on cancellation, and a function that publishes feedback.
            resources: Returns the names of the resources that a goal uses; None for all resources.
        """
        self._execute, self._resources = execute, resources
        self._result_type = type(kind().action_result.result)
        self._used_resources: list[frozenset[str] | None] = []
        self._ended = threading.Condition()
        self._goals = RunningGoals()
        self._server = SteadyActionServer(name, kind, self._on_goal, self._goals.cancel, auto_start=False)

    def connect(self) -> None:
        """Starts the server."""
        self._server.start()

    def _on_goal(self, handle: Any) -> None:
        resources = self._resources(handle.get_goal())
        cancelled = self._goals.add(handle, resources)
        threading.Thread(target=self._run, args=(handle, cancelled, resources), daemon=True).start()

    def _begin(self, resources: frozenset[str] | None) -> bool:
        """Waits for earlier goals that share resources; returns False on timeout."""
        with self._ended:
            is_free = self._ended.wait_for(
                lambda: not any(overlap(other, resources) for other in self._used_resources), PREVIOUS_GOAL_TIMEOUT_S
            )
            if is_free:
                self._used_resources.append(resources)
            return is_free

    def _end(self, resources: frozenset[str] | None) -> None:
        with self._ended:
            self._used_resources.remove(resources)
            self._ended.notify_all()

    def _run(self, handle: Any, cancelled: threading.Event, resources: frozenset[str] | None) -> None:
        if not self._begin(resources):
            self._goals.remove(handle)
            handle.set_rejected(
                self._result(ErrorCode.PREEMPTED),
                f"the previous goal did not end within {PREVIOUS_GOAL_TIMEOUT_S:.0f} s; send the goal again",
            )
            return
        try:
            if cancelled.is_set():
                handle.set_canceled(self._result(ErrorCode.PREEMPTED), "cancelled before execution")
                return
            handle.set_accepted()
            result, succeeded, text = self._execute(handle.get_goal(), cancelled, handle.publish_feedback)
            if succeeded:
                handle.set_succeeded(result, text)
            elif cancelled.is_set():
                handle.set_canceled(result, text)
            else:
                handle.set_aborted(result, text)
        except Exception as error:  # noqa: BLE001 - the client must get a result; _on_fault logs the error
            self._on_fault(handle, error)
        finally:
            self._end(resources)
            self._goals.remove(handle)

    def _on_fault(self, handle: Any, error: Exception) -> None:
        """Aborts a goal that raised an exception; at shutdown topics are closed, so nothing is published."""
        if going_down():
            rospy.logdebug("action goal ended during shutdown: %s", error)
            return
        rospy.logerr("action goal ended with an unexpected %s", type(error).__name__, exc_info=error)
        handle.set_aborted(self._result(ErrorCode.FAILURE), f"unexpected {type(error).__name__}: {error}")

    def _result(self, code: ErrorCode) -> Any:
        """Returns an empty result with a code, for an unfinished goal."""
        result = self._result_type()
        error_code_of(result).val = code
        return result
