# SPDX-License-Identifier: BSD-3-Clause
"""How long the parts of a plan took, and what they asked the collision checker."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_collision import CHECK_COUNTS
from modular_framework_planning.plan_statistics import CheckCounts, PlannerRun, PlanStatistics
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker, CountsChecks

SETUP, GOALS, SEARCH, REPAIR, SHORTENING, TIMING, CHECK = (
    "setup",
    "goals",
    "search",
    "repair",
    "shortening",
    "timing",
    "check",
)


class PhaseTimes:
    """Adds up the seconds and the collision checks of each part; a part inside another one counts for itself alone.

    Args:
        processor_clock: processor time of what plans [s]: of its thread, or of its process.
    """

    def __init__(self, processor_clock: Callable[[], float] = time.thread_time) -> None:
        self._processor_clock, self._processor_begun_s = processor_clock, processor_clock()
        self.seconds: dict[str, float] = {}
        self._checks: dict[str, NDArray[np.int64]] = {}
        self._checker: CountsChecks | None = None
        self._counts = np.zeros(CHECK_COUNTS, np.int64)  # of the checker; it counts on in this array
        self.run: PlannerRun | None = None
        self._inner = [0.0]  # time of the parts inside each open part
        self._inner_checks = [np.zeros(CHECK_COUNTS, np.int64)]

    def searched_by(self, implementation: str) -> None:
        """Notes who searches; what repairs the path later does not count."""
        if self.run is not None and not self.run.implementation:
            self.run = replace(self.run, implementation=implementation)

    def watch(self, checker: CollisionChecker) -> None:
        """Takes over what a new checker has counted, and what it will count; nothing where it does not count."""
        if isinstance(checker, CountsChecks):
            self._checker, self._counts = checker, checker.check_counts

    @contextmanager
    def measured(self, phase: str) -> Iterator[None]:
        """Adds the time and the checks of the block to a part, also where it raises an exception."""
        begun, before = time.monotonic(), self._counts.copy()
        self._inner.append(0.0)
        self._inner_checks.append(np.zeros(CHECK_COUNTS, np.int64))
        try:
            yield
        finally:
            spent, checks = time.monotonic() - begun, self._counts - before
            self.seconds[phase] = self.seconds.get(phase, 0.0) + spent - self._inner.pop()
            self._checks[phase] = self._checks.get(phase, 0) + checks - self._inner_checks.pop()
            self._inner[-1] += spent
            self._inner_checks[-1] += checks

    def statistics(self) -> PlanStatistics:
        """Returns what was measured until now."""
        processor_s = self._processor_clock() - self._processor_begun_s
        if self._checker is None:
            return PlanStatistics(dict(self.seconds), run=self.run, processor_s=processor_s)
        counts = {}
        for phase, row in self._checks.items():
            asked, free, touching, states, exactly = row.tolist()
            if asked:
                undecided = asked - free - touching
                counts[phase] = CheckCounts(asked, free, touching, undecided, exactly, states)
        return PlanStatistics(dict(self.seconds), counts, self._checker.most_refusals(), self.run, processor_s)
