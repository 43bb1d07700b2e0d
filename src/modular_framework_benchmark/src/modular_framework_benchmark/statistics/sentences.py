# SPDX-License-Identifier: BSD-3-Clause
"""Sentences of the report: one per comparison and one per summary."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind
from modular_framework_benchmark.statistics.comparison import EpisodeCounts, Estimate, Interval, PairCounts, PairFigures


def claim_sentence(metric: Metric, better: str, worse: str, figures_text: str) -> str:
    """Returns the sentence for a difference that is shown.

    Args:
        metric: Compared metric.
        better: Better method.
        worse: Other method.
        figures_text: Text of the figures, from `comparison_figures_text`.
    """
    return f"{better} {_comparative(metric)} {worse} ({figures_text})"


def no_claim_sentence(metric: Metric, first: str, second: str, figures_text: str) -> str:
    """Returns the sentence for a comparison without a shown difference.

    Args:
        metric: Compared metric.
        first: First method.
        second: Second method.
        figures_text: Text of the figures, from `comparison_figures_text`.
    """
    return f"no difference in {spaced_name(metric)} shown between {first} and {second} ({figures_text})"


def not_showable(metric: Metric, first: str, second: str, counts: PairCounts, noun: str) -> str:
    """Returns the sentence for a comparison with too few units to show any difference.

    Args:
        metric: Compared metric.
        first: First method.
        second: Second method.
        counts: Pairs of the comparison.
        noun: Name of a unit.
    """
    units = quantity_text(counts.units, "pair" if counts.units == counts.pairs else noun)
    return (
        f"a difference in {spaced_name(metric)} between {first} and {second} could not have been shown with {units} "
        f"({counts.won} won, {counts.lost} lost)"
    )


def nothing_to_compare(metric: Metric, first: str, second: str, reason: str) -> str:
    """Returns the sentence for a comparison without data.

    Args:
        metric: Compared metric.
        first: First method.
        second: Second method.
        reason: Reason of the missing data.
    """
    return f"nothing to compare between {first} and {second} in {spaced_name(metric)}: {reason}"


def planned_pairs_text(pairs: int, difference: float) -> str:
    """Returns the end of a sentence that gives the number of pairs needed for a win difference."""
    return f"; {pairs} paired episodes would show {100 * difference:g} points"


def comparison_figures_text(metric: Metric, comparison: PairFigures, swapped: bool = False) -> str:
    """Returns the win difference, its interval and the number of pairs, as text for parentheses.

    Args:
        metric: Compared metric.
        comparison: Figures of the comparison.
        swapped: Whether the sentence names the second method first.
    """
    if comparison.difference is None:
        return "no data"
    sign, counts, interval = -1.0 if swapped else 1.0, comparison.counts, comparison.difference.interval
    # For a rate whose lower values are better, the difference of the rates has the opposite sign of the wins.
    if metric.kind is MetricKind.RATE and metric.better is Direction.LOWER:
        sign = -sign
    parts = []
    if metric.kind is not MetricKind.RATE:
        won, lost = (counts.lost, counts.won) if swapped else (counts.won, counts.lost)
        parts = [f"{won} pairs won, {lost} lost"]
    digits = 0 if interval is None else max(_digits(100 * interval.low, 100 * interval.high) - 1, 0)
    parts.append(_points_text(100 * sign * comparison.difference.value, digits))
    if interval is not None:
        ends = sorted(100 * sign * end for end in (interval.low, interval.high))
        low, high = (_number(end, digits) for end in ends)
        parts.append(f"{100 * interval.confidence:.3g} % interval {low} to {high}")
    parts.append(_episodes(counts, comparison.unit_noun))
    if comparison.mean_difference is not None:
        value = (-1.0 if swapped else 1.0) * comparison.mean_difference.value
        parts.append(f"mean difference {signed_amount(metric, value)}")
    return ", ".join(parts)


def summary_sentence(metric: Metric, method: str, estimate: Estimate | None, counts: EpisodeCounts) -> str:
    """Returns the sentence that summarises a metric of a method.

    Args:
        metric: Metric to summarise.
        method: Name of the method.
        estimate: Estimate of the metric; None without a value.
        counts: Counts of the method's episodes.
    """
    if estimate is None:
        reason = (
            f"none of {quantity_text(counts.episodes, 'episode')} has a value" if counts.episodes else "no episodes"
        )
        return f"{method}: no {spaced_name(metric)} ({reason})"
    scale = 100.0 if metric.is_fraction else 1.0
    unit = " %" if metric.is_fraction else f" {metric.unit}".rstrip()
    interval, interval_text = estimate.interval, "no interval"
    digits = _digits(0.0, scale * estimate.value)
    if interval is not None:
        digits = _digits(scale * interval.low, scale * interval.high)
        low, high = (_number(scale * end, digits) for end in (interval.low, interval.high))
        interval_text = f"{100 * interval.confidence:.3g} % interval {low} to {high}"
    prefix = "" if metric.kind is MetricKind.RATE else f" {estimate.name} of"
    return (
        f"{method}:{prefix} {spaced_name(metric)} {_number(scale * estimate.value, digits)}{unit} ({interval_text}, "
        f"{quantity_text(counts.counted, 'episode')}{_remarks(counts)})"
    )


def needed_episodes(metric: Metric, mean: str, episodes: Mapping[str, int]) -> str:
    """Returns the sentence with the numbers of episodes that a mean needs for an interval.

    Args:
        metric: Metric of the mean.
        mean: Name of the mean.
        episodes: Number of episodes by method.
    """
    needed = enumeration([f"{quantity_text(number, 'episode')} of {method}" for method, number in episodes.items()])
    return f"For an interval, the {mean} of the {spaced_name(metric)} needs about {needed}."


def spaced_name(metric: Metric) -> str:
    """Returns the name of a metric with spaces for underscores."""
    return metric.name.replace("_", " ")


def signed_amount(metric: Metric, value: float) -> str:
    """Returns a signed difference with its unit: `-0.31 s`, `+12 points`."""
    if metric.is_fraction:
        return _points_text(100.0 * value, max(_digits(0.0, 100.0 * value) - 1, 0))
    text = _number(value, _digits(0.0, value))
    sign = "+" if not text.startswith("-") and float(text) != 0.0 else ""
    return f"{sign}{text} {metric.unit}".rstrip()


def _points_text(value: float, digits: int) -> str:
    text = _number(value, digits)
    sign = "+" if not text.startswith("-") and float(text) != 0.0 else ""
    return f"{sign}{text} {'point' if text in ('1', '-1') else 'points'}"


def ends_outside_zero(interval: Interval | None) -> bool:
    """Returns whether an interval excludes 0."""
    return interval is not None and (interval.low > 0.0 or interval.high < 0.0)


def with_levels(levels: str, sentence: str) -> str:
    """Returns a sentence with its restriction to levels in front."""
    return f"{levels}: {sentence}" if levels else sentence


def enumeration(parts: Sequence[str]) -> str:
    """Returns the parts as an enumeration: `a, b and c`."""
    return ", ".join(parts[:-1]) + (" and " if len(parts) > 1 else "") + parts[-1] if parts else ""


def _comparative(metric: Metric) -> str:
    """Returns the verb phrase of a claim, such as `succeeds more often than`."""
    higher = metric.better is Direction.HIGHER
    if metric.name == "success":
        return "succeeds more often than"
    if metric.kind is MetricKind.RATE:
        return f"has a {'higher' if higher else 'lower'} rate of {spaced_name(metric)} than"
    adjectives = {MetricKind.COUNT: ("more", "fewer"), MetricKind.TIME: ("the longer", "the shorter")}
    better, worse = adjectives.get(metric.kind, ("the higher", "the lower"))
    return f"more often has {better if higher else worse} {spaced_name(metric)} than"


def _episodes(counts: PairCounts, noun: str) -> str:
    pairs = quantity_text(counts.pairs, "pair of any two episodes" if counts.at_random else "paired episode")
    return f"{pairs} of {quantity_text(counts.units, noun)}" if counts.units < counts.pairs else pairs


def _remarks(counts: EpisodeCounts) -> str:
    parts = [
        f"{counts.missing} without a value" if counts.missing else "",
        f"{counts.broken} broken" if counts.broken else "",
        f"{counts.invalid} invalid" if counts.invalid else "",
    ]
    return "".join(f", {part}" for part in parts if part)


def quantity_text(number: int, noun: str) -> str:
    """Returns a number with its noun; the plural applies to the first word of `noun`."""
    first, space, rest = noun.partition(" of ")
    return f"{number} {first}{'' if number == 1 else 's'}{space}{rest}"


def _digits(low: float, high: float) -> int:
    """Returns the decimals that show an interval's width with two digits and no nonzero end as 0."""
    width = abs(high - low)
    if width == 0.0 or not math.isfinite(width):
        return 2
    digits = 1 - math.floor(math.log10(width))
    for end in (low, high):
        if end != 0.0 and abs(end) < 0.5 * 10.0**-digits and abs(end) > 1e-9 * width:
            digits = max(digits, min(-math.floor(math.log10(abs(end))), digits + 2))
    return max(digits, 0)


def _number(value: float, digits: int) -> str:
    if math.isinf(value):
        return "a failure"
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text
