# SPDX-License-Identifier: BSD-3-Clause
"""Statistical analysis of an experiment: every method and every pair of methods, for every metric.

docs/statistics.md gives the rules and their reasons.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.comparison import Analysis, Comparison, MethodSummary, Verdict
from modular_framework_benchmark.statistics.findings import Finding, Settings, compare_pair
from modular_framework_benchmark.statistics.observations import (
    SUCCESS,
    EpisodeTable,
    methods_of,
    metrics_of,
    other_factors,
    pairs_of_methods,
    restrict_results,
    unmeasured_reason,
)
from modular_framework_benchmark.statistics.summaries import summarise_method
from modular_framework_benchmark.statistics.verdicts import Correction, conclude_comparison


def analyse(results: ExperimentResults, *, mean_intervals: bool = False) -> Analysis:
    """Returns the statistical analysis of an experiment.

    Args:
        results: Finished episodes of the experiment.
        mean_intervals: Whether the mean differences of bounded metrics get a betting interval.

    Raises:
        ValueError: The experiment lacks the compared factor, or the results contain an episode twice.
    """
    unmeasured = unmeasured_reason(results)
    comparisons = () if unmeasured else compare(results, mean_intervals=mean_intervals)
    summaries = summarise(results)
    return Analysis(
        methods=methods_of(results),
        metrics=tuple(metric.name for metric in metrics_of(results)),
        summaries=tuple(dataclasses.replace(item, estimate=None) for item in summaries) if unmeasured else summaries,
        comparisons=comparisons,
        sentences=(unmeasured,) if unmeasured else _main_sentences(results, comparisons),
        rule=_rule_sentence(results, len(comparisons)),
        scope=_scope_sentence(results),
    )


def summarise(results: ExperimentResults, levels: str = "") -> tuple[MethodSummary, ...]:
    """Returns the summary of every method for every metric.

    Args:
        results: Finished episodes.
        levels: Levels of the other factors that the results are restricted to, such as `object=can`.
    """
    table = EpisodeTable(results)
    return tuple(
        dataclasses.replace(summary, levels=levels, sentence=sentences.with_levels(levels, summary.sentence))
        for metric in metrics_of(results)
        for method in methods_of(results)
        for summary in [summarise_method(table, metric, method)]
    )


def summarise_by_level(results: ExperimentResults, factor: str) -> tuple[MethodSummary, ...]:
    """Returns the summary of every method for every metric at each level of another factor, without comparisons.

    Raises:
        ValueError: The experiment lacks the factor, or compares its levels.
    """
    return tuple(
        summary
        for level in _levels(results, factor)
        for summary in summarise(restrict_results(results, factor, level), f"{factor}={level}")
    )


def compare(results: ExperimentResults, *, mean_intervals: bool = False) -> tuple[Comparison, ...]:
    """Returns the comparison of every pair of methods for every metric; `analyse` describes the arguments."""
    description, table = results.description, EpisodeTable(results)
    settings = Settings(description.confidence, description.holds_at_any_time, mean_intervals)
    findings = [
        compare_pair(table, metric, first, second, settings)
        for metric in metrics_of(results)
        for first, second in pairs_of_methods(results)
    ]
    corrections = _corrections(findings, 1.0 - description.confidence)
    return tuple(conclude_comparison(results, *each) for each in zip(findings, corrections, strict=True))


def _corrections(findings: Sequence[Finding], error_rate: float) -> list[Correction]:
    """Returns the multiplicity correction of each comparison, in the order of the findings."""
    of_success = [finding.metric.name == SUCCESS.name for finding in findings]
    p_values, levels = _corrected_p_values(findings, of_success, error_rate)
    without = p_values
    if any(finding.without_broken for finding in findings):
        without, _ = _corrected_p_values(
            [finding.without_broken or finding for finding in findings], of_success, error_rate
        )
    return [
        Correction(p_value, p_without, error_rate, level)
        for p_value, p_without, level in zip(p_values, without, levels, strict=True)
    ]


def _corrected_p_values(
    findings: Sequence[Finding], of_success: Sequence[bool], error_rate: float
) -> tuple[list[float | None], list[float]]:
    """Returns the corrected p value and the level of the strictest Holm step of each comparison."""
    families = [
        [
            index
            for index, finding in enumerate(findings)
            if of_success[index] is is_success and finding.p_value is not None
        ]
        for is_success in (True, False)
    ]
    min_attainable = [min((findings[index].min_attainable_p for index in family), default=1.0) for family in families]
    p_values: list[float | None] = [None] * len(findings)
    levels = [error_rate / 2, error_rate / 2]
    for family_index, family in enumerate(families):
        if family:
            # A family that cannot show anything at its half of the error rate leaves its half to the other family.
            bar = error_rate / 2 if min_attainable[family_index] <= error_rate / 2 else error_rate
            fraction = 1.0 if min_attainable[1 - family_index] > bar else 0.5
            tested = [findings[index].p_value or 0.0 for index in family]
            finding, count = holm_tarone(
                tested, [findings[index].min_attainable_p for index in family], error_rate, fraction
            )
            levels[family_index] = error_rate * fraction / count
            for index, p_value in zip(family, finding, strict=True):
                p_values[index] = p_value
    return p_values, [levels[0 if success else 1] for success in of_success]


def _levels(results: ExperimentResults, name: str) -> tuple[str, ...]:
    for factor in other_factors(results):
        if factor.name == name:
            return factor.levels
    known_factors = ", ".join(factor.name for factor in other_factors(results)) or "none"
    raise ValueError(f"'{name}' is not a factor besides the compared factor; allowed: {known_factors}")


def _main_sentences(results: ExperimentResults, comparisons: Sequence[Comparison]) -> tuple[str, ...]:
    """Returns the sentences on success, then the sentences on differences that are shown, then all others."""
    if not comparisons:
        return (f"nothing to compare: the only method is {', '.join(methods_of(results)) or 'none'}",)
    shown_verdicts = (Verdict.FIRST_BETTER, Verdict.SECOND_BETTER)
    ranked = sorted(
        enumerate(comparisons),
        key=lambda item: (item[1].metric != SUCCESS.name, item[1].verdict not in shown_verdicts, item[0]),
    )
    return tuple(comparison.sentence for _, comparison in ranked)


def _rule_sentence(results: ExperimentResults, comparisons: int) -> str:
    description = results.description
    error = f"{100 * (1 - description.confidence):g} %"
    when = "Tests hold for the planned number of episodes."
    if description.sequential:
        when = "Tests and intervals hold at any time, because a stopping rule looked at the results."
    elif description.extended:
        when = "Tests and intervals hold at any time, because episodes were added after results had been seen."
    return (
        "A difference is shown if a method wins more pairs than it loses and test and interval both confirm this. A "
        f"failure is worse than any value; two failures tie. {when} With identical methods the experiment shows any "
        f"difference with a probability of at most {error}, half for success and half for all other metrics (Holm's "
        f"and Tarone's correction, {sentences.quantity_text(comparisons, 'comparison')})."
    )


def _scope_sentence(results: ExperimentResults) -> str:
    """Returns the population that the claims cover: the units, their number and the fixed levels."""
    if results.episodes.empty:
        return ""
    table = EpisodeTable(results)
    units = sentences.quantity_text(table.unit_count, table.unit_noun)
    levels = sentences.enumeration([factor.name.replace("_", " ") for factor in other_factors(results)])
    fixed = f", at the levels of {levels} that were run" if levels else ""
    trials = (
        f" for {table.trial_count} trials; all trials of a unit count as one"
        if table.unit_count < table.trial_count
        else ""
    )
    return f"The unit is the {table.unit_noun}: {units}{trials}. Claims are about {table.unit_noun}s like these{fixed}."


def holm_tarone(
    p_values: Sequence[float], min_attainable: Sequence[float], error_rate: float, fraction: float
) -> tuple[list[float], int]:
    """Returns p values after Holm's correction with Tarone's count, comparable with the whole error rate.

    Tarone's count excludes comparisons that cannot be significant with their number of discordant pairs. Sources:
    S. Holm, Scandinavian J. Statistics 6 (1979) 65-70; R. E. Tarone, Biometrics 46 (1990) 515-522.

    Args:
        p_values: P values of the comparisons of a family, shape (n,).
        min_attainable: Minimum attainable p value of each comparison, given its discordant pairs, shape (n,).
        error_rate: Error rate of the experiment.
        fraction: Fraction of the error rate that the family gets.

    Returns:
        The corrected p values, and the factor of the smallest p value.
    """
    order = sorted(range(len(p_values)), key=lambda index: p_values[index])
    ordered_minima = np.asarray(min_attainable, dtype=float)[order]
    adjusted, largest, first_factor = [1.0] * len(p_values), 0.0, 1
    for rank, index in enumerate(order):
        factor = _tarone_count(ordered_minima[rank:], error_rate * fraction)
        first_factor = factor if rank == 0 else first_factor
        largest = min(max(largest, p_values[index] * factor / fraction), 1.0)
        adjusted[index] = largest
    return adjusted, first_factor


def _tarone_count(min_attainable: np.ndarray, level: float) -> int:
    """Returns the smallest k for which at most k comparisons can attain a p value of level / k."""
    counts = np.arange(1, len(min_attainable) + 1)
    attainable = np.searchsorted(np.sort(min_attainable), level / counts, side="right")
    return int(counts[attainable <= counts][0])
