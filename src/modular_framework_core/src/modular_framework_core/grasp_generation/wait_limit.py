# SPDX-License-Identifier: BSD-3-Clause
"""Timeout in the time of the ROS clock, which slows down with the simulation on a loaded machine."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class WaitLimit:
    """Timeout that starts at the first call of `is_exceeded`.

    Attributes:
        since_s: Time of the first call [s]; None before the first call.
    """

    since_s: float | None = None

    def is_exceeded(self, now_s: float, limit_s: float) -> bool:
        """Returns whether the timeout has elapsed.

        Args:
            now_s: Time of the ROS clock [s]; 0 before the start of the simulation.
            limit_s: Timeout [s].
        """
        if now_s <= 0.0:
            return False
        if self.since_s is None or now_s < self.since_s:  # reset of the simulation
            self.since_s = now_s
        return now_s - self.since_s > limit_s
