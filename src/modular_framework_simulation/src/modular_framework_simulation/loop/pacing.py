# SPDX-License-Identifier: BSD-3-Clause
"""Keeps simulated time in step with real time, and measures how well that works."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

_LARGEST_DEBT_S = 1.0
"""Longest lag that is caught up [s]; after a longer stall (a suspended machine) the rest is dropped."""

_LEAD_S, _CALM_LEAD_S = 0.008, 0.018
"""How far simulated time runs ahead before the loop sleeps, and how far while the robot stands still [s]: steps that
follow each other find their data in the processor's caches, so that five steps of 2 ms and one sleep cost less than
five of each."""

_STILL_FACTOR = 4.0
"""Factor of "as fast as possible" while the robot stands still and nothing is commanded: then nodes compute, and every
message of the simulation takes processor time from them. The shipped pick takes 24 s of processor time with 4, 32 s
with 10, 56 s without a bound."""


@dataclass(frozen=True, slots=True)
class PaceReport:
    """Figures of the simulation since the last report.

    Attributes:
        factor: Simulated time over real time.
        busy_share: Share of the real time that the loop did not sleep.
        step_cost_s: Mean real time a step took, sleep left out [s].
    """

    factor: float
    busy_share: float
    step_cost_s: float


class Pacer:
    """Sleeps as long as simulated time is ahead of real time.

    Simulated time is at most 8 ms ahead, 18 ms while the robot stands still. A loop that fell behind runs without sleep
    until it has caught up, so that the average keeps the requested factor.

    Args:
        real_time_factor: Simulated over real time; 0 is as fast as possible.
        clock: Real time [s].
        sleep: Waits [s].
        idle_limit: Largest factor while nobody waits for simulated time; None: any.
    """

    def __init__(
        self,
        real_time_factor: float,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
        idle_limit: float | None = None,
    ) -> None:
        self._idle_limit = idle_limit
        self.real_time_factor = self._initial_factor = real_time_factor
        self._factor = real_time_factor
        self.set_factor(real_time_factor)
        self._clock = clock
        self._sleep = sleep
        self._start_real_s = 0.0
        self._start_simulated_s = 0.0
        self._report_real_s = 0.0
        self._report_simulated_s = 0.0
        self._slept_s = 0.0
        self._steps = 0
        self.start(0.0)

    def set_factor(self, real_time_factor: float) -> None:
        """Keeps another factor from now on.

        Args:
            real_time_factor: Simulated over real time; 0 is as fast as possible.

        Raises:
            ValueError: It is negative or not finite.
        """
        if not 0 <= real_time_factor < math.inf:
            raise ValueError(f"real_time_factor is {real_time_factor:g}; allowed: 0 (as fast as possible) or greater")
        self.real_time_factor = real_time_factor
        limit = self._idle_limit
        self._idle_factor = real_time_factor if limit is None else min(real_time_factor or limit, limit)

    def reset_factor(self) -> None:
        """Keeps the factor of the beginning again."""
        self.set_factor(self._initial_factor)

    def start(self, simulated_s: float) -> None:
        """Restarts, after a pause or a reset of time.

        Args:
            simulated_s: Present simulated time [s].
        """
        now = self._clock()
        self._start_real_s = self._report_real_s = now
        self._start_simulated_s = self._report_simulated_s = simulated_s
        self._slept_s = 0.0
        self._steps = 0

    def keep(self, simulated_s: float, idle: bool = False, calm: bool = False, still: bool = False) -> None:
        """Waits until real time has come as far as simulated time [s].

        Args:
            simulated_s: Present simulated time [s].
            idle: Whether nobody waits for it.
            calm: Whether the robot stands still and nothing is commanded, or there is none.
            still: Whether there is a robot that stands still, nothing is commanded, and nobody holds time.
        """
        factor = self._idle_factor if idle else self.real_time_factor
        if factor == 0.0 and still:
            factor = _STILL_FACTOR
        if self._factor != factor:
            self._factor = factor
            self.start(simulated_s)
        self._steps += 1
        if self._factor == 0.0:
            return
        due = self._start_real_s + (simulated_s - self._start_simulated_s) / self._factor
        now = self._clock()
        ahead = due - now
        if ahead > (_CALM_LEAD_S if calm else _LEAD_S):
            self._sleep(ahead)
            self._slept_s += self._clock() - now
        elif ahead < -_LARGEST_DEBT_S:
            self._start_real_s -= ahead + _LARGEST_DEBT_S

    def report(self, simulated_s: float) -> PaceReport:
        """Returns the figures since the last report, and resets them."""
        now = self._clock()
        real = max(now - self._report_real_s, 1e-9)
        busy = max(real - self._slept_s, 0.0)
        report = PaceReport((simulated_s - self._report_simulated_s) / real, busy / real, busy / max(self._steps, 1))
        self._report_real_s, self._report_simulated_s = now, simulated_s
        self._slept_s = 0.0
        self._steps = 0
        return report
