# SPDX-License-Identifier: BSD-3-Clause
"""Keeps a control loop at its rate in real time, and counts how late its cycles begin and how long they take.

A system that was not made for real time takes a processor away for milliseconds now and then: for work of its kernel
that nothing may interrupt, or, as the guest of another, for that one's work. A thread that sleeps there is woken only
afterwards. So the loop has a stand-in, the same loop on another processor: it looks a moment after each cycle was due,
and runs it where nobody else has begun.
"""
from __future__ import annotations

import os
import threading
import time
from array import array
from collections.abc import Callable
from dataclasses import dataclass

RESOLUTION_S = 5e-6
STAND_IN_SHARE = 1.0 / 8.0
"""How much later than the loop itself its stand-in looks for each cycle, as a share of the period."""
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
    """Runs cycles at fixed times: what one cycle takes longer, the next one waits less.

    One that is overdue by a period or more is left out.

    Args:
        period_s: time between two cycles [s].
        processors: of the loop and of its stand-in, which are bound to them while they run; without them there is no
            stand-in, and the loop runs wherever the system lets it.
        clock: real time that never jumps [s].
        sleep: waits for some time [s].
    """

    def __init__(self, period_s: float, processors: tuple[int, int] | None = None,
                 clock: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep) -> None:
        self._period_s = period_s
        self._processors = processors
        self._clock = clock
        self._sleep = sleep
        self._turn = threading.Lock()
        self._due_s = 0.0
        self._running = False
        self._error: BaseException | None = None

    def run(self, cycle: Callable[[float, int], bool]) -> None:
        """Run cycles until one answers False; the first one begins at once.

        Args:
            cycle: is told how late it begins [s] and how many were left out before it. Without a stand-in the calling
                thread runs all; with one, either of two threads runs each, never both at a time. What is started in a
                cycle inherits the processor it runs on, and its priority.

        Raises:
            BaseException: what a cycle raised.
            OSError: a processor is not there.
        """
        self._due_s = self._clock()
        self._running, self._error = True, None
        if self._processors is None:
            self._keep(cycle, 0.0)
        else:
            self._run_with_stand_in(cycle, *self._processors)
        if self._error is not None:
            raise self._error

    def _run_with_stand_in(self, cycle: Callable[[float, int], bool], own: int, other: int) -> None:
        allowed = os.sched_getaffinity(0)
        stand_in = threading.Thread(target=self._keep, args=(cycle, self._period_s * STAND_IN_SHARE), name="stand_in",
                                    daemon=True)
        try:
            os.sched_setaffinity(0, {other})
            stand_in.start()    # on the processor that its starter is bound to
            os.sched_setaffinity(0, {own})
            self._keep(cycle, 0.0)
        finally:
            with self._turn:    # the answer of a cycle under way must not have the last word
                self._running = False
            if stand_in.ident is not None:
                stand_in.join()
            os.sched_setaffinity(0, allowed)

    def _keep(self, cycle: Callable[[float, int], bool], later_s: float) -> None:
        """Look for each cycle `later_s` [s] after it was due, and run it where nobody has begun it."""
        while self._running:
            due_s = self._due_s
            left_s = due_s + later_s - self._clock()
            if left_s > 0.0:
                self._sleep(left_s)
            if due_s != self._due_s:
                continue
            with self._turn:
                if due_s == self._due_s and self._running:
                    self._begin(cycle)

    def _begin(self, cycle: Callable[[float, int], bool]) -> None:
        late_s = self._clock() - self._due_s
        missed = int(late_s / self._period_s) if late_s > 0.0 else 0
        self._due_s += (1 + missed) * self._period_s
        try:
            self._running = cycle(late_s, missed)
        except BaseException as error:  # run() raises it, whichever thread met it
            self._running, self._error = False, error
