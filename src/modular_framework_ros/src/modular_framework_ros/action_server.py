# SPDX-License-Identifier: BSD-3-Clause
"""An action server that reports the end of every goal to its client, also of a goal that ends at once."""

from __future__ import annotations

import threading
import time
from typing import Any

import rospy
from actionlib import ActionServer

from modular_framework_ros.publishing import going_down

# actionlib's simple client never learns of an end that reaches it before its send_goal() has returned
EARLIEST_END_S = 0.05
CLOSING_DELAY_S = 0.15
"""For a result to get out: to close a topic drops what rospy's threads have still to write [s]."""


class _StatusTimer(threading.Thread):
    """Publishes the status of goals at a fixed rate of real time.

    rospy's timers wake at every message of /clock, and stop when time is held.

    Args:
        server: Whose goals.
        period_s: Real time between two messages [s].
    """

    def __init__(self, server: ActionServer, period_s: float) -> None:
        super().__init__(daemon=True, name=f"status of {server.ns}")
        self._server, self._period_s = server, period_s
        self._ended = threading.Event()

    def run(self) -> None:
        """Publishes until the end."""
        while not self._ended.wait(self._period_s) and not rospy.is_shutdown():
            self._server.publish_status_async(None)

    def shutdown(self) -> None:
        """Ends it; does not wait."""
        self._ended.set()


class SteadyActionServer(ActionServer):
    """An action server whose status topic does not depend on simulated time, and whose clients hear of every end.

    The result of a goal that ends at once is published EARLIEST_END_S after the goal arrived.
    """

    def initialize(self) -> None:
        self._arrival_s: dict[str, float] = {}
        self._last_result_s = -CLOSING_DELAY_S
        self._pending_results: set[threading.Timer] = set()
        super().initialize()
        timer: rospy.Timer | None = getattr(self, "status_timer", None)
        if timer is not None:
            timer.shutdown()
            self.status_timer = _StatusTimer(self, 1.0 / self.status_frequency)
            self.status_timer.start()

    def internal_goal_callback(self, goal: Any) -> None:
        self._arrival_s[goal.goal_id.id] = time.monotonic()
        super().internal_goal_callback(goal)

    def publish_result(self, status: Any, result: Any) -> None:
        early_s = self._arrival_s.pop(status.goal_id.id, 0.0) + EARLIEST_END_S - time.monotonic()
        if early_s <= 0.0:
            self._publish_result_now(status, result)
            return
        later = threading.Timer(early_s, self._publish_result_now, (status, result))  # the caller has other work to do
        later.daemon = True
        self._pending_results.add(later)
        later.start()

    def _publish_result_now(self, status: Any, result: Any) -> None:
        try:
            super().publish_result(status, result)
        except rospy.ROSException:
            if not going_down():
                raise
        self._last_result_s = time.monotonic()
        self._pending_results.discard(threading.current_thread())  # type: ignore[arg-type]

    def stop(self) -> None:
        """Stops serving, once every result has been published."""
        for later in list(self._pending_results):
            later.join()
        time.sleep(max(0.0, self._last_result_s + CLOSING_DELAY_S - time.monotonic()))
        super().stop()

    def publish_status(self) -> None:
        try:
            super().publish_status()
        except rospy.ROSException:
            if not going_down():
                raise
