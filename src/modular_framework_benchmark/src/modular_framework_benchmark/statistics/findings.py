# SPDX-License-Identifier: BSD-3-Clause
"""Compares two methods by one metric: chooses the test and the interval that fit, before any correction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from statsmodels.stats.proportion import proportion_effectsize

from modular_framework_benchmark.records.experiment import Metric, MetricKind
from modular_framework_benchmark.statistics import rates, sequential, values
from modular_framework_benchmark.statistics.comparison import Effect, Estimate, Interval, PairCounts, PairFigures
from modular_framework_benchmark.statistics.observations import EpisodeTable, Observations, Pairs

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding(PairFigures):
    """A comparison before the correction for many.

    Attributes:
        metric: What is compared.
        spread: What the number of pairs for a difference depends on: share of pairs that differ (rates with a seed for
            each pair), else standard deviation of the differences of units. None where unpaired.
        without_broken: The same without the pairs of broken episodes; None where there are none.
    """

    metric: Metric
    spread: float | None = None
    without_broken: Finding | None = None


@dataclass(frozen=True, slots=True)
class Settings:
    """How two methods are compared.

    Attributes:
        confidence: Level of the intervals.
        sequential: Whether tests and intervals must hold at any time.
        generator: What resamples are drawn with.
    """

    confidence: float
    sequential: bool
    generator: np.random.Generator


def figure_name(metric: Metric) -> str:
    """Returns what is estimated of a metric."""
    if metric.kind is MetricKind.RATE:
        return "rate"
    return "mean" if metric.limit is None else "restricted mean"


def compare_pair(
    table: EpisodeTable, metric: Metric, first: str, second: str, generator: np.random.Generator
) -> Finding:
    """Returns the comparison of two methods by a metric: paired where there are pairs, otherwise unpaired.

    Args:
        table: The finished episodes.
        metric: What is compared.
        first: One method.
        second: The other.
        generator: What resamples are drawn with.
    """
    description = table.results.description
    settings = Settings(description.confidence, description.sequential, generator)
    matched = table.pairs(metric, first, second)
    if len(matched.first) or matched.missing:
        return _paired(metric, first, second, matched, settings)
    seen = [table.observations(metric, method) for method in (first, second)]
    return _unpaired(metric, first, second, (seen[0], seen[1]), settings)


def _paired(metric: Metric, first: str, second: str, matched: Pairs, settings: Settings) -> Finding:
    if settings.sequential:
        matched = matched.of_complete_units()
    count, differences = len(matched.first), matched.unit_differences()
    counts = PairCounts(
        pairs=count, units=len(differences), first_episodes=count, second_episodes=count,
        unmatched=matched.unmatched, censored=matched.censored, broken=matched.broken_episodes, missing=matched.missing,
    )  # fmt: skip
    finding = Finding(first, second, counts, metric=metric)
    if not count:
        return finding
    p_value, test, interval = _test(metric, matched, differences, settings)
    finding = replace(
        finding,
        first_estimate=float(matched.first.mean()),
        second_estimate=float(matched.second.mean()),
        difference=Estimate(figure_name(metric), float(np.mean(matched.first - matched.second)), interval),
        p_value=p_value,
        test=test,
        effect=_effect(metric, matched.first, matched.second),
        improvement=values.improvement(matched.first, matched.second, metric.better),
        spread=_spread(metric, matched, differences),
    )
    if not matched.broken.any():
        return finding
    return replace(finding, without_broken=_paired(metric, first, second, matched.without_broken(), settings))


def _test(
    metric: Metric, matched: Pairs, differences: Floats, settings: Settings
) -> tuple[float, str, Interval | None]:
    """Returns the p value, the test's name and the interval of a paired difference."""
    rate, alone = metric.kind is MetricKind.RATE, len(differences) == len(matched.first)
    if settings.sequential:
        return _test_at_any_time(metric, matched, differences, settings)
    if rate and alone:
        outcomes = rates.Discordance.of(matched.first, matched.second)
        found = rates.paired_interval(outcomes, settings.confidence)
        return rates.paired_p_value(outcomes), "McNemar's exact test", found
    interval = values.mean_interval(differences, matched.unit_strata(), settings.confidence, settings.generator)
    if rate:
        interval = interval and replace(interval, low=max(interval.low, -1.0), high=min(interval.high, 1.0))
        return values.sign_flip_p_value(differences, settings.generator), "sign flip test of seeds", interval
    return values.paired_p_value(differences), "Wilcoxon signed rank test", interval


def _test_at_any_time(
    metric: Metric, matched: Pairs, differences: Floats, settings: Settings
) -> tuple[float, str, Interval | None]:
    if metric.kind is MetricKind.RATE:
        p_value = sequential.anytime_p_value(differences)
        return p_value, "betting test, valid at any time", sequential.anytime_interval(differences, settings.confidence)
    p_value = sequential.anytime_p_value(np.sign(differences))
    test = "betting sign test, valid at any time"
    if len(differences) < 2:
        return p_value, test, None
    return p_value, test, sequential.asymptotic_interval(differences, settings.confidence)


def _unpaired(
    metric: Metric, first: str, second: str, seen: tuple[Observations, Observations], settings: Settings
) -> Finding:
    kept = [each.values[~np.isnan(each.values)] for each in seen]
    counts = PairCounts(
        pairs=0, units=0, first_episodes=len(kept[0]), second_episodes=len(kept[1]), unmatched=0,
        censored=int(sum(each.censored.sum() for each in seen)), broken=int(sum(each.broken.sum() for each in seen)),
        missing=0,
    )  # fmt: skip
    finding = Finding(first, second, counts, metric=metric)
    if not len(kept[0]) or not len(kept[1]):
        return finding
    interval: Interval | None
    if metric.kind is MetricKind.RATE:
        one, other = ((int(each.sum()), len(each)) for each in kept)
        p_value, test = rates.unpaired_p_value(one, other), rates.unpaired_test_name(len(kept[0]) + len(kept[1]))
        interval = rates.unpaired_interval(one, other, settings.confidence)
    else:
        p_value, test = values.unpaired_p_value(*kept), "Mann-Whitney U test"
        interval = values.unpaired_interval(kept[0], kept[1], settings.confidence)
    return replace(
        finding,
        first_estimate=float(kept[0].mean()),
        second_estimate=float(kept[1].mean()),
        difference=Estimate(figure_name(metric), float(kept[0].mean() - kept[1].mean()), interval),
        p_value=None if settings.sequential else p_value,
        test="none holds at any time without pairs" if settings.sequential else test,
        improvement=values.unpaired_improvement(kept[0], kept[1], metric.better),
    )


def _effect(metric: Metric, first: Floats, second: Floats) -> Effect:
    if metric.kind is MetricKind.RATE:
        return Effect("Cohen's h", float(proportion_effectsize(first.mean(), second.mean())))
    return values.rank_biserial(first - second)


def _spread(metric: Metric, matched: Pairs, differences: Floats) -> float | None:
    count = len(differences)
    if metric.kind is MetricKind.RATE and count == len(matched.first):
        # Half a pair that differs is added, so that a few equal pairs do not promise that no pair ever differs.
        return (float(np.sum(matched.first != matched.second)) + 0.5) / (count + 1)
    return float(np.std(differences, ddof=1)) if count > 1 else None
