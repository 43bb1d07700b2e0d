# SPDX-License-Identifier: BSD-3-Clause
"""Compares two experiments with the same factors: what got better, what got worse, and how sure that is.

An episode of one experiment and one of the other are a pair where method, levels, trial and seed agree: then they have
the same scene. The statistics are those of a comparison of two methods.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import pandas as pd

from modular_framework_benchmark.episodes.snapshot import COLD_START
from modular_framework_benchmark.records.experiment import ExperimentDescription, Factor, Metric
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.statistics.analysis import compare
from modular_framework_benchmark.statistics.comparison import Comparison, Verdict
from modular_framework_benchmark.statistics.observations import SUCCESS, metrics_of
from modular_framework_ros.reported_figures import Clock

SIDE = "side"
AFTER, BEFORE = "after", "before"


class Change(Enum):
    """What happened to a metric of a method between two experiments."""

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
"""What a verdict says where the later experiment is the first of the comparison."""


@dataclass(frozen=True, slots=True)
class MetricChange:
    """A metric of a method in both experiments.

    Attributes:
        method: Name of the method.
        metric: The metric.
        comparison: The statistics; its first is the later experiment, its second the earlier one.
    """

    method: str
    metric: Metric
    comparison: Comparison

    @property
    def change(self) -> Change:
        """Returns what is shown."""
        return _CHANGES[self.comparison.verdict]


@dataclass(frozen=True, slots=True)
class Regression:
    """Two experiments compared.

    Attributes:
        before: The earlier one.
        after: The later one.
        changes: Each metric of each method that both have.
        confidence: Level over all methods: the chance that no change is shown where nothing changed.
        notes: What could not be compared, and how episodes were paired.
        differing: What the two ran with that is not the same.
    """

    before: ExperimentDescription
    after: ExperimentDescription
    changes: tuple[MetricChange, ...]
    confidence: float
    notes: tuple[str, ...]
    differing: tuple[str, ...] = ()

    def count(self, change: Change) -> int:
        """Returns how many metrics of methods changed so."""
        return sum(item.change is change for item in self.changes)


def compare_experiments(before: ExperimentResults, after: ExperimentResults) -> Regression:
    """Returns what changed between two experiments.

    Raises:
        ReportError: when their factors differ, or they have no method or no metric in common.
    """
    _check_factors(before.description, after.description)
    methods, levels_notes = _common(_levels(before.description), _levels(after.description), "method")
    metrics, metric_notes = _common_metrics(before, after)
    confidence = before.description.confidence
    of_method = 1.0 - (1.0 - confidence) / len(methods)
    notes = [*levels_notes, *metric_notes]
    if len(methods) > 1:
        notes.append(
            f"Intervals of {100.0 * of_method:.3g} % each, so that {100.0 * confidence:g} % hold over "
            f"all {len(methods)} methods."
        )
    changes, pairs, episodes = [], 0, 0
    if any(COLD_START in results.episodes and results.episodes[COLD_START].any() for results in (before, after)):
        notes.append(
            "Metrics in real or processor time are compared between episodes of which both, or neither, were the first "
            "one of their stack."
        )
    for method in methods:
        merged = _merged(before, after, method, metrics, of_method)
        comparisons = {item.metric: item for item in compare(merged)}
        changes += [MetricChange(method, metric, comparisons[metric.name]) for metric in metrics_of(merged)]
        counts = comparisons[SUCCESS.name].counts
        pairs += 0 if counts.at_random else counts.pairs
        episodes += len(merged.episodes)
    notes.append(
        f"{pairs:,} pairs of episodes with the same method, levels, trial and seed, of {episodes:,} episodes."
        if pairs
        else "No two episodes have the same method, levels, trial and seed: pairs are any two episodes."
    )
    return Regression(before.description, after.description, tuple(changes), confidence, tuple(notes))


def _levels(description: ExperimentDescription) -> tuple[str, ...]:
    return next(factor.levels for factor in description.factors if factor.name == description.compared)


def _check_factors(before: ExperimentDescription, after: ExperimentDescription) -> None:
    names = [sorted(factor.name for factor in item.factors) for item in (before, after)]
    if names[0] != names[1] or before.compared != after.compared:
        parts = [
            f"{item.name} varies {', '.join(found)} and compares {item.compared}"
            for item, found in zip((before, after), names, strict=True)
        ]
        raise ReportError(f"{'; '.join(parts)}; only experiments with the same factors can be compared: name two such")


def _common(before: tuple[str, ...], after: tuple[str, ...], noun: str) -> tuple[tuple[str, ...], list[str]]:
    found = tuple(name for name in before if name in after)
    if not found:
        raise ReportError(
            f"no {noun} is in both experiments: one has {', '.join(before)}, the other {', '.join(after)}; "
            "name experiments that share one"
        )
    notes = [
        f"Only the {side} experiment has the {noun} {name}: it is left out."
        for side, names, others in (("earlier", before, after), ("later", after, before))
        for name in names
        if name not in others
    ]
    return found, notes


def _common_metrics(before: ExperimentResults, after: ExperimentResults) -> tuple[tuple[Metric, ...], list[str]]:
    """Returns the metrics that both have and that mean the same in both."""
    earlier = {metric.name: metric for metric in metrics_of(before)}
    later = {metric.name: metric for metric in metrics_of(after)}
    names, notes = _common(tuple(earlier), tuple(later), "metric")
    kept = []
    for name in names:
        first, second = (dataclasses.replace(side[name], description="") for side in (earlier, later))
        if first == second:
            kept.append(later[name])
        else:
            notes.append(
                f"The metric {name} has another unit, kind, direction or limit in the later experiment: left out."
            )
    return tuple(kept), notes


def _merged(
    before: ExperimentResults, after: ExperimentResults, method: str, metrics: tuple[Metric, ...], confidence: float
) -> ExperimentResults:
    """Returns the episodes of a method in both experiments as one experiment that compares the two."""
    compared = before.description.compared
    others = tuple(factor for factor in before.description.factors if factor.name != compared)
    sides = []
    for side, results in ((AFTER, after), (BEFORE, before)):
        rows = results.episodes[results.episodes[compared] == method].drop(columns=compared)
        sides.append(rows.assign(**{SIDE: side}))
    key = [factor.name for factor in others] + ["trial"]
    sides[1] = _unpaired_where_seeds_differ(sides[0], sides[1], key)
    if all(COLD_START in side for side in sides):
        sides = _without_unlike_starts(sides, key, metrics)
    factors = (Factor(SIDE, (AFTER, BEFORE)), *_all_levels(others, sides))
    description = dataclasses.replace(
        before.description,
        factors=factors,
        compared=SIDE,
        metrics=metrics,
        confidence=confidence,
        sequential=before.description.sequential or after.description.sequential,
        extended=before.description.extended or after.description.extended,
    )
    episodes = pd.concat(sides, ignore_index=True)
    finished = all(len(item.episodes) >= item.planned for item in (before, after))
    return ExperimentResults(description, episodes, before.spans.iloc[:0], len(episodes) + (0 if finished else 1))


def _without_unlike_starts(
    sides: Sequence[pd.DataFrame], key: list[str], metrics: Sequence[Metric]
) -> list[pd.DataFrame]:
    """Returns the episodes of both sides; pairs of a cold and a warm start have no values in real or processor time."""
    names = [metric.name for metric in metrics if metric.clock in (Clock.WALL, Clock.PROCESSOR)]
    starts = [side.set_index(key)[COLD_START] for side in sides]
    kept = []
    for side, own, other in zip(sides, starts, reversed(starts), strict=True):
        partners = other.reindex(own.index)
        unlike = (partners.notna() & (partners != own)).to_numpy()
        kept.append(side.assign(**{name: side[name].mask(unlike) for name in names}))
    return kept


def _all_levels(factors: tuple[Factor, ...], sides: list[pd.DataFrame]) -> list[Factor]:
    """Returns the factors with the levels of both sides."""
    return [
        Factor(factor.name, tuple(dict.fromkeys([*factor.levels, *sides[0][factor.name], *sides[1][factor.name]])))
        for factor in factors
    ]


def _unpaired_where_seeds_differ(later: pd.DataFrame, earlier: pd.DataFrame, key: list[str]) -> pd.DataFrame:
    """Returns the earlier episodes; those whose partner has another seed get a trial that no later episode has."""
    seeds = later.set_index(key)["seed"]
    partners = earlier.set_index(key)["seed"]
    found = seeds.reindex(partners.index)
    differs = (found.notna() & (found != partners)).to_numpy()
    beyond = int(max(later["trial"].max(), earlier["trial"].max())) + 1 if len(later) and len(earlier) else 0
    return earlier.assign(trial=earlier["trial"].where(~differs, earlier["trial"] + beyond))
