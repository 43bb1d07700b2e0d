# SPDX-License-Identifier: BSD-3-Clause
"""Results of the statistical analysis: method summaries and comparisons of pairs of methods.

Numbers are Python numbers, so that the report writes them as JSON. A figure that cannot be computed is None.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """Conclusion of a comparison."""

    FIRST_BETTER = "first_better"
    SECOND_BETTER = "second_better"
    NOT_SHOWN = "not_shown"  # tested without showing a difference
    NOT_SHOWABLE = "not_showable"  # too few units to show any difference
    NO_DATA = "no_data"  # no pairs


@dataclass(frozen=True, slots=True)
class Interval:
    """A confidence interval.

    Attributes:
        low: Lower end, in the unit of the figure.
        high: Upper end, in the unit of the figure.
        confidence: Confidence level, such as 0.95.
        method: Name of the method that computes the interval, such as `Clopper-Pearson`.
    """

    low: float
    high: float
    confidence: float
    method: str


@dataclass(frozen=True, slots=True)
class Estimate:
    """An estimate with its confidence interval.

    Attributes:
        name: Estimand: `rate`, `median`, `mean`, `restricted mean` or `win difference`.
        value: Estimate in the metric's unit; a rate is from 0 to 1, a median that is a failure is infinite.
        interval: Confidence interval, or None if none can be computed.
        needed_episodes: Number of episodes with which an interval is expected; None if the number is unknown or the
            estimate has an interval.
    """

    name: str
    value: float
    interval: Interval | None
    needed_episodes: int | None = None


@dataclass(frozen=True, slots=True)
class EpisodeCounts:
    """Numbers of a method's episodes by outcome and by their part in the figures of a metric.

    Attributes:
        episodes: Finished episodes, including broken ones.
        succeeded: Successful episodes.
        failed: Episodes that ended without success.
        timed_out: Episodes that exceeded the time limit.
        broken: Episodes whose launch died or whose measurement failed. Rates and metrics with a limit count them as
            failures.
        invalid: Episodes whose world or judgement was changed from outside; they count as failures.
        counted: Episodes with a value of the metric, including censored ones.
        censored: Episodes that count at the metric's limit.
        missing: Episodes without a value, excluded from all figures.
        units: Independent units (problems, scenes or seeds) of the counted episodes.
    """

    episodes: int
    succeeded: int
    failed: int
    timed_out: int
    broken: int
    invalid: int
    counted: int
    censored: int
    missing: int
    units: int

    @property
    def unmeasured_share(self) -> float | None:
        """Fraction of episodes without a value within the limit, from 0 to 1; None without episodes."""
        return (self.missing + self.censored) / self.episodes if self.episodes else None


@dataclass(frozen=True, slots=True)
class MethodSummary:
    """Summary of a metric for a method.

    Attributes:
        method: Level of the compared factor.
        metric: Name of the metric.
        unit: Unit of the metric; "" for rates and dimensionless metrics.
        levels: Levels of the other factors that the episodes are restricted to, such as `object=can`; "" for all.
        counts: Numbers of episodes by outcome.
        estimate: Rate, or median that ranks failures worst; None without data.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class PairCounts:
    """Numbers of compared pairs and episodes.

    Attributes:
        pairs: Pairs of episodes with the same trial and the same levels of the other factors.
        units: Independent units; pairs that share a problem or a seed belong to one unit.
        won: Pairs in which the first method is better.
        lost: Pairs in which the second method is better.
        failed: Compared episodes that rank worse than any value.
        broken: Compared episodes that are broken or invalid.
        missing: Pairs excluded because an episode has no value of the metric.
        unlike: Pairs excluded from a real or processor time because only one episode is the first of its stack,
            or because the numbers of workers differ.
        unmatched: Finished episodes without a finished or planned partner.
        at_random: Whether pairs share only their levels, because no trial occurs in both methods.
    """

    pairs: int
    units: int
    won: int
    lost: int
    failed: int
    broken: int
    missing: int
    unlike: int
    unmatched: int
    at_random: bool

    @property
    def pairs_per_unit(self) -> float:
        """Mean number of pairs per unit; 0 without pairs."""
        return self.pairs / self.units if self.units else 0.0


@dataclass(frozen=True, slots=True)
class PairFigures:
    """Figures that compare two methods for a metric.

    Attributes:
        first: First method, a level of the compared factor.
        second: Second method.
        counts: Numbers of compared pairs and episodes.
        levels: Levels of the other factors that the pairs are restricted to, such as `object=can`; "" for all.
        unit_noun: Name of an independent unit: `problem`, `scene` or `seed`.
        first_estimate: Rate or median of the first method over the pairs; None without data.
        second_estimate: Rate or median of the second method over the pairs; None without data.
        difference: Win difference from -1 to 1: fraction of pairs won by the first method minus fraction won by the
            second, averaged per unit first. For a rate it equals the difference of the rates, signed so that
            positive is better. None without data.
        mean_difference: Mean of the first method minus mean of the second over the pairs, in the metric's unit. It is
            descriptive and has no verdict. None for rates and without data.
        p_value: P value of the test; None without data or with too few units.
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
    """Comparison of two methods for a metric, with its verdict.

    Attributes:
        metric: Name of the metric.
        unit: Unit of the metric; "" for rates and dimensionless metrics.
        p_corrected: P value after the multiplicity correction; None without data.
        correction: Description of the correction, such as `Holm and Tarone; the least p value counts 6 times`.
        verdict: Conclusion; a difference requires both the corrected p value and the interval.
        verdict_without_broken: Verdict without the pairs of broken or invalid episodes;
            None without such pairs.
        pairs_needed: Total number of pairs that shows `difference_planned` with 80 % power; None if the sample is large
            enough or the number is unknown.
        difference_planned: Win difference that `pairs_needed` refers to.
        sentence: Result as one sentence.
        notes: Remarks on censored, missing, broken and unfinished episodes.
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
    """Statistical analysis of an experiment.

    Attributes:
        methods: Methods in the order of the experiment file.
        metrics: Metric names, success first.
        summaries: Summary of each method for each metric.
        comparisons: Comparison of each pair of methods for each metric, pooled over the levels of other factors.
        sentences: Main results, most important first.
        rule: Rule behind the verdicts: test, correction, error rate, fixed or sequential.
        scope: Population that the claims cover: the units, their number and the levels.
    """

    methods: tuple[str, ...]
    metrics: tuple[str, ...]
    summaries: tuple[MethodSummary, ...]
    comparisons: tuple[Comparison, ...]
    sentences: tuple[str, ...]
    rule: str
    scope: str
