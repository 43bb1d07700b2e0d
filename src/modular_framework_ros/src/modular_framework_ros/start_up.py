# SPDX-License-Identifier: BSD-3-Clause
"""Waits at startup for other nodes, long enough for a slow machine, and logs the progress."""

from __future__ import annotations

import time
from collections.abc import Callable

import rospy

from modular_framework_ros.connections.ros_frozen_nodes import WATCHED_AFTER_S, frozen_nodes
from modular_framework_ros.declared_parameters import DeclaredParameters

START_TIMEOUT_PARAMETER = "/start_timeout"
REPORT_PERIOD_S = 10.0
POLL_PERIOD_S = 0.05


def start_timeout() -> float:
    """Returns the maximum wait for another node at startup [s of real time]: the parameter ``/start_timeout``.

    A required node that dies ends the launch, so the timeout only matters for nodes that were never started.
    """
    return float(DeclaredParameters("modular_framework_ros", "launch").value_or_default(START_TIMEOUT_PARAMETER))


class WaitReport:
    """Logs a long wait every ten seconds, and frozen nodes at once.

    Args:
        awaited: Name of the missing item, or a function that returns it.
        timeout_s: Maximum wait [s].
    """

    def __init__(self, awaited: str | Callable[[], str], timeout_s: float) -> None:
        self._awaited, self._timeout_s = awaited, timeout_s
        self._started_s = self._reported_s = time.monotonic()
        self._frozen = ""

    def remind(self) -> None:
        """Logs the wait if ten seconds have passed since the last message, or if a node was found to be frozen."""
        now_s = time.monotonic()
        frozen = frozen_nodes() if now_s - self._started_s > WATCHED_AFTER_S else ""
        if now_s - self._reported_s >= REPORT_PERIOD_S or frozen != self._frozen:
            self._reported_s, self._frozen = now_s, frozen
            awaited = self._awaited if isinstance(self._awaited, str) else self._awaited()
            rospy.logwarn(
                "still waiting for %s after %.0f s (of %.0f s at most)%s",
                awaited,
                now_s - self._started_s,
                self._timeout_s,
                f"; {frozen}" if frozen else "",
            )


def wait_for_start(
    condition: Callable[[], bool], awaited: str | Callable[[], str], timeout_s: float | None = None
) -> bool:
    """Waits for a condition that another node fulfils.

    Args:
        condition: Function that returns whether the condition is met.
        awaited: Name of the missing item, or a function that returns it.
        timeout_s: Maximum wait [s of real time]; None for the parameter ``/start_timeout``.

    Returns:
        Whether the condition was met in time; False as well if ROS shuts down.
    """
    limit_s = start_timeout() if timeout_s is None else timeout_s
    report, end_s = WaitReport(awaited, limit_s), time.monotonic() + limit_s
    while not condition():
        if rospy.is_shutdown() or time.monotonic() >= end_s:
            return False
        report.remind()
        time.sleep(POLL_PERIOD_S)
    return True
