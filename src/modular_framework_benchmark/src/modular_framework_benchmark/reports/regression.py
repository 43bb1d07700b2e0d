# SPDX-License-Identifier: BSD-3-Clause
"""Compares two experiments with the same factors to find regressions and improvements.

Episodes of the two experiments with equal method, levels, trial and seed are pairs, because they share the scene. The
statistics are as in a comparison of two methods.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from enum import Enum

import pandas as pd

from modular_framework_benchmark.records.experiment import ExperimentDescription, Factor, Metric
from modular_framework_benchmark.records.results import COLD_START, WORKER_COUNT, ExperimentResults
from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.statistics.analysis import compare
from modular_framework_benchmark.statistics.comparison import Comparison, Verdict
from modular_framework_benchmark.statistics.observations import SUCCESS, metrics_of, unmeasured_reason

SIDE_FACTOR = "(side)"
"""Name of the factor that distinguishes the experiments; the names of all other factors have no parentheses."""
AFTER, BEFORE = "after", "before"


class Change(Enum):
    """Change of a metric of a method between two experiments."""

    BETTER = "better"
    WORSE = "worse"
    NOT_SHOWN = "no difference shown"
    NOT_SHOWABLE = "could not be shown"
    NO_DATA = "nothing to compare"


_CHANGES = {
    Verdict.FIRST_BETTER: Change.BETTER,
    Verdict.SECOND_BETTER: Change.WORSE,
    Verdict.NOT_SHOWN: Change.NOT_SHOWN,
    Verdict.NOT_SHOWABLE: Change.NOT_SHOWABLE,
    Verdict.NO_DATA: Change.NO_DATA,
}
"""Change, given the conclusion with the later experiment as the first method."""


@dataclass(frozen=True, slots=True)
class MetricChange:
    """Change of a metric of a method.

    Attributes:
        method: Name of the method.
        metric: Compared metric.
        comparison: Comparison whose first method is the later experiment and whose second method is the earlier
            experiment.
    """

    method: str
    metric: Metric
    comparison: Comparison

    @property
    def change(self) -> Change:
        """Returns the change that is shown."""
        return _CHANGES[self.comparison.verdict]


@dataclass(frozen=True, slots=True)
class Regression:
    """Comparison of two experiments.

    Attributes:
        before: Description of the earlier experiment.
        after: Description of the later experiment.
        changes: Change of each common metric of each common method.
        confidence: Probability over all methods that no change is shown if nothing changed.
        notes: Excluded methods and metrics, and the pairing of episodes.
        differing: Differences in the software and machines of the experiments.
    """

    before: ExperimentDescription
    after: ExperimentDescription
    changes: tuple[MetricChange, ...]
    confidence: float
    notes: tuple[str, ...]
    differing: tuple[str, ...] = ()

    def count(self, change: Change) -> int:
        """Returns the number of metrics of methods with this change."""
        return sum(item.change is change for item in self.changes)


def compare_experiments(before: ExperimentResults, after: ExperimentResults) -> Regression:
    """Returns the changes between two experiments.

    Raises:
        ReportError: The experiments have different factors, share no method or no metric, or measured no method.
    """
    _check_factors(before.description, after.description)
    for side, results in (("earlier", before), ("later", after)):
        if reason := unmeasured_reason(results):
            raise ReportError(f"{side} experiment {results.description.name}: {reason}")
    methods, levels_notes = _common_names(_levels(before.description), _levels(after.description), "method")
    metrics, metric_notes = _common_metrics(before, after)
    confidence = before.description.confidence
    method_confidence = 1.0 - (1.0 - confidence) / len(methods)
    notes = [*levels_notes, *metric_notes]
    if len(methods) > 1:
        notes.append(
            f"Intervals of {100.0 * method_confidence:.3g} % each, so that {100.0 * confidence:g} % hold over "
            f"all {len(methods)} methods."
        )
    changes, pairs, episodes = [], 0, 0
    if any(COLD_START in results.episodes and results.episodes[COLD_START].any() for results in (before, after)):
        notes.append(
            "Metrics in real or processor time are compared only between two first episodes of their stacks or two "
            "later episodes."
        )
    counts_of_workers = [_worker_counts(results) for results in (before, after)]
    if all(counts_of_workers) and counts_of_workers[0] != counts_of_workers[1]:
        notes.append(
            "Metrics in real or processor time are compared only between episodes with the same number of workers on "
            f"the machine: {' and '.join(counts_of_workers[0])} before, {' and '.join(counts_of_workers[1])} after."
        )
    for method in methods:
        merged = _merged_results(before, after, method, metrics, method_confidence)
        comparisons = {item.metric: item for item in compare(merged)}
        changes += [MetricChange(method, metric, comparisons[metric.name]) for metric in metrics_of(merged)]
        counts = comparisons[SUCCESS.name].counts
        pairs += 0 if counts.at_random else counts.pairs
        episodes += len(merged.episodes)
    notes.append(
        f"{pairs:,} pairs of episodes with the same method, levels, trial and seed, of {episodes:,} episodes."
        if pairs
        else "No two episodes have the same method, levels, trial and seed: episodes are paired at random."
    )
    return Regression(before.description, after.description, tuple(changes), confidence, tuple(notes))


def _worker_counts(results: ExperimentResults) -> list[str]:
    """Returns the known numbers of workers of the episodes."""
    if WORKER_COUNT not in results.episodes:
        return []
    return [str(count) for count in sorted(results.episodes[WORKER_COUNT].unique()) if count]


def _levels(description: ExperimentDescription) -> tuple[str, ...]:
    return next(factor.levels for factor in description.factors if factor.name == description.compared)


def _check_factors(before: ExperimentDescription, after: ExperimentDescription) -> None:
    names = [sorted(factor.name for factor in item.factors) for item in (before, after)]
    if names[0] != names[1] or before.compared != after.compared:
        parts = [
            f"{item.name} varies {', '.join(factor_names)} and compares {item.compared}"
            for item, factor_names in zip((before, after), names, strict=True)
        ]
        raise ReportError(f"{'; '.join(parts)}; experiments must have the same factors: name two such experiments")


def _common_names(before: tuple[str, ...], after: tuple[str, ...], noun: str) -> tuple[tuple[str, ...], list[str]]:
    common = tuple(name for name in before if name in after)
    if not common:
        raise ReportError(
            f"no {noun} is in both experiments: one has {', '.join(before)}, the other {', '.join(after)}; "
            "name experiments that share one"
        )
    notes = [
        f"Only the {side} experiment has the {noun} {name}: it is excluded."
        for side, names, others in (("earlier", before, after), ("later", after, before))
        for name in names
        if name not in others
    ]
    return common, notes


def _common_metrics(before: ExperimentResults, after: ExperimentResults) -> tuple[tuple[Metric, ...], list[str]]:
    """Returns the metrics of both experiments with the same definition."""
    earlier = {metric.name: metric for metric in metrics_of(before)}
    later = {metric.name: metric for metric in metrics_of(after)}
    names, notes = _common_names(tuple(earlier), tuple(later), "metric")
    common = []
    for name in names:
        first, second = (dataclasses.replace(side[name], description="") for side in (earlier, later))
        if first == second:
            common.append(later[name])
        else:
            notes.append(
                f"The metric {name} has a different unit, kind, direction or limit in the later experiment: excluded."
            )
    return tuple(common), notes


def _merged_results(
    before: ExperimentResults, after: ExperimentResults, method: str, metrics: tuple[Metric, ...], confidence: float
) -> ExperimentResults:
    """Returns the episodes of a method in both experiments as an experiment that compares the two experiments."""
    compared = before.description.compared
    others = tuple(factor for factor in before.description.factors if factor.name != compared)
    sides = []
    for side, results in ((AFTER, after), (BEFORE, before)):
        rows = results.episodes[results.episodes[compared] == method].drop(columns=compared)
        sides.append(rows.assign(**{SIDE_FACTOR: side}))
    key = [factor.name for factor in others] + ["trial"]
    sides[1] = _unpair_different_seeds(sides[0], sides[1], key)
    factors = (Factor(SIDE_FACTOR, (AFTER, BEFORE)), *_all_levels(others, sides))
    description = dataclasses.replace(
        before.description,
        factors=factors,
        compared=SIDE_FACTOR,
        metrics=metrics,
        confidence=confidence,
        sequential=before.description.sequential or after.description.sequential,
        extended=before.description.extended or after.description.extended,
    )
    episodes = pd.concat(sides, ignore_index=True)
    finished = all(len(item.episodes) >= item.planned for item in (before, after))
    return ExperimentResults(description, episodes, before.spans.iloc[:0], len(episodes) + (0 if finished else 1))


def _all_levels(factors: tuple[Factor, ...], sides: list[pd.DataFrame]) -> list[Factor]:
    """Returns the factors with the levels of both sides."""
    return [
        Factor(factor.name, tuple(dict.fromkeys([*factor.levels, *sides[0][factor.name], *sides[1][factor.name]])))
        for factor in factors
    ]


def _unpair_different_seeds(later: pd.DataFrame, earlier: pd.DataFrame, key: list[str]) -> pd.DataFrame:
    """Returns the earlier episodes, with an unmatched trial number where the partner's seed differs."""
    seeds = later.set_index(key)["seed"]
    partners = earlier.set_index(key)["seed"]
    partner_seeds = seeds.reindex(partners.index)
    differs = (partner_seeds.notna() & (partner_seeds != partners)).to_numpy()
    offset = int(max(later["trial"].max(), earlier["trial"].max())) + 1 if len(later) and len(earlier) else 0
    return earlier.assign(trial=earlier["trial"].where(~differs, earlier["trial"] + offset))
