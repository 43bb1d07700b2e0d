# SPDX-License-Identifier: BSD-3-Clause
"""Draws the conclusion of a comparison after the multiplicity correction: result, sentence and notes.

A difference is shown only if the corrected p value is at most the error rate and the interval of the same statistic
excludes 0. A fixed experiment claims nothing before its last episode.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from modular_framework_benchmark.records.experiment import MetricKind
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.comparison import Comparison, PairFigures, Verdict
from modular_framework_benchmark.statistics.findings import Finding
from modular_framework_benchmark.statistics.power import min_units, pairs_for_rate

PLANNED_RATE, PLANNED_WINS = 0.05, 0.2
"""Win differences for which sample sizes are planned: 5 points of a rate; 60 % won and 40 % lost pairs of a value."""

UNLIKE = "only one episode is the first of its stack, or the numbers of workers differ"


@dataclass(frozen=True, slots=True)
class Correction:
    """Result of the multiplicity correction for a comparison.

    Attributes:
        p_value: Corrected p value; None without a test.
        p_without_broken: Corrected p value without the pairs of broken or invalid episodes.
        error_rate: Error rate of the experiment.
        strictest_level: Level of the strictest Holm step.
    """

    p_value: float | None
    p_without_broken: float | None
    error_rate: float
    strictest_level: float


def conclude_comparison(results: ExperimentResults, finding: Finding, correction: Correction) -> Comparison:
    """Returns the comparison with its verdict.

    Args:
        results: Finished episodes.
        finding: Comparison before the multiplicity correction.
        correction: Result of the multiplicity correction.
    """
    verdict = _verdict(results, finding, correction.p_value, correction)
    without = None
    if finding.without_broken is not None:
        without = _verdict(results, finding.without_broken, correction.p_without_broken, correction)
    needed, planned = _planned_pairs(results, finding, verdict, correction.strictest_level)
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
        sentence=sentences.with_levels(finding.levels, _sentence(finding, verdict, needed, planned)),
        notes=_notes(results, finding, (verdict, without), correction),
    )


def is_unfinished(results: ExperimentResults) -> bool:
    """Returns whether a fixed experiment has remaining episodes, so that a conclusion would be an interim analysis."""
    return len(results.episodes) < results.planned and not results.description.sequential


def _verdict(
    results: ExperimentResults, finding: Finding, p_corrected: float | None, correction: Correction
) -> Verdict:
    if finding.difference is None:
        return Verdict.NO_DATA
    at_any_time = results.description.holds_at_any_time
    if finding.counts.units < min_units(correction.strictest_level, at_any_time):
        return Verdict.NOT_SHOWABLE
    interval = finding.difference.interval
    if is_unfinished(results) or p_corrected is None or p_corrected > correction.error_rate or interval is None:
        return Verdict.NOT_SHOWN
    if not sentences.ends_outside_zero(interval):
        return Verdict.NOT_SHOWN
    return Verdict.FIRST_BETTER if interval.low > 0.0 else Verdict.SECOND_BETTER


def _sentence(finding: Finding, verdict: Verdict, needed: int | None, planned: float | None) -> str:
    metric, first, second, counts = finding.metric, finding.first, finding.second, finding.counts
    ending = "" if needed is None or planned is None else sentences.planned_pairs_text(needed, planned)
    match verdict:
        case Verdict.NO_DATA:
            return sentences.nothing_to_compare(metric, first, second, _reason(finding))
        case Verdict.FIRST_BETTER:
            return sentences.claim_sentence(metric, first, second, sentences.comparison_figures_text(metric, finding))
        case Verdict.SECOND_BETTER:
            return sentences.claim_sentence(
                metric, second, first, sentences.comparison_figures_text(metric, finding, swapped=True)
            )
        case Verdict.NOT_SHOWN:
            return (
                sentences.no_claim_sentence(metric, first, second, sentences.comparison_figures_text(metric, finding))
                + ending
            )
        case Verdict.NOT_SHOWABLE:
            return sentences.not_showable(metric, first, second, counts, finding.unit_noun) + ending


def _reason(finding: Finding) -> str:
    if finding.counts.missing:
        return f"no pair has both values; {finding.counts.missing} pairs lack a value"
    if finding.counts.unlike:
        return f"in each of {finding.counts.unlike} pairs, {UNLIKE}"
    return "no two episodes to compare"


def _planned_pairs(
    results: ExperimentResults, finding: Finding, verdict: Verdict, error_rate: float
) -> tuple[int | None, float | None]:
    """Returns the number of pairs needed for the planned difference, or None if the sample is large enough."""
    undecided = (Verdict.NOT_SHOWN, Verdict.NOT_SHOWABLE)
    if verdict not in undecided or results.description.holds_at_any_time or finding.discordance is None:
        return None, None
    difference = PLANNED_RATE if finding.metric.kind is MetricKind.RATE else PLANNED_WINS
    units = finding.counts.units
    # Adding half a discordant pair prevents a small sample of ties from predicting that all pairs tie.
    discordance = (finding.discordance * units + 0.5) / (units + 1)
    needed = pairs_for_rate(difference, max(round(discordance, 3), 0.001), error_rate)
    if needed is None or needed <= units:
        return None, None
    return math.ceil(needed * finding.counts.pairs_per_unit), difference


def _correction_text(correction: Correction) -> str:
    size = round(correction.error_rate / correction.strictest_level)
    return "none" if size == 1 else f"Holm and Tarone; the least p value counts {size} times"


def _notes(
    results: ExperimentResults, finding: Finding, verdicts: tuple[Verdict, Verdict | None], correction: Correction
) -> tuple[str, ...]:
    """Returns the notes that qualify the sentence."""
    notes = (
        _disagreement(finding, verdicts[0], correction),
        *_exclusions(finding),
        _broken_note(finding, verdicts),
    )
    remaining = (
        f"unfinished: {len(results.episodes)} of {results.planned} episodes; nothing is claimed before the last episode"
    )
    return (*(note for note in notes if note), *((remaining,) if is_unfinished(results) else ()))


def _disagreement(finding: Finding, verdict: Verdict, correction: Correction) -> str:
    p_value = correction.p_value
    if verdict is not Verdict.NOT_SHOWN or p_value is None or finding.difference is None:
        return ""
    outside = sentences.ends_outside_zero(finding.difference.interval)
    if outside and p_value > correction.error_rate:
        return f"the interval excludes 0, but the corrected test does not show a difference (p = {p_value:.2g})"
    if not outside and p_value <= correction.error_rate:
        return f"the test finds a difference (p = {p_value:.2g}), but the interval includes 0"
    return ""


def _exclusions(finding: Finding) -> tuple[str, ...]:
    counts = finding.counts
    return (
        f"{counts.failed} of {2 * counts.pairs} episodes failed and count as worse than any value"
        if counts.failed
        else "",
        f"{sentences.quantity_text(counts.missing, 'pair')} left out because an episode has no value"
        if counts.missing
        else "",
        f"{sentences.quantity_text(counts.unlike, 'pair')} left out because {UNLIKE}" if counts.unlike else "",
        f"{sentences.quantity_text(counts.unmatched, 'episode')} without a partner" if counts.unmatched else "",
        f"{counts.pairs} pairs of {sentences.quantity_text(counts.units, finding.unit_noun)}; "
        "all pairs of a unit count as one"
        if counts.pairs_per_unit > 1.0
        else "",
    )


def _broken_note(finding: Finding, verdicts: tuple[Verdict, Verdict | None]) -> str:
    count, without = finding.counts.broken, finding.without_broken
    if not count or without is None:
        return ""
    effect = "the verdict is the same" if verdicts[0] is verdicts[1] else "the verdict changes"
    text = f" ({sentences.comparison_figures_text(without.metric, without)})" if without.difference else ""
    episodes = sentences.quantity_text(count, "broken or invalid episode")
    return f"{episodes} counted as failures; without their pairs {effect}{text}"
