# SPDX-License-Identifier: BSD-3-Clause
"""A limit on waiting, by a clock that a loaded machine slows down together with the simulated world."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class WaitLimit:
    """Counts the time of the ROS clock since it was first asked.

    Attributes:
        since_s: Time of the first question [s]; None before it.
    """

    since_s: float | None = None

    def is_exceeded(self, now_s: float, limit_s: float) -> bool:
        """Returns whether the wait has lasted longer than allowed.

        Args:
            now_s: Time of the ROS clock [s]; 0 as long as a simulation has not started it.
            limit_s: Longest wait [s].
        """
        if now_s <= 0.0:
            return False
        if self.since_s is None or now_s < self.since_s:  # a simulation that was reset begins at 0 again
            self.since_s = now_s
        return now_s - self.since_s > limit_s
