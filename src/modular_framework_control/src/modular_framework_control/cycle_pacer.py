# SPDX-License-Identifier: BSD-3-Clause
"""Keeps a control loop at its rate in real time, and counts how late its cycles begin and how long they take."""
from __future__ import annotations

import time
from array import array
from collections.abc import Callable
from dataclasses import dataclass

RESOLUTION_S = 5e-6
_BUCKETS = 4000


@dataclass(frozen=True, slots=True)
class LoopFigures:
    """How a control loop keeps its time, since the figures were begun.

    Attributes:
        cycles: cycles that were run.
        missed: cycles that were left out because an earlier one, or the system, took their time.
        overruns: cycles whose work took longer than the period.
        late_p50_s: half of the cycles began less late than this [s]; a multiple of RESOLUTION_S.
        late_p99_s: 99 % did [s].
        late_max_s: none began later [s].
        work_mean_s: mean time of the work of a cycle [s].
        work_max_s: longest work of a cycle [s].
    """

    cycles: int
    missed: int
    overruns: int
    late_p50_s: float
    late_p99_s: float
    late_max_s: float
    work_mean_s: float
    work_max_s: float


class LoopStatistics:
    """Figures of a loop in memory of fixed size; written by the loop, read by any thread.

    Args:
        period_s: how long a cycle may take [s].
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self.reset()

    def reset(self) -> None:
        """Begin anew."""
        self._late = array("L", bytes(array("L").itemsize * (_BUCKETS + 1)))
        self._cycles = self._missed = self._overruns = 0
        self._late_max_s = self._work_s = self._work_max_s = 0.0

    def add(self, late_s: float, missed: int, work_s: float) -> None:
        """Count one cycle.

        Args:
            late_s: how long after it was due it began [s].
            missed: cycles left out before it.
            work_s: how long its work took [s].
        """
        self._cycles += 1
        self._missed += missed
        bucket = int(late_s / RESOLUTION_S)
        self._late[bucket if 0 <= bucket < _BUCKETS else _BUCKETS if bucket > 0 else 0] += 1
        if late_s > self._late_max_s:
            self._late_max_s = late_s
        self._work_s += work_s
        if work_s > self._work_max_s:
            self._work_max_s = work_s
        if work_s > self._period_s:
            self._overruns += 1

    def figures(self) -> LoopFigures:
        """The figures so far."""
        mean_s = self._work_s / self._cycles if self._cycles else 0.0
        return LoopFigures(self._cycles, self._missed, self._overruns, self._percentile(0.5), self._percentile(0.99),
                           self._late_max_s, mean_s, self._work_max_s)

    def _percentile(self, share: float) -> float:
        counted, wanted = 0, share * sum(self._late)
        for bucket, count in enumerate(self._late):
            counted += count
            if counted >= wanted:
                return min((bucket + 1) * RESOLUTION_S, self._late_max_s) if bucket < _BUCKETS else self._late_max_s
        return 0.0


class CyclePacer:
    """Waits for the beginning of each cycle, at fixed times: what one cycle takes longer, the next one waits less.

    Args:
        period_s: time between two cycles [s].
        clock: real time that never jumps [s].
        sleep: waits for some time [s].
    """

    def __init__(self, period_s: float, clock: Callable[[], float] = time.monotonic,
                 sleep: Callable[[float], None] = time.sleep) -> None:
        self._period_s = period_s
        self._clock = clock
        self._sleep = sleep
        self._due_s = clock()

    def wait(self) -> tuple[float, int]:
        """Wait until the next cycle is due; one that is overdue by a period or more is left out.

        Returns:
            How late the cycle begins [s], and how many were left out before it.
        """
        self._due_s += self._period_s
        left_s = self._due_s - self._clock()
        if left_s > 0.0:
            self._sleep(left_s)
        late_s = self._clock() - self._due_s
        missed = int(late_s / self._period_s) if late_s > 0.0 else 0
        self._due_s += missed * self._period_s
        return late_s, missed
