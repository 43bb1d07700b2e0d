# SPDX-License-Identifier: BSD-3-Clause
"""Time limits of states: ROS time limits the duration of work, wall time the wait for other nodes.

A paused simulation stops ROS time and the work, but not the wait for a missing node.
"""

from __future__ import annotations

import time

import rospy

import smach

__all__ = ["POLL_PERIOD_S", "RosTimeLimit", "WallTimeLimit", "going_down", "seconds"]

POLL_PERIOD_S = 0.02
"""Polling period of a waiting state [s]."""


def seconds(label: str, duration: object) -> float | None:
    """Returns a duration in seconds; None (no limit) stays None.

    Args:
        label: Name of the argument in the error.
        duration: ``rospy.Duration`` or number [s].

    Raises:
        smach.InvalidStateError: The duration has a wrong type or is negative.
    """
    if duration is None:
        return None
    if isinstance(duration, (rospy.Duration, int, float)) and not isinstance(duration, bool):
        value = duration.to_sec() if isinstance(duration, rospy.Duration) else float(duration)
        if value >= 0.0:
            return value
    raise smach.InvalidStateError(f"{label} must be a rospy.Duration of at least 0 s, or None; got {duration!r}")


def going_down() -> bool:
    """Returns whether the process or the machine is shutting down."""
    return rospy.is_shutdown() or smach.is_shutdown()


class RosTimeLimit:
    """A limit in ROS time; a clock that jumps back restarts it."""

    def __init__(self, limit_s: float | None) -> None:
        """Starts the limit [s]; None for no limit."""
        self._limit_s = limit_s
        self._start = rospy.get_time() if limit_s is not None else 0.0

    def over(self) -> bool:
        """Returns whether the time is over."""
        if self._limit_s is None:
            return False
        now = rospy.get_time()
        self._start = min(self._start, now)
        return now - self._start >= self._limit_s


class WallTimeLimit:
    """A limit in wall time."""

    def __init__(self, limit_s: float | None) -> None:
        """Starts the limit [s]; None for no limit."""
        self._end = None if limit_s is None else time.monotonic() + limit_s

    def over(self) -> bool:
        """Returns whether the time is over."""
        return self._end is not None and time.monotonic() >= self._end
