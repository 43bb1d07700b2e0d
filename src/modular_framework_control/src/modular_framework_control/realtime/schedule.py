# SPDX-License-Identifier: BSD-3-Clause
"""Schedule of periodic work on the clock of the control loop."""

from __future__ import annotations

import math

TIME_TOLERANCE_S = 1e-6
"""Tolerance of time comparisons [s], because sums of periods are inexact."""


class Schedule:
    """Deadlines at a fixed rate; missed deadlines are skipped.

    Args:
        rate: Rate of the deadlines [1/s]; 0 for none.
    """

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._period_s = 1.0 / rate if rate > 0.0 else math.inf
        self._next_s = math.inf

    def start(self, time_s: float) -> None:
        """Sets the first deadline to `time_s`."""
        self._next_s = time_s if self._period_s < math.inf else math.inf

    def take_if_due(self, time_s: float) -> bool:
        """Returns whether a deadline has passed at `time_s`; if so, the next deadline is one period later."""
        if time_s < self._next_s - TIME_TOLERANCE_S:
            return False
        following_s = self._next_s + self._period_s
        self._next_s = following_s if following_s > time_s + TIME_TOLERANCE_S else time_s + self._period_s
        return True
