# SPDX-License-Identifier: BSD-3-Clause
"""Keeps a control loop at its rate in real time, and counts how late its cycles begin and how long they take.

A system without real-time scheduling now and then takes the processor away for milliseconds: for work of its kernel
that nothing may interrupt or, in a virtual machine, for other machines on the same host. A loop that sleeps there is
woken only afterwards. The figures say how long that was, apart from the time that cycles themselves took too long.
"""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable
from dataclasses import dataclass

RESOLUTION_S = 5e-6
NO_PROCESSOR_S = 1e-3
"""A loop that wakes up later than this had no processor, or another thread held Python's interpreter [s]."""
_BUCKETS = 4000


@dataclass(frozen=True, slots=True)
class LoopFigures:
    """How well a control loop keeps its rate, since the last reset.

    Attributes:
        cycles: cycles that were run.
        missed: cycles that were left out because an earlier one, or the system, took their time.
        overruns: cycles whose work took longer than the period.
        late_p50_s: half of the cycles began less late than this [s]; a multiple of RESOLUTION_S.
        late_p99_s: 99 % did [s].
        late_max_s: none began later [s].
        work_mean_s: mean time of the work of a cycle [s].
        work_max_s: longest work of a cycle [s].
        no_processor_s: total time that the loop was due and had no processor [s].
        no_processor_max_s: the longest such time [s].
    """

    cycles: int
    missed: int
    overruns: int
    late_p50_s: float
    late_p99_s: float
    late_max_s: float
    work_mean_s: float
    work_max_s: float
    no_processor_s: float
    no_processor_max_s: float


class LoopStatistics:
    """Figures of a loop in memory of fixed size; written by the loop, read by any thread.

    Args:
        period_s: how long a cycle may take [s].
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self.reset()

    def reset(self) -> None:
        """Sets all figures to 0."""
        self._late = array("L", bytes(array("L").itemsize * (_BUCKETS + 1)))
        self._cycles = self._missed = self._overruns = 0
        self._late_max_s = self._work_s = self._work_max_s = 0.0
        self._no_processor_s = self._no_processor_max_s = 0.0

    def add(self, late_s: float, missed: int, work_s: float, woken_late_s: float = 0.0) -> None:
        """Counts one cycle.

        Args:
            late_s: how much later than due it began [s].
            missed: cycles left out before it.
            work_s: how long its work took [s].
            woken_late_s: how much later than asked the loop was woken for it; 0 where it did not sleep [s].
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
        if woken_late_s > NO_PROCESSOR_S:
            self._no_processor_s += woken_late_s
            if woken_late_s > self._no_processor_max_s:
                self._no_processor_max_s = woken_late_s

    def figures(self) -> LoopFigures:
        """Returns the figures so far."""
        mean_s = self._work_s / self._cycles if self._cycles else 0.0
        return LoopFigures(
            self._cycles,
            self._missed,
            self._overruns,
            self._percentile(0.5),
            self._percentile(0.99),
            self._late_max_s,
            mean_s,
            self._work_max_s,
            self._no_processor_s,
            self._no_processor_max_s,
        )

    def _percentile(self, share: float) -> float:
        counted, wanted = 0, share * sum(self._late)
        for bucket, count in enumerate(self._late):
            counted += count
            if counted >= wanted:
                return min((bucket + 1) * RESOLUTION_S, self._late_max_s) if bucket < _BUCKETS else self._late_max_s
        return 0.0


class CyclePacer:
    """Runs cycles at fixed times: after a cycle that took longer, the loop sleeps less.

    One that is overdue by a period or more is left out.

    Args:
        period_s: time between two cycles [s].
        clock: real time that never jumps [s].
        sleep: waits for some time [s].

    Attributes:
        woken_late_s: how much later than asked the loop was woken for the present cycle, 0 where it did not sleep [s].
    """

    def __init__(
        self, period_s: float, clock: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        self.woken_late_s = 0.0
        self._period_s = period_s
        self._clock = clock
        self._sleep = sleep

    def run(self, cycle: Callable[[float, int], bool]) -> None:
        """Runs cycles until one returns False; the first one begins at once.

        Args:
            cycle: gets how late it begins [s] and how many were left out before it. A thread started in it inherits
                the priority of the loop.
        """
        due_s, goes_on = self._clock(), True
        while goes_on:
            left_s = due_s - self._clock()
            if left_s > 0.0:
                self._sleep(left_s)
            late_s = self._clock() - due_s
            self.woken_late_s = late_s if left_s > 0.0 else 0.0
            missed = int(late_s / self._period_s) if late_s > 0.0 else 0
            due_s += (1 + missed) * self._period_s
            goes_on = cycle(late_s, missed)
