# SPDX-License-Identifier: BSD-3-Clause
"""Durations and collision check counts of the planning phases."""

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
from modular_framework_ros.reported_figures import Figure

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
    """Sums the durations and collision checks per phase; a nested phase does not count for its enclosing phase.

    Attributes:
        run: Resolved pipeline and planner.
        figures: Figures that the planner reports.
        remote_processor_s: Processor time of other processes [s].

    Args:
        processor_clock: Returns the processor time of the planning thread or process [s].
    """

    def __init__(self, processor_clock: Callable[[], float] = time.thread_time) -> None:
        self._processor_clock, self._processor_start_s = processor_clock, processor_clock()
        self.seconds: dict[str, float] = {}
        self._checks: dict[str, NDArray[np.int64]] = {}
        self._checker: CountsChecks | None = None
        self._counts = np.zeros(CHECK_COUNTS, np.int64)  # the checker updates this object in place
        self.run: PlannerRun | None = None
        self.figures: dict[Figure, float] = {}
        self.remote_processor_s = 0.0
        self._nested_s = [0.0]  # total time of the nested phases, per open phase
        self._nested_checks = [np.zeros(CHECK_COUNTS, np.int64)]

    def record_implementation(self, implementation: str) -> None:
        """Records the implementation of the search; later calls, for path repair, are ignored."""
        if self.run is not None and not self.run.implementation:
            self.run = replace(self.run, implementation=implementation)

    def record_sources(self, sources: str) -> None:
        """Records the SHA-256 of the sources in the planner's own process; empty if the process does not report it."""
        if self.run is not None:
            self.run = replace(self.run, sources=sources)

    def watch(self, checker: CollisionChecker) -> None:
        """Uses the past and future counts of a new checker, if it counts checks."""
        if isinstance(checker, CountsChecks):
            self._checker, self._counts = checker, checker.check_counts

    @contextmanager
    def measure(self, phase: str) -> Iterator[None]:
        """Adds the time and the checks of the block to a phase, even if the block raises an exception."""
        start_s, before = time.monotonic(), self._counts.copy()
        self._nested_s.append(0.0)
        self._nested_checks.append(np.zeros(CHECK_COUNTS, np.int64))
        try:
            yield
        finally:
            elapsed_s, checks = time.monotonic() - start_s, self._counts - before
            self.seconds[phase] = self.seconds.get(phase, 0.0) + elapsed_s - self._nested_s.pop()
            self._checks[phase] = self._checks.get(phase, 0) + checks - self._nested_checks.pop()
            self._nested_s[-1] += elapsed_s
            self._nested_checks[-1] += checks

    def statistics(self) -> PlanStatistics:
        """Returns the statistics so far."""
        processor_s = self._processor_clock() - self._processor_start_s + self.remote_processor_s
        figures = dict(self.figures)
        if self._checker is None:
            return PlanStatistics(dict(self.seconds), run=self.run, processor_s=processor_s, figures=figures)
        counts = {}
        for phase, row in self._checks.items():
            checked, free, touching, states, exactly = row.tolist()
            if checked:
                undecided = checked - free - touching
                counts[phase] = CheckCounts(checked, free, touching, undecided, exactly, states)
        return PlanStatistics(
            dict(self.seconds), counts, self._checker.most_frequent_contact(), self.run, processor_s, figures
        )
