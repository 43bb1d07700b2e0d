# SPDX-License-Identifier: BSD-3-Clause
"""Robustness curves: rates, intervals and fits as computed independently, and only for the tested levels."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from statistics_results import results_of

from modular_framework_benchmark.records.experiment import Direction, Factor, Metric, MetricKind
from modular_framework_benchmark.records.perturbation import Perturbations, PerturbedAxis, PerturbedLevel
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.reports.robustness_figures import robustness_figures, robustness_sentences
from modular_framework_benchmark.statistics.robustness import (
    CrossingKind,
    FittedSide,
    Robustness,
    analyse_robustness,
    fitted_rates,
)

TRIALS = 20
ERROR = PerturbedAxis("perceived_pose_error", "mm", 0.0)
MASS = PerturbedAxis("object_mass", "factor", 1.0)
PROGRESS = Metric("progress", "task", MetricKind.PARTIAL_CREDIT, Direction.HIGHER)


def level(label: str, error: float = 0.0, mass: float = 1.0) -> PerturbedLevel:
    return PerturbedLevel(label, {ERROR.name: error, MASS.name: mass})


LEVELS = (
    level("nominal"),
    *(level(f"perceived_pose_error={value} mm", error=value) for value in (5, 10, 20)),
    *(level(f"object_mass={value:g}", mass=value) for value in (0.5, 2)),
)
PERTURBATIONS = Perturbations((ERROR, MASS), LEVELS, "one_at_a_time", 0.5)


def results(successes: Mapping[str, Mapping[str, int]], trials: int = TRIALS) -> ExperimentResults:
    """Results with the number of successes of each method at each level; the first trials succeed."""
    labels = tuple(next(iter(successes.values())))
    plain = results_of({method: ["failed"] * trials for method in successes})
    parts = []
    for label in labels:
        part = plain.episodes.copy()
        part["perturbation"] = label
        part["success"] = [row.trial < successes[row.method][label] for row in part.itertuples()]
        part["status"] = np.where(part["success"], "succeeded", "failed")
        part["progress"] = np.where(part["success"], 1.0, 0.25)
        parts.append(part)
    factors = (*plain.description.factors, Factor("perturbation", labels))
    description = dataclasses.replace(plain.description, factors=factors, metrics=(PROGRESS,))
    episodes = pd.concat(parts, ignore_index=True)
    return ExperimentResults(description, episodes, pd.DataFrame(), len(episodes))


def counts(*numbers: int) -> dict[str, int]:
    return {each.label: number for each, number in zip(LEVELS, numbers, strict=True)}


SOUND = {"a": counts(20, 18, 12, 1, 20, 19), "b": counts(20, 20, 19, 16, 20, 20)}


def analysed(successes: Mapping[str, Mapping[str, int]] = SOUND, trials: int = TRIALS) -> Robustness:
    return analyse_robustness(results(successes, trials), PERTURBATIONS)


def side_of(found: Robustness, axis: str, method: str) -> FittedSide:
    (curve,) = (curve for curve in found.of_axis(axis) if curve.method == method)
    return curve.sides[-1]


def clopper_pearson(successes: int, episodes: int) -> tuple[float, float]:
    low = stats.beta.ppf(0.025, successes, episodes - successes + 1) if successes else 0.0
    high = stats.beta.ppf(0.975, successes + 1, episodes - successes) if successes < episodes else 1.0
    return float(low), float(high)


def test_each_point_has_the_rate_of_its_level_with_the_exact_interval_and_the_mean_progress() -> None:
    for curve in analysed().of_axis(ERROR.name):
        assert [point.value for point in curve.points] == [0.0, 5.0, 10.0, 20.0]
        for point, label in zip(curve.points, [each.label for each in LEVELS[:4]], strict=True):
            number, estimate = SOUND[curve.method][label], point.success.estimate
            assert estimate is not None and estimate.interval is not None
            assert estimate.value == number / TRIALS
            assert (estimate.interval.low, estimate.interval.high) == pytest.approx(clopper_pearson(number, TRIALS))
            assert point.progress is not None and point.progress.mean is not None
            assert point.progress.mean.value == pytest.approx((number + 0.25 * (TRIALS - number)) / TRIALS)


@pytest.mark.parametrize("rates", [(1.0, 0.7, 0.9, 0.2), (0.5, 0.8, 0.8, 0.1), (0.1, 0.5, 0.9), (1.0, 1.0), (0.3,)])
def test_the_fit_is_the_isotonic_regression_of_its_max_min_formula(rates: Sequence[float]) -> None:
    weights = [10 + 3 * index for index in range(len(rates))]

    def mean(first: int, last: int) -> float:
        return float(np.average(rates[first : last + 1], weights=weights[first : last + 1]))

    expected = [
        min(max(mean(first, last) for last in range(place, len(rates))) for first in range(place + 1))
        for place in range(len(rates))
    ]
    assert fitted_rates(rates, weights) == pytest.approx(expected)


def test_a_method_falls_below_the_wanted_success_between_two_tested_levels() -> None:
    side = side_of(analysed(), ERROR.name, "a")
    assert side.kind is CrossingKind.WITHIN
    assert (side.last_reached, side.first_below) == (10.0, 20.0)
    assert side.crossing == pytest.approx(np.interp(-0.5, [-0.6, -0.05], [10.0, 20.0]))
    # Clopper-Pearson: 18 of 20 is at least 0.68, 12 of 20 at least 0.36, 1 of 20 at most 0.25.
    assert (side.shown_reached, side.shown_below) == (5.0, 20.0)


def test_nothing_is_said_beyond_the_tested_levels() -> None:
    side = side_of(analysed(), ERROR.name, "b")
    assert (side.kind, side.crossing, side.first_below) == (CrossingKind.NOT_REACHED, None, None)
    text = " ".join(robustness_sentences(analysed()))
    assert "perceived pose error, b: not below 50 % at the tested levels, the last of which is 20 mm" in text
    never = side_of(analysed({"a": counts(2, 1, 1, 0, 2, 2), "b": SOUND["b"]}), ERROR.name, "a")
    assert (never.kind, never.crossing, never.first_below, never.last_reached) == (
        CrossingKind.AT_NOMINAL,
        None,
        0.0,
        None,
    )


def test_a_method_is_shown_to_be_below_only_if_all_farther_levels_are() -> None:
    falling = side_of(analysed({"a": counts(20, 12, 2, 1, 20, 20), "b": SOUND["b"]}), ERROR.name, "a")
    assert falling.shown_below == 10.0
    rising = side_of(analysed({"a": counts(20, 1, 12, 18, 20, 20), "b": SOUND["b"]}), ERROR.name, "a")
    assert rising.shown_below is None


def test_an_axis_that_is_not_shown_to_lower_success_is_not_named_for_the_fall_of_another_axis() -> None:
    # a falls by 15 of 20 with the mass, and both fall by 8 of 20 with the error: the larger mean is not shown
    successes = {"a": counts(20, 20, 20, 12, 5, 20), "b": counts(20, 20, 20, 12, 20, 20)}
    assert robustness_sentences(analysed(successes))[0].startswith(
        "object mass is shown to lower success; the largest mean fall in success is along perceived pose error: 40 ("
    )


def test_an_axis_with_levels_on_both_sides_has_a_curve_on_each() -> None:
    (curve,) = (curve for curve in analysed().of_axis(MASS.name) if curve.method == "a")
    assert [side.values for side in curve.sides] == [(1.0, 0.5), (1.0, 2.0)]


def test_the_axis_that_hurts_most_comes_first_with_its_paired_fall() -> None:
    found = analysed()
    assert found.order == (ERROR.name, MASS.name)
    (curve,) = (curve for curve in found.of_axis(ERROR.name) if curve.method == "a")
    assert curve.fall is not None and curve.fall.points.interval is not None
    assert (curve.fall.value, curve.fall.pairs) == (20.0, TRIALS)
    assert curve.fall.points.value == pytest.approx(19 / 20)
    interval = curve.fall.points.interval
    assert interval.confidence == pytest.approx(1 - 0.05 / (5 * 2))
    half = (1 - interval.confidence) / 4
    won_low, lost_high = stats.beta.ppf(half, 19, 2), stats.beta.ppf(1 - half, 1, 20)
    assert interval.low == pytest.approx(won_low - lost_high)
    first = robustness_sentences(found)[0]
    claim = "perceived pose error is shown to lower success; the largest mean fall in success is along "
    assert first.startswith(f"{claim}perceived pose error: 95 (")
    assert "points at 20 mm for a and 20 (" in first


def test_axes_without_an_effect_are_not_said_to_hurt() -> None:
    same = counts(15, 15, 14, 15, 15, 15)
    assert robustness_sentences(analysed({"a": same, "b": same}))[0].startswith("no axis is shown to lower success")


def test_few_scenes_give_no_interval() -> None:
    found = analysed({"a": counts(4, 4, 2, 0, 4, 4), "b": counts(4, 4, 4, 4, 4, 4)}, trials=4)
    (curve,) = (curve for curve in found.of_axis(ERROR.name) if curve.method == "a")
    assert curve.fall is not None and curve.fall.points.interval is None
    side = curve.sides[-1]
    assert (side.shown_reached, side.shown_below) == (None, None)


def test_a_space_filling_design_is_shown_in_groups_averaged_over_the_other_axes() -> None:
    levels = [level("nominal"), *(level(f"p{n}", error=2.0 * n, mass=1.0 + (n * 7 % 10) / 10) for n in range(10))]
    perturbations = Perturbations((ERROR, MASS), tuple(levels), "sobol", 0.5)
    successes = {each.label: max(0, 20 - 2 * n) for n, each in enumerate(levels)}
    found = analyse_robustness(results({"a": successes, "b": successes}), perturbations)
    (curve, _) = found.of_axis(ERROR.name)
    assert [(point.low, point.high) for point in curve.points] == [(0, 2), (4, 6), (8, 10), (12, 14), (16, 18)]
    assert [point.success.counts.succeeded for point in curve.points] == [18 + 16, 14 + 12, 10 + 8, 6 + 4, 2 + 0]
    assert found.order[0] == ERROR.name
    assert curve.fall is not None and curve.fall.points.interval is None
    assert found.fit.endswith("averaged over the other axes")


def test_the_figure_has_the_points_of_each_method_and_the_wanted_success() -> None:
    figures = robustness_figures(analysed())
    assert [figure.name for figure in figures] == ["robustness_perceived_pose_error", "robustness_object_mass"]
    assert "Object mass: Factor of masses and moments of inertia of the objects." in figures[1].summary
    drawn = figures[0].figure
    points = [trace for trace in drawn.data if trace.xaxis == "x" and trace.mode == "markers"]
    assert [trace.name for trace in points] == ["a", "b"]
    assert list(points[0].y) == [100.0, 90.0, 60.0, 5.0]
    assert drawn.layout.shapes[0].y0 == 50.0
    assert drawn.layout.xaxis.title.text == "perceived pose error [mm]"


def robust_sentences(found: ExperimentResults) -> str:
    return "\n".join(robustness_sentences(analyse_robustness(found, PERTURBATIONS)))


def with_statuses(found: ExperimentResults, label: str, status: str, *methods: str) -> ExperimentResults:
    """Results in which the episodes at a level have a given status."""
    episodes = found.episodes.copy()
    rows = (episodes["perturbation"] == label) & episodes["method"].isin(methods)
    episodes.loc[rows, "success"], episodes.loc[rows, "status"] = False, status
    return dataclasses.replace(found, episodes=episodes)


@pytest.mark.parametrize("wanted_success", [0.5, 0.7])
def test_claims_about_the_wanted_success_hold_jointly_over_methods_and_sides_of_axes(wanted_success: float) -> None:
    perturbations = dataclasses.replace(PERTURBATIONS, wanted_success=wanted_success)
    curves = 2 * 3  # two methods; the error has levels on one side, the mass on both sides
    shown = []
    for number in range(TRIALS + 1):
        successes = {"a": counts(20, 20, 20, number, 20, 20), "b": counts(20, 20, 20, 20, 20, 20)}
        side = side_of(analyse_robustness(results(successes), perturbations), ERROR.name, "a")
        shown.append(side.shown_below is not None)
        high = stats.beta.ppf(1 - 0.05 / curves / 2, number + 1, TRIALS - number) if number < TRIALS else 1.0
        assert shown[-1] == (high < wanted_success)
    # The true rate of every level is the wanted success, so each claim to be below is false.
    probability = sum(stats.binom.pmf(number, TRIALS, wanted_success) for number in range(TRIALS + 1) if shown[number])
    assert 0.0 < 1 - (1 - probability) ** curves <= 0.025


def test_an_unfinished_experiment_claims_nothing_about_robustness() -> None:
    found = results(SOUND)
    running = dataclasses.replace(found, planned=3 * len(found.episodes))
    text = robust_sentences(running)
    assert "shown" not in text
    assert text.startswith("nothing is claimed about the robustness, because 240 of 720 episodes are finished; ")
    assert "perceived pose error, a: below 50 % at about 11.8 mm, between 10 mm and 20 mm" in text


@pytest.mark.parametrize("kind", ["sequential", "extended"])
def test_looks_at_the_results_leave_no_claims_about_robustness(kind: str) -> None:
    found = results(SOUND)
    description = dataclasses.replace(found.description, **{kind: True})
    text = robust_sentences(dataclasses.replace(found, description=description))
    assert text.startswith("nothing is claimed about the robustness, because ")
    assert "shown" not in text


def test_a_level_whose_launches_all_died_is_not_said_to_lower_success() -> None:
    found = with_statuses(results(SOUND), "object_mass=2", "broken", "a", "b")
    assert not robust_sentences(found).startswith("perceived pose error and object mass are shown to lower success")
    side = side_of(analyse_robustness(found, PERTURBATIONS), MASS.name, "a")
    assert side.values == (1.0, 0.5)


def test_nothing_is_said_about_the_robustness_if_no_nominal_episode_measured_a_method() -> None:
    found = analyse_robustness(with_statuses(results(SOUND), "nominal", "broken", "a", "b"), PERTURBATIONS)
    assert all(curve.fall is None for curve in found.curves)
    assert all(side.shown_reached is None for curve in found.curves for side in curve.sides)


def test_an_experiment_in_which_every_episode_broke_has_no_sentences_on_robustness() -> None:
    found = results(SOUND)
    for each in LEVELS:
        found = with_statuses(found, each.label, "invalid", "a", "b")
    assert robust_sentences(found) == ""


def test_a_level_at_which_episodes_of_one_method_broke_is_named_below_the_falls() -> None:
    found = with_statuses(results(SOUND), "object_mass=2", "invalid", "a")
    assert robust_sentences(found).splitlines()[1] == (
        "broken or invalid episodes, counted as failures: object mass 2, a: 20 of 20"
    )
    both = with_statuses(results(SOUND), "object_mass=2", "broken", "a", "b")
    assert robust_sentences(both).splitlines()[1].endswith("b: 20 of 20 (no method was measured; excluded)")
