# SPDX-License-Identifier: BSD-3-Clause
"""How long the updates of a controller take, and how often they make the control loop late."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class StatisticsSnapshot:
    """Figures since the controller was started last.

    Attributes:
        updated_at_s: time of the loop at the last update [s].
        max_s: longest update [s].
        mean_s: mean update [s].
        variance_s2: variance of the updates [s^2].
        overruns: cycles whose time ran out while this controller was updated.
        last_overrun_s: time of the loop at the last of these [s]; 0 when there was none.
    """

    updated_at_s: float
    max_s: float
    mean_s: float
    variance_s2: float
    overruns: int
    last_overrun_s: float


class UpdateStatistics:
    """Running figures of one controller; written by the control loop, without allocating anything that stays."""

    __slots__ = ("_count", "_mean_s", "_squares", "_max_s", "_updated_at_s", "_overruns", "_last_overrun_s")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Sets all statistics to their initial values."""
        self._count = 0
        self._mean_s = self._squares = self._max_s = 0.0
        self._updated_at_s = self._last_overrun_s = 0.0
        self._overruns = 0

    def add(self, time_s: float, duration_s: float, overrun: bool) -> None:
        """Counts one update (mean and variance by Welford's recurrence).

        Args:
            time_s: time of the loop [s].
            duration_s: how long the update took [s of real time].
            overrun: whether the time of the cycle ran out in it.
        """
        self._count += 1
        self._updated_at_s = time_s
        away = duration_s - self._mean_s
        self._mean_s += away / self._count
        self._squares += away * (duration_s - self._mean_s)
        if duration_s > self._max_s:
            self._max_s = duration_s
        if overrun:
            self._overruns += 1
            self._last_overrun_s = time_s

    def snapshot(self) -> StatisticsSnapshot:
        """The figures so far; may be asked from any thread."""
        variance_s2 = self._squares / self._count if self._count else 0.0
        return StatisticsSnapshot(
            self._updated_at_s, self._max_s, self._mean_s, variance_s2, self._overruns, self._last_overrun_s
        )
