# SPDX-License-Identifier: BSD-3-Clause
"""The statistics of an experiment: every method and every pair of methods, by every metric.

docs/statistics.md says which rule is used when, and why.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.comparison import Analysis, Comparison, MethodSummary, Verdict
from modular_framework_benchmark.statistics.corrections import corrected, families
from modular_framework_benchmark.statistics.findings import Finding, compare_pair
from modular_framework_benchmark.statistics.observations import (
    SUCCESS,
    EpisodeTable,
    methods_of,
    metrics_of,
    other_factors,
    pairs_of_methods,
    restricted,
)
from modular_framework_benchmark.statistics.summaries import summarise_method
from modular_framework_benchmark.statistics.verdicts import conclude


def analyse(results: ExperimentResults, *, seed: int = 0) -> Analysis:
    """Returns the statistics of an experiment.

    Args:
        results: Its finished episodes.
        seed: Of the bootstrap's resamples: the same results and seed give the same figures.

    Raises:
        ValueError: The compared factor is none of the experiment's, or an episode is there twice.
    """
    comparisons = compare(results, seed=seed)
    return Analysis(
        methods=methods_of(results),
        metrics=tuple(metric.name for metric in metrics_of(results)),
        summaries=summarise(results, seed=seed),
        comparisons=comparisons,
        sentences=_main_sentences(results, comparisons),
        rule=_rule(results, len(comparisons)),
    )


def summarise(results: ExperimentResults, *, seed: int = 0) -> tuple[MethodSummary, ...]:
    """Returns each method by each metric; the arguments are those of `analyse`."""
    return _summarise(results, "", seed)


def summarise_by_level(results: ExperimentResults, factor: str, *, seed: int = 0) -> tuple[MethodSummary, ...]:
    """Returns each method by each metric at each level of another factor.

    Raises:
        ValueError: The experiment has no such factor, or it is the compared one.
    """
    return tuple(
        summary
        for level in _levels(results, factor)
        for summary in _summarise(restricted(results, factor, level), f"{factor}={level}", seed)
    )


def compare(results: ExperimentResults, *, seed: int = 0) -> tuple[Comparison, ...]:
    """Returns each pair of methods by each metric, over all levels of the other factors.

    Args:
        results: The finished episodes.
        seed: Of the bootstrap's resamples.

    Raises:
        ValueError: The compared factor is none of the experiment's, or an episode is there twice.
    """
    return _concluded(results, _findings(results, "", seed))


def compare_by_level(results: ExperimentResults, factor: str, *, seed: int = 0) -> tuple[Comparison, ...]:
    """Returns each pair of methods by each metric at each level of another factor.

    They are corrected together, apart from those of `compare`.

    Raises:
        ValueError: The experiment has no such factor, or it is the compared one.
    """
    findings = [
        finding
        for level in _levels(results, factor)
        for finding in _findings(restricted(results, factor, level), f"{factor}={level}", seed)
    ]
    return _concluded(results, findings)


def _summarise(results: ExperimentResults, levels: str, seed: int) -> tuple[MethodSummary, ...]:
    generator, table = np.random.default_rng(seed), EpisodeTable(results)
    return tuple(
        dataclasses.replace(summary, levels=levels, sentence=sentences.join(levels, summary.sentence))
        for metric in metrics_of(results)
        for method in methods_of(results)
        for summary in [summarise_method(table, metric, method, generator)]
    )


def _findings(results: ExperimentResults, levels: str, seed: int) -> list[Finding]:
    generator, table = np.random.default_rng(seed), EpisodeTable(results)
    return [
        dataclasses.replace(compare_pair(table, metric, first, second, generator), levels=levels)
        for metric in metrics_of(results)
        for first, second in pairs_of_methods(results)
    ]


def _concluded(results: ExperimentResults, findings: Sequence[Finding]) -> tuple[Comparison, ...]:
    """Corrects the p values of each family and draws the conclusions, in the order of the findings."""
    shares = families([metric.name for metric in metrics_of(results)], SUCCESS.name)
    comparisons: dict[int, Comparison] = {}
    for of_success, share in zip((True, False), shares, strict=True):
        family = [number for number, found in enumerate(findings) if (found.metric.name == SUCCESS.name) == of_success]
        p_values = corrected([findings[number].p_value for number in family], share)
        without = p_values
        if any(findings[number].without_broken is not None for number in family):
            without = corrected([_p_without_broken(findings[number]) for number in family], share)
        size = sum(value is not None for value in p_values)
        for number, p_value, p_without in zip(family, p_values, without, strict=True):
            comparisons[number] = conclude(results, findings[number], p_value, p_without, share / max(size, 1))
    return tuple(comparisons[number] for number in range(len(findings)))


def _p_without_broken(finding: Finding) -> float | None:
    return finding.p_value if finding.without_broken is None else finding.without_broken.p_value


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
    error = f"{100 * (1 - results.description.confidence):g} %"
    both = families([metric.name for metric in metrics_of(results)], SUCCESS.name) != (1.0, 1.0)
    halves = ", half of it for success and half for all other metrics" if both else ""
    when = (
        "Tests and intervals hold at any time, because a stopping rule looked at the results."
        if results.description.sequential
        else "Tests hold for the planned number of episodes."
    )
    return (
        f"A difference is shown where the test and the interval both say so. {when} With identical methods the "
        f"experiment shows any difference with at most {error}{halves} (Holm's correction, "
        f"{comparisons} comparison{'' if comparisons == 1 else 's'})."
    )
