# SPDX-License-Identifier: BSD-3-Clause
"""Draws the conclusion of a comparison once its p value is corrected: verdict, sentence, what to know beside it.

A difference is shown only where the corrected p value is at most the error rate and the interval, which belongs to the
same statistic, leaves out 0. A fixed experiment claims nothing before its last episode.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from modular_framework_benchmark.records.experiment import MetricKind
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.comparison import Comparison, PairFigures, Verdict
from modular_framework_benchmark.statistics.findings import Finding
from modular_framework_benchmark.statistics.power import fewest_units, pairs_for_rate

PLANNED_RATE, PLANNED_WINS = 0.05, 0.2
"""Win differences that the number of pairs is planned for: 5 points of a rate; 60 % won and 40 % lost of a value."""


@dataclass(frozen=True, slots=True)
class Correction:
    """What the correction for many comparisons made of a comparison.

    Attributes:
        p_value: Corrected p value; None without a test.
        p_without_broken: The same without the pairs of broken episodes.
        error_rate: Error rate of the experiment.
        at_least: Error rate that the comparison has at the least.
    """

    p_value: float | None
    p_without_broken: float | None
    error_rate: float
    at_least: float


def conclude(results: ExperimentResults, finding: Finding, correction: Correction) -> Comparison:
    """Returns the comparison with its verdict.

    Args:
        results: The finished episodes.
        finding: The comparison before the correction.
        correction: What the correction made of it.
    """
    verdict = _verdict(results, finding, correction.p_value, correction)
    without = None
    if finding.without_broken is not None:
        without = _verdict(results, finding.without_broken, correction.p_without_broken, correction)
    needed, planned = _plan(results, finding, verdict, correction.at_least)
    return Comparison(
        **{field.name: getattr(finding, field.name) for field in fields(PairFigures)},
        metric=finding.metric.name,
        unit=finding.metric.unit,
        p_corrected=correction.p_value,
        correction=_correction_text(correction),
        verdict=verdict,
        verdict_without_broken=without,
        pairs_needed=needed,
        difference_planned=planned,
        sentence=sentences.join(finding.levels, _sentence(finding, verdict, needed, planned)),
        notes=_notes(results, finding, (verdict, without), correction),
    )


def unfinished(results: ExperimentResults) -> bool:
    """Returns whether a fixed experiment has episodes left: to look at it now would be to look twice."""
    return len(results.episodes) < results.planned and not results.description.sequential


def _verdict(
    results: ExperimentResults, finding: Finding, p_corrected: float | None, correction: Correction
) -> Verdict:
    if finding.difference is None:
        return Verdict.NO_DATA
    at_any_time = results.description.holds_at_any_time
    if finding.counts.units < fewest_units(correction.at_least, at_any_time):
        return Verdict.NOT_SHOWABLE
    interval = finding.difference.interval
    if unfinished(results) or p_corrected is None or p_corrected > correction.error_rate or interval is None:
        return Verdict.NOT_SHOWN
    if not sentences.ends_outside_zero(interval):
        return Verdict.NOT_SHOWN
    return Verdict.FIRST_BETTER if interval.low > 0.0 else Verdict.SECOND_BETTER


def _sentence(finding: Finding, verdict: Verdict, needed: int | None, planned: float | None) -> str:
    metric, first, second, counts = finding.metric, finding.first, finding.second, finding.counts
    end = "" if needed is None or planned is None else sentences.planned(needed, planned)
    match verdict:
        case Verdict.NO_DATA:
            return sentences.nothing_to_compare(metric, first, second, _reason(finding))
        case Verdict.FIRST_BETTER:
            return sentences.claim(metric, first, second, sentences.figures(metric, finding))
        case Verdict.SECOND_BETTER:
            return sentences.claim(metric, second, first, sentences.figures(metric, finding, swapped=True))
        case Verdict.NOT_SHOWN:
            return sentences.no_claim(metric, first, second, sentences.figures(metric, finding)) + end
        case Verdict.NOT_SHOWABLE:
            return sentences.not_showable(metric, first, second, counts, finding.unit_noun) + end


def _reason(finding: Finding) -> str:
    if finding.counts.missing:
        return f"no pair has a value of both; {finding.counts.missing} pairs are without one"
    return "no two episodes to compare"


def _plan(
    results: ExperimentResults, finding: Finding, verdict: Verdict, error_rate: float
) -> tuple[int | None, float | None]:
    """Returns how many pairs would show which difference; None where that many are there already or it is unknown."""
    open_ones = (Verdict.NOT_SHOWN, Verdict.NOT_SHOWABLE)
    if verdict not in open_ones or results.description.holds_at_any_time or finding.spread is None:
        return None, None
    difference = PLANNED_RATE if finding.metric.kind is MetricKind.RATE else PLANNED_WINS
    units = finding.counts.units
    # Half a decided pair is added, so that a few equal pairs do not promise that no pair is ever decided.
    spread = (finding.spread * units + 0.5) / (units + 1)
    needed = pairs_for_rate(difference, max(round(spread, 3), 0.001), error_rate)
    if needed is None or needed <= units:
        return None, None
    return math.ceil(needed * finding.counts.pairs_per_unit), difference


def _correction_text(correction: Correction) -> str:
    size = round(correction.error_rate / correction.at_least)
    return "none" if size == 1 else f"Holm and Tarone; the least p value counts {size} times"


def _notes(
    results: ExperimentResults, finding: Finding, verdicts: tuple[Verdict, Verdict | None], correction: Correction
) -> tuple[str, ...]:
    """Returns what a reader must know beside the sentence."""
    notes = (_disagreement(finding, verdicts[0], correction), *_counted(finding), _broken(finding, verdicts))
    left = f"unfinished: {len(results.episodes)} of {results.planned} episodes; nothing is claimed before the last one"
    return (*(note for note in notes if note), *((left,) if unfinished(results) else ()))


def _disagreement(finding: Finding, verdict: Verdict, correction: Correction) -> str:
    p_value = correction.p_value
    if verdict is not Verdict.NOT_SHOWN or p_value is None or finding.difference is None:
        return ""
    outside = sentences.ends_outside_zero(finding.difference.interval)
    if outside and p_value > correction.error_rate:
        return f"the interval leaves out 0, but the corrected test does not show a difference (p = {p_value:.2g})"
    if not outside and p_value <= correction.error_rate:
        return f"the test finds a difference (p = {p_value:.2g}), but the interval includes 0"
    return ""


def _counted(finding: Finding) -> tuple[str, ...]:
    counts = finding.counts
    return (
        f"{counts.failed} of {2 * counts.pairs} episodes failed and count as worse than any value"
        if counts.failed
        else "",
        f"{sentences.count(counts.missing, 'pair')} left out because an episode has no value" if counts.missing else "",
        f"{sentences.count(counts.unmatched, 'episode')} without a partner" if counts.unmatched else "",
        f"{counts.pairs} pairs of {sentences.count(counts.units, finding.unit_noun)}: those of one count as one"
        if counts.pairs_per_unit > 1.0
        else "",
    )


def _broken(finding: Finding, verdicts: tuple[Verdict, Verdict | None]) -> str:
    count, without = finding.counts.broken, finding.without_broken
    if not count or without is None:
        return ""
    same = "the same is shown" if verdicts[0] is verdicts[1] else "that is not so"
    text = f" ({sentences.figures(without.metric, without)})" if without.difference else ""
    return f"{sentences.count(count, 'broken episode')} counted as failures; without their pairs {same}{text}"
