# SPDX-License-Identifier: BSD-3-Clause
"""Says after each trial whether an experiment goes on."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.results import ExperimentResults

if TYPE_CHECKING:  # the statistics take seconds to import
    from modular_framework_benchmark.statistics.stopping import StoppingRule

PAUSE_SHARE = 10.0
"""After a look at the results, none for this many times as long as it took: looking must not cost the run."""


class TrialWatch:
    """Asks a stopping rule when all episodes of a trial have ended.

    Args:
        rule: The rule; None for one that never stops.
        load: Loads the results so far.
        pending: The episodes that are still to be run.
    """

    def __init__(
        self, rule: StoppingRule | None, load: Callable[[], ExperimentResults], pending: Iterable[EpisodeSpec]
    ) -> None:
        self._rule, self._load = rule, load
        self._left: dict[int, int] = {}
        for spec in pending:
            self._left[spec.trial] = self._left.get(spec.trial, 0) + 1
        self._look = rule is not None  # the results of an earlier run may be enough
        self._next_look = 0.0

    def ended(self, spec: EpisodeSpec) -> None:
        """Notes that an episode has ended."""
        self._left[spec.trial] -= 1
        self._look = self._look or self._left[spec.trial] == 0

    def reason_to_stop(self) -> str:
        """Asks the rule, if a trial has ended since it was asked last, and that is long enough ago.

        Returns:
            Why the experiment stops; empty when it goes on.
        """
        if self._rule is None or not self._look or time.monotonic() < self._next_look:
            return ""
        start = time.monotonic()
        decision = self._rule.decide(self._load())
        end = time.monotonic()
        self._look, self._next_look = False, end + PAUSE_SHARE * (end - start)
        return decision.reason if decision.stop else ""
