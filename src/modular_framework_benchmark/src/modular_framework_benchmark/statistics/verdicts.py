# SPDX-License-Identifier: BSD-3-Clause
"""Draws the conclusion of a comparison once its p value is corrected: verdict, sentence, what to know beside it.

A difference is shown only where the corrected p value is at most the error rate and the interval leaves out 0 on the
same side as the difference. The first keeps the stated error; the second keeps the sentence free of contradictions.
"""

from __future__ import annotations

import math
from dataclasses import fields, replace

from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.comparison import Comparison, Estimate, Interval, PairFigures, Verdict
from modular_framework_benchmark.statistics.findings import Finding
from modular_framework_benchmark.statistics.power import pairs_for_rate, pairs_for_value

PLANNED_RATE = 0.05
"""Difference of rates that the number of pairs is planned for."""
PLANNED_SHARE = 0.1
"""The same for values, as a share of the larger of the two figures."""


def conclude(
    results: ExperimentResults, finding: Finding, p_corrected: float | None, p_without: float | None, share: float
) -> Comparison:
    """Returns the comparison with its verdict.

    Args:
        results: The finished episodes.
        finding: The comparison before the correction.
        p_corrected: Its p value after the correction; None without data.
        p_without: The same without the pairs of broken episodes.
        share: Share of the error rate that the comparison has at the least, for planning.
    """
    error_rate = 1.0 - results.description.confidence
    verdict = _verdict(finding, p_corrected, error_rate)
    without = None if finding.without_broken is None else _verdict(finding.without_broken, p_without, error_rate)
    plannable = verdict is Verdict.NOT_SHOWN and not results.description.sequential
    needed, planned = _plan(finding, error_rate * share) if plannable else (None, None)
    return Comparison(
        **{field.name: getattr(finding, field.name) for field in fields(PairFigures)},
        metric=finding.metric.name,
        unit=finding.metric.unit,
        p_corrected=p_corrected,
        correction=_correction(share),
        verdict=verdict,
        verdict_without_broken=without,
        pairs_needed=needed,
        difference_planned=planned,
        sentence=sentences.join(finding.levels, _sentence(finding, verdict, needed, planned)),
        notes=_notes(results, finding, (verdict, without), p_corrected),
    )


def _verdict(finding: Finding, p_corrected: float | None, error_rate: float) -> Verdict:
    if finding.difference is None:
        return Verdict.NO_DATA
    interval = finding.difference.interval
    if p_corrected is None or p_corrected > error_rate or interval is None:
        return Verdict.NOT_SHOWN
    if not sentences.ends_outside_zero(interval):
        return Verdict.NOT_SHOWN
    higher_is_better = finding.metric.better is Direction.HIGHER
    return Verdict.FIRST_BETTER if (interval.low > 0.0) == higher_is_better else Verdict.SECOND_BETTER


def _sentence(finding: Finding, verdict: Verdict, needed: int | None, planned: float | None) -> str:
    metric, first, second, counts = finding.metric, finding.first, finding.second, finding.counts
    if finding.difference is None:
        return sentences.nothing_to_compare(metric, first, second, _reason(finding))
    match verdict:
        case Verdict.FIRST_BETTER:
            return sentences.claim(metric, first, second, finding.difference, counts)
        case Verdict.SECOND_BETTER:
            return sentences.claim(metric, second, first, _reversed(finding.difference), counts)
        case Verdict.NOT_SHOWN:
            end = "" if needed is None or planned is None else sentences.planned(metric, needed, planned)
            return sentences.no_claim(metric, first, second, finding.difference, counts) + end
        case _:
            raise ValueError(f"verdict {verdict} of a comparison with data; allowed are the other three")


def _reason(finding: Finding) -> str:
    if finding.counts.missing:
        return f"no pair has a value of both; {finding.counts.missing} pairs are without one"
    empty = [
        method
        for method, episodes in (
            (finding.first, finding.counts.first_episodes),
            (finding.second, finding.counts.second_episodes),
        )
        if not episodes
    ]
    return f"no episode of {sentences.listed(empty)} has a value"


