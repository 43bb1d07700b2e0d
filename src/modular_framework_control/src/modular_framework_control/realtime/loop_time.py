# SPDX-License-Identifier: BSD-3-Clause
"""The time of a control loop on a real robot, which does not depend on the setting of the system clock.

If the loop used the system clock, setting it back would restart the controllers, and setting it forward would carry
trajectories to their end in one cycle. So the loop uses the monotonic clock. Only the stamps of messages follow the
system clock, as those of all other programs do.

A loop that was delayed has not moved the robot meanwhile. Its time does not count the delay: motions continue later and
do not catch up at once.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable

NOTICED_STEP_S = 1e-3
WARN_THRESHOLD_S = 0.1
QUICK_S = 5e-4
"""If reading both clocks took longer than this, their difference is not known well enough [s]."""

LOGGER = logging.getLogger("rosout.control_loop")


class LoopTime:
    """Time that begins as the system clock and then increases steadily, as long as it is read.

    Args:
        system: clock that may be set at any time [s].
        steady: clock that never jumps [s].

    Attributes:
        ahead_s: how far the system clock is ahead of this time [s]; changes when it is set. Stamps of messages are
            ahead by it.
        longest_step_s: largest increase from one reading to the next [s].
    """

    def __init__(self, system: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic) -> None:
        self._system = system
        self._steady = steady
        self._began_s = system() - steady()
        self._last_s = math.inf
        self.ahead_s = 0.0
        self.longest_step_s = math.inf

    def now(self) -> float:
        """Returns the time now [s]; checks whether the system clock was set meanwhile."""
        steady_s = self._steady()
        system_s = self._system()
        held_up_s = steady_s - self._last_s - self.longest_step_s
        self._last_s = steady_s
        if held_up_s > 0.0:
            self._began_s -= held_up_s
            self.ahead_s += held_up_s
            LOGGER.warning(
                "the control loop was held up for %.3f s: motions go on as much later", held_up_s + self.longest_step_s
            )
        time_s = self._began_s + steady_s
        ahead_s = system_s - time_s
        if abs(ahead_s - self.ahead_s) > NOTICED_STEP_S and self._steady() - steady_s < QUICK_S:
            step_s, self.ahead_s = ahead_s - self.ahead_s, ahead_s
            if abs(step_s) > WARN_THRESHOLD_S:
                LOGGER.warning(
                    "the clock of the system was set by %+.3f s: motions go on as if it had not been, the "
                    "stamps of messages follow it",
                    step_s,
                )
        return time_s
