# SPDX-License-Identifier: BSD-3-Clause
"""The statistics of an experiment: every method and every pair of methods, by every metric.

docs/statistics.md says which rule is used when, and why.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.comparison import Analysis, Comparison, MethodSummary, Verdict
from modular_framework_benchmark.statistics.corrections import corrected
from modular_framework_benchmark.statistics.findings import Finding, Settings, compare_pair
from modular_framework_benchmark.statistics.observations import (
    SUCCESS,
    EpisodeTable,
    methods_of,
    metrics_of,
    other_factors,
    outside_reason,
    pairs_of_methods,
    restricted,
)
from modular_framework_benchmark.statistics.summaries import summarise_method
from modular_framework_benchmark.statistics.verdicts import Correction, conclude


def analyse(results: ExperimentResults, *, mean_intervals: bool = False) -> Analysis:
    """Returns the statistics of an experiment.

    Args:
        results: Its finished episodes.
        mean_intervals: Whether differences of the means of bounded metrics get an interval, a betting interval.

    Raises:
        ValueError: The compared factor is none of the experiment's, or an episode is there twice.
    """
    outside = outside_reason(results)
    comparisons = () if outside else compare(results, mean_intervals=mean_intervals)
    summaries = summarise(results)
    return Analysis(
        methods=methods_of(results),
        metrics=tuple(metric.name for metric in metrics_of(results)),
        summaries=tuple(dataclasses.replace(item, estimate=None) for item in summaries) if outside else summaries,
        comparisons=comparisons,
        sentences=(outside,) if outside else _main_sentences(results, comparisons),
        rule=_rule(results, len(comparisons)),
        scope=_scope(results),
    )


def summarise(results: ExperimentResults, levels: str = "") -> tuple[MethodSummary, ...]:
    """Returns each method by each metric.

    Args:
        results: The finished episodes.
        levels: Levels of other factors that they are restricted to.
    """
    table = EpisodeTable(results)
    return tuple(
        dataclasses.replace(summary, levels=levels, sentence=sentences.join(levels, summary.sentence))
        for metric in metrics_of(results)
        for method in methods_of(results)
        for summary in [summarise_method(table, metric, method)]
    )


def summarise_by_level(results: ExperimentResults, factor: str) -> tuple[MethodSummary, ...]:
    """Returns each method by each metric at each level of another factor: a description, without comparisons.

    Raises:
        ValueError: The experiment has no such factor, or it is the compared one.
    """
    return tuple(
        summary
        for level in _levels(results, factor)
        for summary in summarise(restricted(results, factor, level), f"{factor}={level}")
    )


def compare(results: ExperimentResults, *, mean_intervals: bool = False) -> tuple[Comparison, ...]:
    """Returns each pair of methods by each metric; the arguments are those of `analyse`."""
    description, table = results.description, EpisodeTable(results)
    settings = Settings(description.confidence, description.holds_at_any_time, mean_intervals)
    findings = [
        compare_pair(table, metric, first, second, settings)
        for metric in metrics_of(results)
        for first, second in pairs_of_methods(results)
    ]
    corrections = _corrections(findings, 1.0 - description.confidence)
    return tuple(conclude(results, *each) for each in zip(findings, corrections, strict=True))


def _corrections(findings: Sequence[Finding], error_rate: float) -> list[Correction]:
    """Returns what the correction for many makes of each comparison, in their order."""
    of_success = [found.metric.name == SUCCESS.name for found in findings]
    p_values, at_least = _corrected(findings, of_success, error_rate)
    without = p_values
    if any(found.without_broken for found in findings):
        without, _ = _corrected([found.without_broken or found for found in findings], of_success, error_rate)
    return [
        Correction(p_value, p_without, error_rate, least)
        for p_value, p_without, least in zip(p_values, without, at_least, strict=True)
    ]


def _corrected(
    findings: Sequence[Finding], of_success: Sequence[bool], error_rate: float
) -> tuple[list[float | None], list[float]]:
    """Returns the corrected p value of each comparison, and the error rate that it has at the least."""
    families = [
        [place for place, found in enumerate(findings) if of_success[place] is which and found.p_value is not None]
        for which in (True, False)
    ]
    smallest = [min((findings[place].smallest_p for place in family), default=1.0) for family in families]
    p_values: list[float | None] = [None] * len(findings)
    least = [error_rate / 2, error_rate / 2]
    for which, family in enumerate(families):
        if family:
            # A family that cannot show anything with its share leaves it to the other, if that can use it.
            bar = error_rate / 2 if smallest[which] <= error_rate / 2 else error_rate
            share = 1.0 if smallest[1 - which] > bar else 0.5
            tested = [findings[place].p_value or 0.0 for place in family]
            found, count = corrected(tested, [findings[place].smallest_p for place in family], error_rate, share)
            least[which] = error_rate * share / count
            for place, p_value in zip(family, found, strict=True):
                p_values[place] = p_value
    return p_values, [least[0 if success else 1] for success in of_success]


def _levels(results: ExperimentResults, name: str) -> tuple[str, ...]:
    for factor in other_factors(results):
        if factor.name == name:
            return factor.levels
    known = ", ".join(factor.name for factor in other_factors(results)) or "none"
    raise ValueError(f"'{name}' is none of the factors beside the compared one; those are: {known}")


def _main_sentences(results: ExperimentResults, comparisons: Sequence[Comparison]) -> tuple[str, ...]:
    """Returns all about success, then the differences that are shown, then what else was compared."""
    if not comparisons:
        return (f"nothing to compare: the only method is {', '.join(methods_of(results)) or 'none'}",)
    shown = (Verdict.FIRST_BETTER, Verdict.SECOND_BETTER)
    ranked = sorted(
        enumerate(comparisons),
        key=lambda item: (item[1].metric != SUCCESS.name, item[1].verdict not in shown, item[0]),
    )
    return tuple(comparison.sentence for _, comparison in ranked)


def _rule(results: ExperimentResults, comparisons: int) -> str:
    description = results.description
    error = f"{100 * (1 - description.confidence):g} %"
    when = "Tests hold for the planned number of episodes."
    if description.sequential:
        when = "Tests and intervals hold at any time, because a stopping rule looked at the results."
    elif description.extended:
        when = "Tests and intervals hold at any time, because episodes were added after results had been seen."
    return (
        "A difference is shown where more pairs are won than lost and the test and the interval of that both say so; a "
        f"failure is worse than any value, two failures are a tie. {when} With identical methods the experiment shows "
        f"any difference with at most {error}, half of it for success and half for all other metrics (Holm's and "
        f"Tarone's correction, {sentences.count(comparisons, 'comparison')})."
    )


def _scope(results: ExperimentResults) -> str:
    """Returns what the claims speak for: units like those that were drawn, and the levels that were run."""
    if results.episodes.empty:
        return ""
    table = EpisodeTable(results)
    units = sentences.count(table.unit_count, table.unit_noun)
    levels = sentences.listed([factor.name.replace("_", " ") for factor in other_factors(results)])
    fixed = f", at the levels of {levels} that were run" if levels else ""
    share = (
        f" for {table.trial_count} trials: those of one count as one" if table.unit_count < table.trial_count else ""
    )
    return f"The unit is the {table.unit_noun}: {units}{share}. Claims are about {table.unit_noun}s like these{fixed}."
