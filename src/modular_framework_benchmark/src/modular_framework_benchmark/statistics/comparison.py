# SPDX-License-Identifier: BSD-3-Clause
"""What the statistics say of an experiment: a summary of each method, a comparison of each pair of methods.

Plain numbers and words (no NumPy scalars), so that they can be written to JSON; what cannot be computed is None.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """What a comparison shows."""

    FIRST_BETTER = "first_better"
    SECOND_BETTER = "second_better"
    NOT_SHOWN = "not_shown"  # compared, and no difference was shown
    NOT_SHOWABLE = "not_showable"  # too few units to show a difference, whatever they had given
    NO_DATA = "no_data"  # nothing to compare


@dataclass(frozen=True, slots=True)
class Interval:
    """A confidence interval.

    Attributes:
        low: Lower end, in the unit of the figure.
        high: Upper end, in the unit of the figure.
        confidence: Its level, such as 0.95.
        method: How it was computed, in words: `Clopper-Pearson`.
    """

    low: float
    high: float
    confidence: float
    method: str


@dataclass(frozen=True, slots=True)
class Estimate:
    """A figure with its interval.

    Attributes:
        name: What is estimated: `rate`, `median`, `mean`, `restricted mean`, `win difference`.
        value: The figure, in the metric's unit; a rate from 0 to 1. Infinite for a median that is a failure.
        interval: Its interval; None where it has none.
    """

    name: str
    value: float
    interval: Interval | None


@dataclass(frozen=True, slots=True)
class EpisodeCounts:
    """How the episodes of a method ended and what became of them in the figures of a metric.

    Attributes:
        episodes: Finished episodes, broken ones included.
        succeeded: Those that succeeded.
        failed: Those that ran to their end without success.
        timed_out: Those that did not end within the time limit.
        broken: Those whose launch died or whose measurement failed. In rates and in metrics with a limit they count as
            failures.
        counted: Those with a value of the metric, the ones at the limit included.
        censored: Those that count at the metric's limit.
        missing: Those without a value, which are in none of the figures.
        units: Independent units of those that are counted: problems, scenes or seeds.
    """

    episodes: int
    succeeded: int
    failed: int
    timed_out: int
    broken: int
    counted: int
    censored: int
    missing: int
    units: int

    @property
    def unmeasured_share(self) -> float | None:
        """Share of the episodes without a value within the limit, from 0 to 1; None without episodes."""
        return (self.missing + self.censored) / self.episodes if self.episodes else None


@dataclass(frozen=True, slots=True)
class MethodSummary:
    """A metric of a method.

    Attributes:
        method: Level of the compared factor.
        metric: Name of the metric.
        unit: Its unit; "" for none and for rates.
        levels: Levels of other factors that it was restricted to: `object=can`; "" for all.
        counts: How the episodes ended.
        estimate: Rate, or median with failures worse than any value; None without data.
        mean: Mean, or restricted mean of a metric with a limit; None for rates and without data.
        quartiles: First and third quartile of the values; None for rates and without data.
        sentence: The estimate in words.
    """

    method: str
    metric: str
    unit: str
    levels: str
    counts: EpisodeCounts
    estimate: Estimate | None
    mean: Estimate | None
    quartiles: tuple[float, float] | None
    sentence: str


@dataclass(frozen=True, slots=True)
class PairCounts:
    """What was compared.

    Attributes:
        pairs: Pairs of episodes: same trial, same levels of the other factors.
        units: Independent parts of the pairs: pairs that share a problem or a seed are one unit.
        won: Pairs in which the first method was better.
        lost: Pairs in which the second was.
        failed: Compared episodes that count as worse than any value.
        broken: Compared episodes that are broken.
        missing: Pairs left out because an episode has no value of the metric.
        unmatched: Finished episodes of either method whose partner is not finished or not planned.
        at_random: Whether the pairs share nothing but their levels, because no two episodes have the same trial.
    """

    pairs: int
    units: int
    won: int
    lost: int
    failed: int
    broken: int
    missing: int
    unmatched: int
    at_random: bool

    @property
    def pairs_per_unit(self) -> float:
        """Mean number of pairs of a unit; 0 without pairs."""
        return self.pairs / self.units if self.units else 0.0


@dataclass(frozen=True, slots=True)
class PairFigures:
    """The figures of a pair of methods by a metric.

    Attributes:
        first: One level of the compared factor.
        second: The other level.
        counts: What was compared.
        levels: Levels of other factors that it was restricted to: `object=can`; "" for all.
        unit_noun: What a unit is: `problem`, `scene`, `seed`.
        first_estimate: Rate or median of the first method over the pairs; None without data.
        second_estimate: That of the second.
        difference: Win difference, from -1 to 1, with its interval: the share of pairs in which the first is better
            minus that in which the second is, one mean a unit. For a rate that is the difference of the rates, towards
            the better one. None without data.
        mean_difference: First minus second mean of the values of the pairs, in the metric's unit: a description
            without a verdict. None for rates and without data.
        p_value: P value of the test; None without data and with too few units.
        test: Name of the test.
    """

    first: str
    second: str
    counts: PairCounts
    levels: str = ""
    unit_noun: str = "seed"
    first_estimate: float | None = None
    second_estimate: float | None = None
    difference: Estimate | None = None
    mean_difference: Estimate | None = None
    p_value: float | None = None
    test: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison(PairFigures):
    """A pair of methods by a metric, with what it shows.

    Attributes:
        metric: Name of the metric.
        unit: Its unit; "" for none and for rates.
        p_corrected: The p value after the correction for many comparisons; None without data.
        correction: The correction, in words: `Holm, 6 comparisons`.
        verdict: What is shown: a difference only where the corrected p value and the interval both say so.
        verdict_without_broken: The same with the pairs of broken episodes left out; None where there are none.
        pairs_needed: How many pairs in all would show `difference_planned` with 80 % power; None if already there or
            unknown.
        difference_planned: The win difference which `pairs_needed` is for.
        sentence: The result in words, one sentence.
        notes: What a reader must know beside it: censored, missing, broken, unfinished.
    """

    metric: str
    unit: str
    p_corrected: float | None
    correction: str
    verdict: Verdict
    verdict_without_broken: Verdict | None
    pairs_needed: int | None
    difference_planned: float | None
    sentence: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Analysis:
    """The statistics of an experiment.

    Attributes:
        methods: The methods, as in the experiment file.
        metrics: The metrics by name, the task's success first.
        summaries: Each method by each metric.
        comparisons: Each pair of methods by each metric, over all levels of the other factors.
        sentences: The main results in words, the most important first.
        rule: What the verdicts rest on, in words: test, correction, error rate, sequential or not.
        scope: What the claims speak for: the units, their number, and the levels.
    """

    methods: tuple[str, ...]
    metrics: tuple[str, ...]
    summaries: tuple[MethodSummary, ...]
    comparisons: tuple[Comparison, ...]
    sentences: tuple[str, ...]
    rule: str
    scope: str
