# SPDX-License-Identifier: BSD-3-Clause
"""The time of a control loop on a real robot, independent of changes of the system clock.

With the system clock, a step back would restart the controllers, and a step forward would finish trajectories in one
cycle. The loop therefore uses the monotonic clock; only the stamps of messages follow the system clock.

Delays of the loop do not count as time, so that motions continue later instead of catching up at once.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable

MIN_STEP_S = 1e-3
WARN_THRESHOLD_S = 0.1
MAX_READ_TIME_S = 5e-4
"""Maximum duration of reading both clocks for a valid difference [s]."""

LOGGER = logging.getLogger("rosout.control_loop")


class LoopTime:
    """Time that starts at the system clock's time and then increases steadily.

    Args:
        system: System clock, which may jump [s].
        steady: Monotonic clock [s].

    Attributes:
        ahead_s: Offset of the system clock, and of message stamps, relative to this time.
        max_step_s: Maximum increase between two readings.
    """

    def __init__(self, system: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic) -> None:
        self._system = system
        self._steady = steady
        self._offset_s = system() - steady()
        self._last_s = math.inf
        self.ahead_s = 0.0
        self.max_step_s = math.inf

    def now(self) -> float:
        """Returns the current time [s], and detects changes of the system clock."""
        steady_s = self._steady()
        system_s = self._system()
        delay_s = steady_s - self._last_s - self.max_step_s
        self._last_s = steady_s
        if delay_s > 0.0:
            self._offset_s -= delay_s
            self.ahead_s += delay_s
            LOGGER.warning("the control loop was held up for %.3f s: motions continue later", delay_s + self.max_step_s)
        time_s = self._offset_s + steady_s
        ahead_s = system_s - time_s
        if abs(ahead_s - self.ahead_s) > MIN_STEP_S and self._steady() - steady_s < MAX_READ_TIME_S:
            step_s, self.ahead_s = ahead_s - self.ahead_s, ahead_s
            if abs(step_s) > WARN_THRESHOLD_S:
                LOGGER.warning(
                    "the clock of the system was set by %+.3f s: motions are not affected, message stamps follow the "
                    "clock",
                    step_s,
                )
        return time_s
