# SPDX-License-Identifier: BSD-3-Clause
"""When something that is done at a fixed rate is due, counted in the time of the control loop."""

from __future__ import annotations

import math

SAME_TIME_S = 1e-6
"""Times that differ by less are the same [s]: sums of periods are not exact."""


class Schedule:
    """Turns at a fixed rate; missed ones are not made up for.

    Args:
        rate: of the turns [1/s]; 0 means never.
    """

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._period_s = 1.0 / rate if rate > 0.0 else math.inf
        self._next_s = math.inf

    def start(self, time_s: float) -> None:
        """Makes the first turn due at `time_s` [s]."""
        self._next_s = time_s if self._period_s < math.inf else math.inf

    def take_turn(self, time_s: float) -> bool:
        """Returns whether a turn is due at `time_s` [s]; if so it is taken, and the next one is due a period later."""
        if time_s < self._next_s - SAME_TIME_S:
            return False
        following_s = self._next_s + self._period_s
        self._next_s = following_s if following_s > time_s + SAME_TIME_S else time_s + self._period_s
        return True