def _reversed(difference: Estimate) -> Estimate:
    interval = difference.interval
    if interval is not None:
        interval = Interval(-interval.high, -interval.low, interval.confidence, interval.method)
    return Estimate(difference.name, -difference.value, interval)


def _plan(finding: Finding, error_rate: float) -> tuple[int | None, float | None]:
    """Returns how many pairs would show which difference; None where that many are there already or it is unknown."""
    per_unit, difference = finding.counts.pairs_per_unit, _planned_difference(finding)
    if not finding.spread or not per_unit or not difference:
        return None, None
    if finding.metric.kind is MetricKind.RATE and per_unit == 1.0:
        needed = pairs_for_rate(difference, finding.spread, error_rate)
    else:
        units = pairs_for_value(difference, finding.spread, error_rate)
        needed = None if units is None else math.ceil(units * per_unit)
    return (None, None) if needed is None or needed <= finding.counts.pairs else (needed, difference)


def _planned_difference(finding: Finding) -> float:
    if finding.metric.kind is MetricKind.RATE:
        return PLANNED_RATE
    largest = max(abs(finding.first_estimate or 0.0), abs(finding.second_estimate or 0.0))
    return float(f"{PLANNED_SHARE * largest:.1g}")


def _correction(share: float) -> str:
    size = round(1 / share)
    return "none" if size == 1 else f"Holm; the least p value counts {size} times"


def _notes(
    results: ExperimentResults, finding: Finding, verdicts: tuple[Verdict, Verdict | None], p_corrected: float | None
) -> tuple[str, ...]:
    """Returns what a reader must know beside the sentence."""
    return tuple(
        note
        for note in (
            _disagreement(finding, verdicts[0], p_corrected, 1.0 - results.description.confidence),
            *_counted(finding.metric, finding),
            _broken(finding, verdicts),
            _unfinished(results),
        )
        if note
    )


def _disagreement(finding: Finding, verdict: Verdict, p_corrected: float | None, error_rate: float) -> str:
    if verdict is not Verdict.NOT_SHOWN or p_corrected is None or finding.difference is None:
        return ""
    outside = sentences.ends_outside_zero(finding.difference.interval)
    if outside and p_corrected > error_rate:
        return f"the interval leaves out 0, but the corrected test does not show a difference (p = {p_corrected:.2g})"
    if not outside and p_corrected <= error_rate:
        return f"the test finds a difference (p = {p_corrected:.2g}), but the interval of the mean includes 0"
    return ""


def _counted(metric: Metric, finding: Finding) -> tuple[str, ...]:
    counts = finding.counts
    episodes = counts.first_episodes + counts.second_episodes
    return (
        f"{counts.censored} of {episodes} episodes count at {sentences.limit(metric)}" if counts.censored else "",
        f"{sentences.count(counts.missing, 'pair')} left out because an episode has no value" if counts.missing else "",
        f"{sentences.count(counts.unmatched, 'episode')} without a partner" if counts.unmatched else "",
        f"{counts.pairs} pairs of {counts.units} seeds: pairs of a seed count as one"
        if counts.pairs_per_unit > 1.0
        else "",
    )


def _broken(finding: Finding, verdicts: tuple[Verdict, Verdict | None]) -> str:
    count = finding.counts.broken
    if not count or finding.without_broken is None:
        return sentences.count(count, "broken episode") if count else ""
    without = replace(finding.without_broken, levels="")
    same = "the same is shown" if verdicts[0] is verdicts[1] else "that is not so"
    text = (
        ""
        if without.difference is None
        else f" ({sentences.figures(without.metric, without.difference, without.counts)})"
    )
    return f"{sentences.count(count, 'broken episode')} counted as failures; without their pairs {same}{text}"


def _unfinished(results: ExperimentResults) -> str:
    done = len(results.episodes)
    if done >= results.planned or results.description.sequential:
        return ""
    return f"unfinished: {done} of {results.planned} episodes; the error rate holds for a look at the end only"
