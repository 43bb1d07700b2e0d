# SPDX-License-Identifier: BSD-3-Clause
"""Pacing of a control loop in real time, and statistics of its latency and cycle times.

A system without real-time scheduling occasionally takes the processor away for milliseconds, for kernel work or, in a
virtual machine, for other machines on the same host. A sleeping loop then wakes up late. The figures separate this
latency from overruns of the cycles themselves.
"""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable
from dataclasses import dataclass

RESOLUTION_S = 5e-6
NO_PROCESSOR_S = 1e-3
"""Minimum wake-up latency at which the loop counts as waiting for a processor or for Python's interpreter [s]."""
_BUCKETS = 4000


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopFigures:
    """Timing figures of a control loop since the last reset.

    Attributes:
        cycles: Number of executed cycles.
        missed: Number of skipped cycles.
        overruns: Number of cycles with work longer than the period.
        late_p50_s: Median delay of cycle starts, a multiple of RESOLUTION_S.
        late_p99_s: 99th percentile of delays.
        late_max_s: Maximum delay.
        work_mean_s: Mean work time of a cycle.
        work_max_s: Maximum work time of a cycle.
        no_processor_s: Total time that the loop was due without a processor.
        no_processor_max_s: Maximum time that the loop was due without a processor.
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
    """Timing statistics in constant memory, written by the loop and read by any thread.

    Args:
        period_s: Period of the loop.
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
            late_s: Delay of the cycle's start.
            missed: Number of cycles skipped before this cycle.
            work_s: Work time of the cycle.
            woken_late_s: Wake-up latency; 0 if the loop did not sleep.
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
        """Returns the current figures."""
        mean_s = self._work_s / self._cycles if self._cycles else 0.0
        return LoopFigures(
            cycles=self._cycles,
            missed=self._missed,
            overruns=self._overruns,
            late_p50_s=self._percentile(0.5),
            late_p99_s=self._percentile(0.99),
            late_max_s=self._late_max_s,
            work_mean_s=mean_s,
            work_max_s=self._work_max_s,
            no_processor_s=self._no_processor_s,
            no_processor_max_s=self._no_processor_max_s,
        )

    def _percentile(self, fraction: float) -> float:
        cumulative, target = 0, fraction * sum(self._late)
        for bucket, count in enumerate(self._late):
            cumulative += count
            if cumulative >= target:
                return min((bucket + 1) * RESOLUTION_S, self._late_max_s) if bucket < _BUCKETS else self._late_max_s
        return 0.0


class CyclePacer:
    """Runs cycles at fixed times; after a long cycle the loop sleeps less, and overdue cycles are skipped.

    Args:
        period_s: Period of the cycles.
        clock: Monotonic clock [s].
        sleep: Function that waits for a time [s].

    Attributes:
        woken_late_s: Wake-up latency of the current cycle; 0 if the loop did not sleep.
    """

    def __init__(
        self, period_s: float, clock: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        self.woken_late_s = 0.0
        self._period_s = period_s
        self._clock = clock
        self._sleep = sleep

    def run(self, cycle: Callable[[float, int], bool]) -> None:
        """Runs cycles until a cycle returns False; the first cycle starts at once.

        Args:
            cycle: Function called with the delay of its start [s] and the number of skipped cycles. Threads started in
                a cycle inherit the priority of the loop.
        """
        due_s, continues = self._clock(), True
        while continues:
            remaining_s = due_s - self._clock()
            if remaining_s > 0.0:
                self._sleep(remaining_s)
            late_s = self._clock() - due_s
            self.woken_late_s = late_s if remaining_s > 0.0 else 0.0
            missed = int(late_s / self._period_s) if late_s > 0.0 else 0
            due_s += (1 + missed) * self._period_s
            continues = cycle(late_s, missed)
