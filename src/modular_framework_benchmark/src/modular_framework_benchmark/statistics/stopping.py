# SPDX-License-Identifier: BSD-3-Clause
"""Sequential stopping rules: interim analyses that decide whether an experiment continues."""

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
    """Decision of a stopping rule.

    Attributes:
        stop: Whether the experiment stops.
        reason: Reason to stop or to continue.
    """

    stop: bool
    reason: str


class StoppingRule(Protocol):
    """Decides from interim results whether an experiment continues; the number of calls is not limited."""

    def decide(self, results: ExperimentResults) -> StoppingDecision:
        """Returns whether the experiment stops.

        Args:
            results: Finished episodes.
        """
        ...


@dataclass(frozen=True, slots=True)
class AnytimeValid:
    """Stops when the comparisons of a metric are decided by anytime-valid tests.

    The description of the experiment must be `sequential`, so that its report uses the same tests. A comparison is
    decided when a difference is shown after the multiplicity correction, or when the betting interval lies within the
    equivalence margin.

    Attributes:
        metric: Name of the metric.
        smallest_difference: Equivalence margin as a win difference, such as 0.05 for 5 points; for a rate it is the
            difference of the rates. With None only a shown difference decides a comparison.
    """

    metric: str = SUCCESS.name
    smallest_difference: float | None = None

    def __post_init__(self) -> None:
        """Checks the equivalence margin."""
        if self.smallest_difference is not None and not 0.0 < self.smallest_difference <= 1.0:
            raise ValueError(f"smallest_difference is {self.smallest_difference}; it must be above 0 and at most 1")

    def decide(self, results: ExperimentResults) -> StoppingDecision:
        """Returns a decision to stop once every comparison is decided or all episodes are finished.

        Raises:
            ValueError: The experiment is not sequential or does not measure the metric.
        """
        if not results.description.sequential:
            raise ValueError(
                f"experiment '{results.description.name}' is not sequential: its report would use tests that interim "
                "analyses invalidate; describe it with sequential=True"
            )
        metric = self._measured_metric(results)
        comparisons = [comparison for comparison in compare(results) if comparison.metric == metric.name]
        if not comparisons:
            return StoppingDecision(False, "the experiment has a single method: nothing to compare")
        if len(results.episodes) >= results.planned:
            return StoppingDecision(True, f"all {results.planned} planned episodes are finished")
        undecided = [comparison for comparison in comparisons if not self._is_decided(comparison)]
        if not undecided:
            return StoppingDecision(True, self._outcome(metric, comparisons))
        min_pairs = min(comparison.counts.pairs for comparison in comparisons)
        pairs = sentences.enumeration([f"{comparison.first} and {comparison.second}" for comparison in undecided])
        return StoppingDecision(False, f"not decided yet after {min_pairs} pairs: {pairs}")

    def _measured_metric(self, results: ExperimentResults) -> Metric:
        for metric in metrics_of(results):
            if metric.name == self.metric:
                return metric
        measured = ", ".join(metric.name for metric in metrics_of(results))
        raise ValueError(f"the stopping rule uses '{self.metric}', which is not measured; measured are: {measured}")

    def _is_decided(self, comparison: Comparison) -> bool:
        return comparison.verdict in (Verdict.FIRST_BETTER, Verdict.SECOND_BETTER) or self._is_equivalent(comparison)

    def _is_equivalent(self, comparison: Comparison) -> bool:
        if self.smallest_difference is None or comparison.difference is None or comparison.difference.interval is None:
            return False
        interval = comparison.difference.interval
        return -self.smallest_difference < interval.low and interval.high < self.smallest_difference

    def _outcome(self, metric: Metric, comparisons: Sequence[Comparison]) -> str:
        points = f"{100 * (self.smallest_difference or 0.0):g} points"
        noun = "" if metric.kind is MetricKind.RATE else " of pairs won"
        parts = [
            f"{found.first} and {found.second} differ by less than {points}{noun}"
            if self._is_equivalent(found)
            else found.sentence
            for found in comparisons
        ]
        return f"every comparison of {sentences.spaced_name(metric)} is decided: {'; '.join(parts)}"
