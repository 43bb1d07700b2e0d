# SPDX-License-Identifier: BSD-3-Clause
"""Statistics of a controller's update times and overruns."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class StatisticsSnapshot:
    """Update times since the last start of the controller.

    Attributes:
        updated_at_s: Loop time of the last update.
        max_s: Maximum update time.
        mean_s: Mean update time.
        variance_s2: Variance of update times [s^2].
        overruns: Number of cycles whose deadline passed during this controller's update.
        last_overrun_s: Loop time of the last overrun; 0 for none.
    """

    updated_at_s: float
    max_s: float
    mean_s: float
    variance_s2: float
    overruns: int
    last_overrun_s: float


class UpdateStatistics:
    """Running statistics of one controller, written by the control loop without lasting allocations."""

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
        """Adds one update (mean and variance by Welford's recurrence).

        Args:
            time_s: Loop time.
            duration_s: Duration of the update [s of wall time].
            overrun: Whether the cycle's deadline passed during the update.
        """
        self._count += 1
        self._updated_at_s = time_s
        deviation_s = duration_s - self._mean_s
        self._mean_s += deviation_s / self._count
        self._squares += deviation_s * (duration_s - self._mean_s)
        if duration_s > self._max_s:
            self._max_s = duration_s
        if overrun:
            self._overruns += 1
            self._last_overrun_s = time_s

    def snapshot(self) -> StatisticsSnapshot:
        """Returns the current figures, from any thread."""
        variance_s2 = self._squares / self._count if self._count else 0.0
        return StatisticsSnapshot(
            self._updated_at_s, self._max_s, self._mean_s, variance_s2, self._overruns, self._last_overrun_s
        )
