# SPDX-License-Identifier: BSD-3-Clause
"""Applies a stopping rule after each trial of an experiment."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.results import ExperimentResults

if TYPE_CHECKING:  # the statistics take seconds to import
    from modular_framework_benchmark.statistics.stopping import StoppingRule

PAUSE_FACTOR = 10.0
"""Pause between interim analyses as a multiple of their duration, which bounds their cost."""


class TrialWatch:
    """Applies a stopping rule when all episodes of a trial have ended.

    Args:
        rule: Stopping rule; None to run all episodes.
        load: Function that loads the results so far.
        pending: Remaining episodes.
    """

    def __init__(
        self, rule: StoppingRule | None, load: Callable[[], ExperimentResults], pending: Iterable[EpisodeSpec]
    ) -> None:
        self._rule, self._load = rule, load
        self._remaining: dict[int, int] = {}
        for spec in pending:
            self._remaining[spec.trial] = self._remaining.get(spec.trial, 0) + 1
        self._is_due = rule is not None  # the results of an earlier run may already be sufficient
        self._next_time = 0.0

    def ended(self, spec: EpisodeSpec) -> None:
        """Counts an ended episode."""
        self._remaining[spec.trial] -= 1
        self._is_due = self._is_due or self._remaining[spec.trial] == 0

    def reason_to_stop(self) -> str:
        """Applies the rule if a trial has ended since the last call and the pause has passed.

        Returns:
            Reason to stop the experiment; "" to continue.
        """
        if self._rule is None or not self._is_due or time.monotonic() < self._next_time:
            return ""
        start = time.monotonic()
        decision = self._rule.decide(self._load())
        end = time.monotonic()
        self._is_due, self._next_time = False, end + PAUSE_FACTOR * (end - start)
        return decision.reason if decision.stop else ""
