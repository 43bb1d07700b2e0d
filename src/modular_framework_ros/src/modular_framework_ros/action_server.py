# SPDX-License-Identifier: BSD-3-Clause
"""Action servers that report the end of every goal to the client, even if the goal ends at once.

An actionlib client ignores messages about a goal until its send_goal() has returned, so a server reports a goal only
after the client has sent it completely.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from actionlib import ActionServer, SimpleActionServer

from modular_framework_ros.connections.ros_goal_senders import GoalSenders
from modular_framework_ros.publishing import going_down

MAX_STATUS_PAUSE_S = 2.0
"""Maximum pause of the status topic, longer than a single goal stays unreported [s]; reached only by rapid goals."""
CLOSING_DELAY_S = 0.15
"""Delay before the topics are closed, because closing discards what rospy's threads have not sent yet [s]."""


class _StatusTimer(threading.Thread):
    """Publishes the goal status at a fixed rate of real time.

    A rospy timer would wake at every message of /clock and stop while simulated time is held.

    Args:
        server: Action server whose status is published.
        period_s: Real time between two messages [s].
    """

    def __init__(self, server: ActionServer, period_s: float) -> None:
        super().__init__(daemon=True, name=f"status of {server.ns}")
        self._server, self._period_s = server, period_s
        self._ended = threading.Event()

    def run(self) -> None:
        """Publishes until `shutdown` is called."""
        while not self._ended.wait(self._period_s) and not rospy.is_shutdown():
            self._server.publish_status_async(None)

    def shutdown(self) -> None:
        """Stops the timer without waiting for its thread."""
        self._ended.set()


class SteadyActionServer(ActionServer):
    """An action server that publishes its status in real time and reports the end of every goal."""

    def initialize(self) -> None:
        self._last_result_s = -CLOSING_DELAY_S
        self._last_status_s = -MAX_STATUS_PAUSE_S
        self._unreported: dict[str, tuple[Any, Any] | None] = {}
        """Status and result of each unreported goal by its ID; None while the goal runs."""
        self._reports: set[threading.Thread] = set()
        super().initialize()
        self._senders = GoalSenders(self.goal_sub)
        timer: rospy.Timer | None = getattr(self, "status_timer", None)
        if timer is not None:
            timer.shutdown()
            self.status_timer = _StatusTimer(self, 1.0 / self.status_frequency)
            self.status_timer.start()

    def internal_goal_callback(self, goal: Any) -> None:
        with self.lock:
            goal_id, client = goal.goal_id.id, goal._connection_header["callerid"]
            known = {item.status.goal_id.id for item in self.status_list}
            if self.started and goal_id and goal_id not in known:
                self._unreported[goal_id] = None
                received = self._senders.received_bytes(goal)
                report = threading.Thread(target=self._report, args=(goal_id, client, received), daemon=True)
                self._reports.add(report)
                report.start()
            super().internal_goal_callback(goal)

    def _report(self, goal_id: str, client: str, received: int) -> None:
        self._senders.wait(client, received)
        with self.lock:
            ended = self._unreported.pop(goal_id)
            if ended is not None:
                self.publish_result(*ended)
            else:
                self.publish_status()
        self._reports.discard(threading.current_thread())

    def publish_result(self, status: Any, result: Any) -> None:
        with self.lock:
            if status.goal_id.id in self._unreported:
                self._unreported[status.goal_id.id] = status, result
                return
            try:
                super().publish_result(status, result)
            except rospy.ROSException:
                if not going_down():
                    raise
            self._last_result_s = time.monotonic()

    def stop(self) -> None:
        """Stops the server once every result has been published."""
        for report in list(self._reports):
            report.join()
        time.sleep(max(0.0, self._last_result_s + CLOSING_DELAY_S - time.monotonic()))
        super().stop()

    def publish_status(self) -> None:
        """Publishes the goal status, later if a goal is not reported yet.

        A client that cancels an unreported goal would mistake a status without the goal for the loss of the goal.
        """
        with self.lock:
            now_s = time.monotonic()
            if self._unreported and now_s < self._last_status_s + MAX_STATUS_PAUSE_S:
                return
            self._last_status_s = now_s
            items, self.status_list = self.status_list, []
            unreported: list[Any] = []
            for item in items:
                (unreported if item.status.goal_id.id in self._unreported else self.status_list).append(item)
            try:
                super().publish_status()
            except rospy.ROSException:
                if not going_down():
                    raise
            finally:
                self.status_list += unreported


class SteadySimpleActionServer(SimpleActionServer):
    """actionlib's SimpleActionServer on a `SteadyActionServer`; call `start` to start it.

    Args:
        name: Name of the action.
        action: Type of the action.
        execute: Function called with each goal, in a thread of the server.
    """

    def __init__(self, name: str, action: Any, execute: Callable[[Any], None]) -> None:
        super().__init__(name, action, execute_cb=execute, auto_start=False)
        self.action_server = SteadyActionServer(
            name, action, self.internal_goal_callback, self.internal_preempt_callback, auto_start=False
        )
