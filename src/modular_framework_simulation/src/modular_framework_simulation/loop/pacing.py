# SPDX-License-Identifier: BSD-3-Clause
"""Synchronizes simulated time with real time, and measures the pace."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import psutil

_MAX_LAG_S = 1.0
"""Maximum lag that is caught up [s]; after a longer stall, such as a suspended machine, the excess is dropped."""

_LEAD_S, _REST_LEAD_S = 0.008, 0.018
"""Lead of simulated time over real time before the loop sleeps, in general and while the robot is at rest [s].
Consecutive steps find their data in the CPU caches, so five steps of 2 ms and one sleep cost less than five steps with
five sleeps."""

_REST_PERIOD_S = 0.1
"""Interval at which the factor at rest follows the idle processors [s]."""

_MAX_REST_FACTOR = 1024.0
_IDLE_PROCESSORS, _BUSY_PROCESSORS = 0.5, 0.25
"""Number of idle processors above which the factor at rest doubles, and below which it halves."""


@dataclass(frozen=True, slots=True)
class PaceReport:
    """Pace of the simulation since the last report.

    Attributes:
        factor: Ratio of simulated time to real time.
        busy_fraction: Fraction of real time in which the loop did not sleep.
        step_cost_s: Mean real time of a step without sleep [s].
    """

    factor: float
    busy_fraction: float
    step_cost_s: float


class RestSpeed:
    """Chooses the real-time factor of "as fast as possible" while the robot is at rest without a command.

    Nodes compute during this time, and every message of the simulation costs them processor time. The factor starts at
    1, doubles while processors are idle, and halves while they are not.

    Args:
        idle_s: Function that returns the time for which processors have been idle, summed over all processors [s].
    """

    def __init__(self, idle_s: Callable[[], float] = lambda: psutil.cpu_times().idle) -> None:
        self._idle_s = idle_s
        self._factor = 1.0
        self._last_real_s = self._last_idle_s = math.nan

    def restart(self) -> None:
        """Sets the factor to 1, because the robot moves or its nodes start to compute."""
        self._factor, self._last_real_s = 1.0, math.nan

    def factor(self, real_s: float) -> float:
        """Returns the factor, a power of two.

        Args:
            real_s: Current real time [s].
        """
        if real_s - self._last_real_s < _REST_PERIOD_S:
            return self._factor
        idle_s = self._idle_s()
        idle_processors = (idle_s - self._last_idle_s) / (real_s - self._last_real_s)
        if idle_processors > _IDLE_PROCESSORS:
            self._factor = min(2.0 * self._factor, _MAX_REST_FACTOR)
        elif idle_processors < _BUSY_PROCESSORS:
            self._factor = max(0.5 * self._factor, 1.0)
        self._last_real_s, self._last_idle_s = real_s, idle_s
        return self._factor


class Pacer:
    """Sleeps while simulated time is ahead of real time.

    Simulated time is at most 8 ms ahead, or 18 ms while the robot is at rest. After a delay, the loop runs without
    sleep until it has caught up, so that the average pace equals the requested factor.

    Args:
        real_time_factor: Ratio of simulated to real time; 0 for as fast as possible.
        clock: Function that returns real time [s].
        sleep: Function that waits for a time [s].
        idle_limit: Maximum factor while no node waits for simulated time; None for no limit.
        rest_speed: Factor of "as fast as possible" while the robot is at rest.
    """

    def __init__(
        self,
        real_time_factor: float,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
        idle_limit: float | None = None,
        rest_speed: RestSpeed | None = None,
    ) -> None:
        self._rest_speed = rest_speed or RestSpeed()
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
        """Sets the real-time factor.

        Args:
            real_time_factor: Ratio of simulated to real time; 0 for as fast as possible.

        Raises:
            ValueError: The factor is negative or not finite.
        """
        if not 0 <= real_time_factor < math.inf:
            raise ValueError(f"real_time_factor is {real_time_factor:g}; allowed: 0 (as fast as possible) or greater")
        self.real_time_factor = real_time_factor
        limit = self._idle_limit
        self._idle_factor = real_time_factor if limit is None else min(real_time_factor or limit, limit)

    def reset_factor(self) -> None:
        """Restores the initial real-time factor."""
        self.set_factor(self._initial_factor)

    def start(self, simulated_s: float) -> None:
        """Restarts the pacing after a pause or a reset of time.

        Args:
            simulated_s: Current simulated time [s].
        """
        now = self._clock()
        self._start_real_s = self._report_real_s = now
        self._start_simulated_s = self._report_simulated_s = simulated_s
        self._slept_s = 0.0
        self._steps = 0

    def keep(self, simulated_s: float, idle: bool = False, calm: bool = False, still: bool = False) -> None:
        """Waits until real time has caught up with simulated time.

        Args:
            simulated_s: Current simulated time [s].
            idle: Whether no node waits for simulated time.
            calm: Whether the world has no robot, or the robot is at rest without a command.
            still: Whether the world has a robot that is at rest without a command, and no node holds time.
        """
        factor = self._idle_factor if idle else self.real_time_factor
        if factor == 0.0 and still:
            factor = self._rest_speed.factor(self._clock())
        else:
            self._rest_speed.restart()
        if self._factor != factor:
            self._factor = factor
            self.start(simulated_s)
        self._steps += 1
        if self._factor == 0.0:
            return
        due = self._start_real_s + (simulated_s - self._start_simulated_s) / self._factor
        now = self._clock()
        ahead = due - now
        if ahead > (_REST_LEAD_S if calm else _LEAD_S):
            self._sleep(ahead)
            self._slept_s += self._clock() - now
        elif ahead < -_MAX_LAG_S:
            self._start_real_s -= ahead + _MAX_LAG_S

    def report(self, simulated_s: float) -> PaceReport:
        """Returns the pace since the last report, and resets the measurement."""
        now = self._clock()
        real = max(now - self._report_real_s, 1e-9)
        busy = max(real - self._slept_s, 0.0)
        report = PaceReport((simulated_s - self._report_simulated_s) / real, busy / real, busy / max(self._steps, 1))
        self._report_real_s, self._report_simulated_s = now, simulated_s
        self._slept_s = 0.0
        self._steps = 0
        return report
