# SPDX-License-Identifier: BSD-3-Clause
"""Says the statistics in words: one sentence for each comparison and each summary."""

from __future__ import annotations

import math
from collections.abc import Sequence

from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind
from modular_framework_benchmark.statistics.comparison import EpisodeCounts, Estimate, Interval, PairCounts


def claim(metric: Metric, better: str, worse: str, difference: Estimate, counts: PairCounts) -> str:
    """Returns the sentence of a difference that is shown.

    Args:
        metric: What was compared.
        better: Method that is better.
        worse: The other one.
        difference: Better minus worse.
        counts: What was compared.
    """
    return f"{better} {_comparative(metric, difference.value)} {worse} ({figures(metric, difference, counts)})"


def no_claim(metric: Metric, first: str, second: str, difference: Estimate, counts: PairCounts) -> str:
    """Returns the sentence of a difference that is not shown; the arguments are those of `claim`."""
    corrected = ", corrected for all comparisons" if ends_outside_zero(difference.interval) else ""
    between = f"{first} and {second}{corrected}"
    return f"no difference in {words(metric)} shown between {between} ({figures(metric, difference, counts)})"


def nothing_to_compare(metric: Metric, first: str, second: str, reason: str) -> str:
    """Returns the sentence of a comparison without data."""
    return f"nothing to compare between {first} and {second} in {words(metric)}: {reason}"


def planned(metric: Metric, pairs: int, difference: float) -> str:
    """Returns the end of a sentence on how many pairs would show a difference."""
    rate = metric.kind is MetricKind.RATE
    of_value = f"{difference:g} {metric.unit}" if metric.unit else f"a difference of {difference:g}"
    text = f"{100 * difference:g} points" if rate else of_value
    return f"; {pairs} paired episodes would show {text}"


def figures(metric: Metric, difference: Estimate, counts: PairCounts) -> str:
    """Returns a difference, its interval and the number of episodes, as in brackets behind a statement."""
    interval = difference.interval
    if interval is None:
        return f"{amount(metric, difference.value, signed=True)}, no interval, {_episodes(counts)}"
    scale = 100.0 if metric.kind is MetricKind.RATE else 1.0
    digits = _digits(scale * interval.low, scale * interval.high)
    low, high = (_number(scale * end, digits) for end in (interval.low, interval.high))
    return (
        f"{amount(metric, difference.value, signed=True, digits=digits)}, {100 * interval.confidence:.3g} % interval "
        f"{low} to {high}, {_episodes(counts)}"
    )


def summary(metric: Metric, method: str, estimate: Estimate | None, counts: EpisodeCounts) -> str:
    """Returns the sentence of a method's summary."""
    if estimate is None:
        reason = f"none of {count(counts.episodes, 'episode')} has a value" if counts.episodes else "no episodes"
        return f"{method}: no {words(metric)} ({reason})"
    scale = 100.0 if metric.kind is MetricKind.RATE else 1.0
    unit = " %" if metric.kind is MetricKind.RATE else f" {metric.unit}".rstrip()
    interval, spread = estimate.interval, "no interval"
    digits = _digits(0.0, scale * estimate.value)
    if interval is not None:
        digits = _digits(scale * interval.low, scale * interval.high)
        low, high = (_number(scale * end, digits) for end in (interval.low, interval.high))
        spread = f"{100 * interval.confidence:.3g} % interval {low} to {high}"
    of = "" if metric.kind is MetricKind.RATE else f" {estimate.name} of"
    return (
        f"{method}:{of} {words(metric)} {_number(scale * estimate.value, digits)}{unit} ({spread}, "
        f"{count(counts.counted, 'episode')}{_remarks(metric, counts)})"
    )


def words(metric: Metric) -> str:
    """Returns the name of a metric in words."""
    return metric.name.replace("_", " ")


def amount(metric: Metric, value: float, *, signed: bool = False, digits: int | None = None) -> str:
    """Returns a difference with its unit: `+12 points`, `-0.31 s`."""
    rate = metric.kind is MetricKind.RATE
    scaled = 100.0 * value if rate else value
    text = _number(scaled, _digits(0.0, scaled) if digits is None else digits)
    sign = "+" if signed and not text.startswith("-") and float(text) != 0.0 else ""
    unit = ("point" if text in ("1", "-1") else "points") if rate else metric.unit
    return f"{sign}{text} {unit}".rstrip()


def limit(metric: Metric) -> str:
    """Returns the limit of a metric in words: `the limit of 60 s`."""
    return "the limit" if metric.limit is None else f"the limit of {metric.limit:g} {metric.unit}".rstrip()


def ends_outside_zero(interval: Interval | None) -> bool:
    """Returns whether an interval leaves out 0."""
    return interval is not None and (interval.low > 0.0 or interval.high < 0.0)


def join(levels: str, sentence: str) -> str:
    """Returns a sentence with the levels it is restricted to in front."""
    return f"{levels}: {sentence}" if levels else sentence


def listed(parts: Sequence[str]) -> str:
    """Returns parts as a list in words."""
    return ", ".join(parts[:-1]) + (" and " if len(parts) > 1 else "") + parts[-1] if parts else ""


def _comparative(metric: Metric, difference: float) -> str:
    if metric.name == "success":
        return "succeeds more often than"
    if metric.kind is MetricKind.RATE:
        return f"has a {'higher' if difference > 0 else 'lower'} rate of {words(metric)} than"
    if metric.kind is MetricKind.COUNT:
        return f"has {'more' if difference > 0 else 'fewer'} {words(metric)} than"
    if metric.kind is MetricKind.TIME:
        return f"has a {'longer' if difference > 0 else 'shorter'} {words(metric)} than"
    return f"has a {'higher' if metric.better is Direction.HIGHER else 'lower'} {words(metric)} than"


def _episodes(counts: PairCounts) -> str:
    if not counts.pairs:
        return f"{counts.first_episodes} and {counts.second_episodes} unpaired episodes"
    of_seeds = f" of {count(counts.units, 'seed')}" if counts.units < counts.pairs else ""
    return f"{count(counts.pairs, 'paired episode')}{of_seeds}"


def _remarks(metric: Metric, counts: EpisodeCounts) -> str:
    parts = [
        f"{counts.censored} at {limit(metric)}" if counts.censored else "",
        f"{counts.missing} without a value" if counts.missing else "",
        f"{counts.broken} broken" if counts.broken else "",
    ]
    return "".join(f", {part}" for part in parts if part)


def count(number: int, noun: str) -> str:
    """Returns a number of things in words."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _digits(low: float, high: float) -> int:
    """Returns how many decimals show the width of an interval with two digits, and none of its ends as a wrong 0."""
    width = abs(high - low)
    if width == 0.0 or not math.isfinite(width):
        return 2
    digits = 1 - math.floor(math.log10(width))
    for end in (low, high):
        if end != 0.0 and abs(end) < 0.5 * 10.0**-digits and abs(end) > 1e-9 * width:
            digits = max(digits, min(-math.floor(math.log10(abs(end))), digits + 2))
    return max(digits, 0)


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text
