# SPDX-License-Identifier: BSD-3-Clause
"""Decides after each pair of episodes whether an experiment goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from modular_framework_benchmark.records.experiment import Metric, MetricKind
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.analysis import compare
from modular_framework_benchmark.statistics.comparison import Comparison, Verdict
from modular_framework_benchmark.statistics.observations import SUCCESS, metrics_of


@dataclass(frozen=True, slots=True)
class StoppingDecision:
    """Whether an experiment stops.

    Attributes:
        stop: Whether it does.
        reason: Why it stops or what it still waits for, in words.
    """

    stop: bool
    reason: str


class StoppingRule(Protocol):
    """Looks at the results so far, as often as one likes, and says whether the experiment goes on."""

    def decide(self, results: ExperimentResults) -> StoppingDecision:
        """Returns whether the experiment stops.

        Args:
            results: The episodes that are finished.
        """
        ...


@dataclass(frozen=True, slots=True)
class AnytimeValid:
    """Stops when the comparisons of a metric are decided, by tests that hold at any time.

    It needs an experiment whose description is `sequential`, so that its report uses the same tests. A comparison is
    decided when a difference is shown, with the correction for many comparisons, or when its betting interval is within
    the smallest win difference that matters.

    Attributes:
        metric: Name of the metric it looks at.
        smallest_difference: Win difference below which the methods count as alike, such as 0.05 for 5 points; for a
            rate that is the difference of the rates. None: it goes on until a difference is shown or the planned
            episodes are finished.
    """

    metric: str = SUCCESS.name
    smallest_difference: float | None = None

    def __post_init__(self) -> None:
        """Checks the numbers."""
        if self.smallest_difference is not None and not 0.0 < self.smallest_difference <= 1.0:
            raise ValueError(f"smallest_difference is {self.smallest_difference}; it must be above 0 and at most 1")

    def decide(self, results: ExperimentResults) -> StoppingDecision:
        """Returns a stop once every comparison is decided or all episodes are finished.

        Raises:
            ValueError: The experiment is not sequential or does not measure the metric.
        """
        if not results.description.sequential:
            raise ValueError(
                f"experiment '{results.description.name}' is not sequential: its report would use tests that do not "
                "hold after looking; describe it with sequential=True"
            )
        metric = self._measured(results)
        comparisons = [comparison for comparison in compare(results) if comparison.metric == metric.name]
        if not comparisons:
            return StoppingDecision(False, "there is one method only: nothing to compare")
        if len(results.episodes) >= results.planned:
            return StoppingDecision(True, f"all {results.planned} planned episodes are finished")
        open_ones = [comparison for comparison in comparisons if not self._decided(comparison)]
        if not open_ones:
            return StoppingDecision(True, self._outcome(metric, comparisons))
        fewest = min(comparison.counts.pairs for comparison in comparisons)
        waiting = sentences.listed([f"{comparison.first} and {comparison.second}" for comparison in open_ones])
        return StoppingDecision(False, f"not decided yet after {fewest} pairs: {waiting}")

    def _measured(self, results: ExperimentResults) -> Metric:
        for metric in metrics_of(results):
            if metric.name == self.metric:
                return metric
        known = ", ".join(metric.name for metric in metrics_of(results))
        raise ValueError(f"the stopping rule looks at '{self.metric}', which is not measured; measured are: {known}")

    def _decided(self, comparison: Comparison) -> bool:
        return comparison.verdict in (Verdict.FIRST_BETTER, Verdict.SECOND_BETTER) or self._alike(comparison)

    def _alike(self, comparison: Comparison) -> bool:
        if self.smallest_difference is None or comparison.difference is None or comparison.difference.interval is None:
            return False
        interval = comparison.difference.interval
        return -self.smallest_difference < interval.low and interval.high < self.smallest_difference

    def _outcome(self, metric: Metric, comparisons: Sequence[Comparison]) -> str:
        points = f"{100 * (self.smallest_difference or 0.0):g} points"
        noun = "" if metric.kind is MetricKind.RATE else " of pairs won"
        parts = [
            f"{found.first} and {found.second} differ by less than {points}{noun}"
            if self._alike(found)
            else found.sentence
            for found in comparisons
        ]
        return f"every comparison of {sentences.words(metric)} is decided: {'; '.join(parts)}"
