# SPDX-License-Identifier: BSD-3-Clause
"""The time of a control loop on a real robot, which nobody who sets the clock of the system can disturb.

Taken from that clock, the time of a loop would go back when it is set back, and controllers would begin anew; set
forward, it would carry trajectories to their end in one cycle. So the loop counts on the monotonic clock. Only the
stamps of messages follow the system's, by which all other programs count.

A loop that is held up, as by a computer that does something else for a while, has not moved the robot meanwhile. Its
time then stands still: what was to be done goes on later, and is not caught up with at once.
"""
from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable

NOTICED_STEP_S = 1e-3
WARN_THRESHOLD_S = 0.1
QUICK_S = 5e-4
"""A reading of both clocks that took longer says too little about how far they are apart [s]."""

LOGGER = logging.getLogger("rosout.control_loop")


class LoopTime:
    """Time that begins as that of the system's clock, and from then on goes on steadily, as long as it is asked for.

    Args:
        system: clock that may be set by anybody [s].
        steady: clock that never jumps [s].

    Attributes:
        ahead_s: by how much the system's clock is ahead of this time [s]; changes when it is set. Time of the loop and
            stamps of messages differ by it.
        longest_step_s: how far it goes on at most from one look to the next [s].
    """

    def __init__(self, system: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic) -> None:
        self._system = system
        self._steady = steady
        self._began_s = system() - steady()
        self._last_s = math.inf
        self.ahead_s = 0.0
        self.longest_step_s = math.inf

    def now(self) -> float:
        """The time now [s]; looks whether the system's clock was set meanwhile."""
        steady_s = self._steady()
        system_s = self._system()
        held_up_s = steady_s - self._last_s - self.longest_step_s
        self._last_s = steady_s
        if held_up_s > 0.0:
            self._began_s -= held_up_s
            self.ahead_s += held_up_s
            LOGGER.warning("the control loop was held up for %.3f s: motions go on as much later",
                           held_up_s + self.longest_step_s)
        time_s = self._began_s + steady_s
        ahead_s = system_s - time_s
        if abs(ahead_s - self.ahead_s) > NOTICED_STEP_S and self._steady() - steady_s < QUICK_S:
            step_s, self.ahead_s = ahead_s - self.ahead_s, ahead_s
            if abs(step_s) > WARN_THRESHOLD_S:
                LOGGER.warning("the clock of the system was set by %+.3f s: motions go on as if it had not been, the "
                               "stamps of messages follow it", step_s)
        return time_s
