# SPDX-License-Identifier: BSD-3-Clause
"""An action server whose goals run in threads of their own, so that a cancel arrives while a goal is worked on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import rospy

from modular_framework_planning.errors import ErrorCode
from modular_framework_ros.action_server import SteadyActionServer
from modular_framework_ros.publishing import going_down
from modular_framework_ros.running_goals import RunningGoals, overlap

PREVIOUS_GOAL_TIMEOUT_S = 10.0


def error_code_of(result: Any) -> Any:
    """Returns the moveit_msgs/MoveItErrorCodes of an action's result; a sequence has it one level down."""
    return getattr(result, "response", result).error_code


class GoalRunner:
    """Runs goals; a new goal cancels those before that use something it uses, and starts when they have ended.

    `work(goal, cancelled, feedback)` returns the result and whether it succeeded; `cancelled` is an Event. `uses(goal)`
    returns the names of what a goal uses; None: everything, so that one goal runs at a time.
    """

    def __init__(
        self,
        name: str,
        kind: Any,
        work: Callable[[Any, threading.Event, Callable[[Any], None]], tuple[Any, bool, str]],
        uses: Callable[[Any], frozenset[str] | None] = lambda goal: None,
    ) -> None:
        self._work, self._uses = work, uses
        self._result_type = type(kind().action_result.result)
        self._used: list[frozenset[str] | None] = []
        self._ended = threading.Condition()
        self._goals = RunningGoals()
        self._server = SteadyActionServer(name, kind, self._on_goal, self._goals.cancel, auto_start=False)

    def connect(self) -> None:
        """Starts the server."""
        self._server.start()

    def _on_goal(self, handle: Any) -> None:
        uses = self._uses(handle.get_goal())
        cancelled = self._goals.add(handle, uses)
        threading.Thread(target=self._run, args=(handle, cancelled, uses), daemon=True).start()

    def _begin(self, uses: frozenset[str] | None) -> bool:
        """Waits until no goal before uses the same; returns whether that came in time."""
        with self._ended:
            free = self._ended.wait_for(
                lambda: not any(overlap(used, uses) for used in self._used), PREVIOUS_GOAL_TIMEOUT_S
            )
            if free:
                self._used.append(uses)
            return free

    def _end(self, uses: frozenset[str] | None) -> None:
        with self._ended:
            self._used.remove(uses)
            self._ended.notify_all()

    def _run(self, handle: Any, cancelled: threading.Event, uses: frozenset[str] | None) -> None:
        if not self._begin(uses):
            self._goals.remove(handle)
            handle.set_rejected(
                self._result(ErrorCode.PREEMPTED), f"the goal before did not end within {PREVIOUS_GOAL_TIMEOUT_S:.0f} s"
            )
            return
        try:
            if cancelled.is_set():
                handle.set_canceled(self._result(ErrorCode.PREEMPTED), "cancelled before it was begun")
                return
            handle.set_accepted()
            result, succeeded, text = self._work(handle.get_goal(), cancelled, handle.publish_feedback)
            if succeeded:
                handle.set_succeeded(result, text)
            elif cancelled.is_set():
                handle.set_canceled(result, text)
            else:
                handle.set_aborted(result, text)
        except Exception as error:  # noqa: BLE001 - the client must get an answer whatever happens; it is logged here
            self._on_fault(handle, error)
        finally:
            self._end(uses)
            self._goals.remove(handle)

    def _on_fault(self, handle: Any, error: Exception) -> None:
        """Answers a goal that ended with an exception; at shutdown the topics are closed, and nothing is published."""
        if going_down():
            rospy.logdebug("action goal ended while the node went down: %s", error)
            return
        rospy.logerr("action goal ended by an unexpected %s", type(error).__name__, exc_info=error)
        handle.set_aborted(self._result(ErrorCode.FAILURE), f"unexpected {type(error).__name__}: {error}")

    def _result(self, code: ErrorCode) -> Any:
        """Returns an empty result with a code, for a goal that was not worked on to its end."""
        result = self._result_type()
        error_code_of(result).val = code
        return result
