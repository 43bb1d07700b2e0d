# SPDX-License-Identifier: BSD-3-Clause
"""Robustness curves: success and progress of each method against the level of each perturbed axis.

A curve is an isotonic regression: success does not rise with the distance from the nominal value. No level outside the
tested levels is predicted.

Claims follow the rules of the comparisons. The report makes no claim before the last episode, after an interim
analysis, or about levels at which no method was measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import takewhile

import numpy as np
import pandas as pd
from scipy import optimize

from modular_framework_benchmark.records.experiment import MetricKind
from modular_framework_benchmark.records.perturbation import (
    NOMINAL,
    PERTURBATION,
    Perturbations,
    PerturbedAxis,
    PerturbedLevel,
)
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics.comparison import Estimate, Interval, MethodSummary
from modular_framework_benchmark.statistics.observations import (
    SUCCESS,
    EpisodeTable,
    methods_of,
    metrics_of,
    other_factors,
    restrict_results,
    unmeasured_reason,
)
from modular_framework_benchmark.statistics.rates import PairOutcomes, paired_interval
from modular_framework_benchmark.statistics.summaries import summarise_method
from modular_framework_benchmark.statistics.values import MIN_UNITS
from modular_framework_benchmark.statistics.verdicts import is_unfinished

MAX_GROUPS = 5
"""Number of groups into which the points of a space-filling design are divided along an axis."""
FIT_METHOD = "isotonic regression on each side of the nominal value"


class CrossingKind(Enum):
    """Position of the level at which a method falls below the wanted success."""

    WITHIN = "within"  # between two tested levels
    AT_NOMINAL = "at_nominal"  # below the wanted success without perturbation, or at the level nearest to it
    NOT_REACHED = "not_reached"  # not below the wanted success at any tested level


@dataclass(frozen=True, slots=True, kw_only=True)
class CurvePoint:
    """Figures of a method at a level of an axis, or at a group of levels of a space-filling design.

    Attributes:
        value: Value of the axis, or the mean of the group, in the unit of the axis.
        low: Smallest value of the group.
        high: Largest value of the group.
        success: Success of the method; without an estimate if no method was measured at the level.
        progress: Progress of the method; None without milestones.
        claimed: Interval of the success that holds jointly for all methods and sides of axes; None if nothing may be
            claimed.
    """

    value: float
    low: float
    high: float
    success: MethodSummary
    progress: MethodSummary | None
    claimed: Interval | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedSide:
    """Fitted curve on one side of the nominal value, outwards from it.

    Attributes:
        values: Values of the axis, in its unit.
        rates: Fitted success rates, from 0 to 1.
        kind: Position of the crossing of the wanted success.
        crossing: Value at which the curve crosses the wanted success, interpolated; None outside the tested levels.
        last_reached: Last value at which the curve reaches the wanted success; None for none.
        first_below: First value at which the curve is below the wanted success; None for none.
        shown_reached: Last value up to which every claimed interval is at or above the wanted success; None for none.
        shown_below: First value from which every claimed interval is below the wanted success; None for none.
    """

    values: tuple[float, ...]
    rates: tuple[float, ...]
    kind: CrossingKind
    crossing: float | None
    last_reached: float | None
    first_below: float | None
    shown_reached: float | None
    shown_below: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Fall:
    """Largest fall in success from the nominal level.

    Attributes:
        value: Value of the axis with the lowest success, in its unit.
        points: Nominal success minus success at this value, from -1 to 1, as a paired difference. The interval is
            corrected for the number of tested levels and methods; None for a space-filling design, and if nothing
            may be claimed.
        pairs: Number of scenes that ran at both levels; 0 for a space-filling design.
    """

    value: float
    points: Estimate
    pairs: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustnessCurve:
    """Curve of a method along an axis.

    Attributes:
        axis: Perturbed axis.
        method: Name of the method.
        points: Figures of the tested levels, in ascending order of the values.
        sides: Fitted curve on each side of the nominal value that was tested.
        fall: Largest fall in success; None without episodes.
    """

    axis: PerturbedAxis
    method: str
    points: tuple[CurvePoint, ...]
    sides: tuple[FittedSide, ...]
    fall: Fall | None


@dataclass(frozen=True, slots=True)
class Robustness:
    """Robustness of the methods.

    Attributes:
        perturbations: Perturbations of the experiment.
        curves: Curve of each method along each axis.
        order: Names of the axes, the largest mean fall in success first.
        confidence: Confidence level of the interval of a single level.
        joint_confidence: Confidence level of each claimed interval; all claimed intervals jointly have the level
            `confidence`.
        no_claims: Reason why the report makes no claims; "" if claims are possible.
    """

    perturbations: Perturbations
    curves: tuple[RobustnessCurve, ...]
    order: tuple[str, ...]
    confidence: float
    joint_confidence: float
    no_claims: str

    @property
    def fit(self) -> str:
        """Returns the name of the fit."""
        averaged = "" if self.perturbations.one_at_a_time else ", averaged over the other axes"
        return f"{FIT_METHOD}{averaged}"

    def of_axis(self, name: str) -> tuple[RobustnessCurve, ...]:
        """Returns the curves along an axis."""
        return tuple(curve for curve in self.curves if curve.axis.name == name)


@dataclass(frozen=True, slots=True)
class _Group:
    values: tuple[float, ...]
    labels: tuple[str, ...]


def analyse_robustness(results: ExperimentResults, perturbations: Perturbations) -> Robustness:
    """Returns the curve of each method along each perturbed axis.

    Args:
        results: Finished episodes.
        perturbations: Perturbations of the experiment.

    Raises:
        ValueError: The experiment lacks the compared factor or the factor of the perturbations.
    """
    analysis = _Analysis(results, perturbations)
    curves = tuple(curve for axis in perturbations.axes for curve in analysis.curves(axis))
    confidence = results.description.confidence
    return Robustness(perturbations, curves, _order(curves), confidence, analysis.joint_confidence, analysis.no_claims)


class _Analysis:
    """Computes the curves of an experiment."""

    def __init__(self, results: ExperimentResults, perturbations: Perturbations) -> None:
        self._results, self._perturbations = results, perturbations
        self._progress = next((item for item in metrics_of(results) if item.kind is MetricKind.PARTIAL_CREDIT), None)
        self.no_claims = _reason_for_no_claims(results)
        claims = len(methods_of(results)) * sum(_side_count(axis, perturbations) for axis in perturbations.axes)
        self.joint_confidence = 1 - (1 - results.description.confidence) / max(claims, 1)

    def curves(self, axis: PerturbedAxis) -> list[RobustnessCurve]:
        """Returns the curve of each method along an axis."""
        groups, wanted_success = _groups(axis, self._perturbations), self._perturbations.wanted_success
        tables = [EpisodeTable(restrict_results(self._results, PERTURBATION, *group.labels)) for group in groups]
        curves = []
        for method in methods_of(self._results):
            points = tuple(self._point(*each, method) for each in zip(groups, tables, strict=True))
            fall = self._fall(axis, method, points, groups)
            sides = _sides(axis, points, wanted_success)
            curves.append(RobustnessCurve(axis=axis, method=method, points=points, sides=sides, fall=fall))
        return curves

    def _point(self, group: _Group, table: EpisodeTable, method: str) -> CurvePoint:
        success = summarise_method(table, SUCCESS, method)
        joint = summarise_method(table, SUCCESS, method, self.joint_confidence).estimate
        progress = None if self._progress is None else summarise_method(table, self._progress, method)
        is_measured = not unmeasured_reason(table.results)
        return CurvePoint(
            value=float(np.mean(group.values)),
            low=group.values[0],
            high=group.values[-1],
            success=success if is_measured else replace(success, estimate=None),
            progress=progress if is_measured or progress is None else replace(progress, mean=None),
            claimed=joint.interval if joint and is_measured and not self.no_claims else None,
        )

    def _fall(
        self, axis: PerturbedAxis, method: str, points: Sequence[CurvePoint], groups: Sequence[_Group]
    ) -> Fall | None:
        known = [
            (found.value, point.value, group)
            for point, group in zip(points, groups, strict=True)
            if (found := point.success.estimate) is not None and point.value != axis.nominal
        ]
        if not known:
            return None
        lowest, value, group = min(known, key=lambda item: item[0])
        if not self._perturbations.one_at_a_time:
            highest = max(rate for rate, _, _ in known)
            return Fall(value=value, points=Estimate("difference of groups", highest - lowest, None), pairs=0)
        outcomes = self._paired_outcomes(method, group.labels[0])
        if outcomes is None or not any(point.value == axis.nominal and point.success.estimate for point in points):
            return None
        description = self._results.description
        tested = (len(self._perturbations.levels) - 1) * len(methods_of(self._results))
        is_valid = outcomes.pairs >= MIN_UNITS and not self.no_claims
        interval = paired_interval(outcomes, 1 - (1 - description.confidence) / tested) if is_valid else None
        estimate = Estimate("paired difference", outcomes.difference, interval)
        return Fall(value=value, points=estimate, pairs=outcomes.pairs)

    def _paired_outcomes(self, method: str, label: str) -> PairOutcomes | None:
        """Returns the scenes that succeed only at the nominal level (won) or only at another level (lost)."""
        results = self._results
        episodes = results.episodes[results.episodes[results.description.compared] == method]
        keys = [factor.name for factor in other_factors(results) if factor.name != PERTURBATION] + ["trial"]
        sides = [episodes[episodes[PERTURBATION] == each].set_index(keys)["success"] for each in (NOMINAL, label)]
        pairs = pd.concat(sides, axis=1, join="inner", keys=["nominal", "perturbed"]).astype(bool)
        if pairs.empty:
            return None
        won, lost = pairs["nominal"] & ~pairs["perturbed"], ~pairs["nominal"] & pairs["perturbed"]
        return PairOutcomes(int(won.sum()), int(lost.sum()), len(pairs))


def _reason_for_no_claims(results: ExperimentResults) -> str:
    """Returns the reason why the report makes no claims about the robustness, otherwise ""."""
    description = results.description
    if description.sequential:
        return "a stopping rule looked at the results"
    if description.extended:
        return "episodes were added after results had been seen"
    if is_unfinished(results):
        return f"{len(results.episodes)} of {results.planned} episodes are finished"
    return unmeasured_reason(results)


def _side_count(axis: PerturbedAxis, perturbations: Perturbations) -> int:
    """Returns the number of sides of the nominal value that have tested levels."""
    values = [float(np.mean(group.values)) for group in _groups(axis, perturbations)]
    return any(value > axis.nominal for value in values) + any(value < axis.nominal for value in values)


def _groups(axis: PerturbedAxis, perturbations: Perturbations) -> list[_Group]:
    """Returns the levels of an axis in ascending order; those of a space-filling design in groups of equal size."""
    if perturbations.one_at_a_time:
        of_axis = [level for level in perturbations.levels if _perturbs_only(level, axis, perturbations)]
        return [_Group((level.values[axis.name],), (level.label,)) for level in _sorted_levels(of_axis, axis)]
    points = _sorted_levels([level for level in perturbations.levels if level.label != NOMINAL], axis)
    parts = np.array_split(np.arange(len(points)), min(MAX_GROUPS, len(points)))
    return [
        _Group(tuple(points[i].values[axis.name] for i in part), tuple(points[i].label for i in part)) for part in parts
    ]


def _sorted_levels(levels: Sequence[PerturbedLevel], axis: PerturbedAxis) -> list[PerturbedLevel]:
    return sorted(levels, key=lambda level: level.values[axis.name])


def _perturbs_only(level: PerturbedLevel, axis: PerturbedAxis, perturbations: Perturbations) -> bool:
    others = [other for other in perturbations.axes if other is not axis]
    return all(level.values[other.name] == other.nominal for other in others)


def _sides(axis: PerturbedAxis, points: Sequence[CurvePoint], wanted_success: float) -> tuple[FittedSide, ...]:
    above = [point for point in points if point.value >= axis.nominal]
    below = [point for point in reversed(points) if point.value <= axis.nominal]
    return tuple(
        _side(side, wanted_success)
        for side in (below, above)
        if any(point.value != axis.nominal and point.success.estimate is not None for point in side)
    )


def _side(points: Sequence[CurvePoint], wanted_success: float) -> FittedSide:
    """Returns the fit of points in the order of their distance from the nominal value."""
    known = [(point, point.success.estimate) for point in points if point.success.estimate is not None]
    rates = fitted_rates(
        [estimate.value for _, estimate in known], [point.success.counts.counted for point, _ in known]
    )
    values = [point.value for point, _ in known]
    below = [index for index, rate in enumerate(rates) if rate < wanted_success]
    first = below[0] if below else None
    kind, crossing = CrossingKind.NOT_REACHED, None
    if first == 0:
        kind = CrossingKind.AT_NOMINAL
    elif first is not None:
        kind = CrossingKind.WITHIN
        fraction = (rates[first - 1] - wanted_success) / (rates[first - 1] - rates[first])
        crossing = values[first - 1] + fraction * (values[first] - values[first - 1])
    # Both claims go through the levels in order and end at the first level that does not confirm them, so the number of
    # levels needs no correction. The claimed intervals are corrected for the number of methods and sides.
    reached = list(takewhile(lambda point: point.claimed and point.claimed.low >= wanted_success, points))
    shown_below = list(takewhile(lambda point: point.claimed and point.claimed.high < wanted_success, reversed(points)))
    return FittedSide(
        values=tuple(values),
        rates=rates,
        kind=kind,
        crossing=crossing,
        last_reached=values[-1] if first is None else values[first - 1] if first else None,
        first_below=None if first is None else values[first],
        shown_reached=reached[-1].value if reached else None,
        shown_below=shown_below[-1].value if shown_below else None,
    )


def fitted_rates(rates: Sequence[float], weights: Sequence[float]) -> tuple[float, ...]:
    """Returns the weighted least-squares fit that never rises (pool adjacent violators).

    Args:
        rates: Success rates in the order of the distance from the nominal value.
        weights: Number of episodes of each rate.
    """
    fit = optimize.isotonic_regression(np.asarray(rates), weights=np.asarray(weights, dtype=float), increasing=False)
    return tuple(float(rate) for rate in fit.x)


def _order(curves: Sequence[RobustnessCurve]) -> tuple[str, ...]:
    falls: dict[str, list[float]] = {}
    for curve in curves:
        falls.setdefault(curve.axis.name, []).extend([] if curve.fall is None else [curve.fall.points.value])
    return tuple(sorted(falls, key=lambda name: -float(np.mean(falls[name])) if falls[name] else 0.0))
