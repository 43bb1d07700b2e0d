# SPDX-License-Identifier: BSD-3-Clause
"""The planner of episodes: exact power by counting every outcome, sample sizes that reach it, the correction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from statistics_results import TIME, results_of
from statsmodels.stats.multitest import multipletests

from modular_framework_benchmark.experiments.planning_mode import PlanningSettings
from modular_framework_benchmark.experiments.problem_sets import Problem
from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.episode_settings import EpisodeSettings
from modular_framework_benchmark.statistics.analysis import holm_tarone
from modular_framework_benchmark.statistics.planned_power import power_text
from modular_framework_benchmark.statistics.power import (
    detectable_difference,
    min_units,
    pairs_for_rate,
    rate_power,
)
from modular_framework_benchmark.statistics.rates import PairOutcomes, paired_interval, paired_p_value
from modular_framework_benchmark.statistics.sequential import anytime_p_value


@pytest.mark.parametrize(("pairs", "difference", "differing"), [(12, 0.5, 0.6), (30, 0.2, 0.4), (25, 0.0, 0.3)])
def test_power_is_the_share_of_all_outcomes_that_show_the_difference(
    pairs: int, difference: float, differing: float
) -> None:
    shares = [(differing + difference) / 2, (differing - difference) / 2, 1 - differing]
    counted = sum(
        stats.multinomial.pmf([one, other, pairs - one - other], pairs, shares)
        for one in range(pairs + 1)
        for other in range(pairs + 1 - one)
        if one > other and paired_p_value(PairOutcomes(one, other, pairs)) <= 0.05
    )
    assert rate_power(pairs, difference, differing) == pytest.approx(counted, abs=1e-9)


@pytest.mark.parametrize(("difference", "differing"), [(0.05, 0.12), (0.12, 0.3), (0.4, 0.5), (0.1, 0.1)])
def test_the_planned_pairs_have_the_power_and_clearly_fewer_do_not(difference: float, differing: float) -> None:
    pairs = pairs_for_rate(difference, differing)
    assert pairs is not None
    assert rate_power(pairs, difference, differing) >= 0.8
    assert rate_power(int(0.85 * pairs), difference, differing) < 0.8


def test_the_planned_pairs_are_near_the_formula_for_many_pairs() -> None:
    # R. J. Connor (1987): (1.959964 sqrt(0.12) + 0.841621 sqrt(0.12 - 0.05^2))^2 / 0.05^2.
    formula = (1.959964 * 0.12**0.5 + 0.841621 * (0.12 - 0.0025) ** 0.5) ** 2 / 0.0025
    assert pairs_for_rate(0.05, 0.12) == pytest.approx(formula, rel=0.1)


def test_a_difference_that_would_take_more_than_a_million_pairs_has_no_plan() -> None:
    assert pairs_for_rate(0.0005, 0.5) is None


def test_normal_values_half_a_deviation_apart_need_at_most_55_pairs() -> None:
    won = stats.norm.cdf(0.5)
    pairs = pairs_for_rate(2 * won - 1, 1.0)
    assert pairs is not None and pairs <= 55


@pytest.mark.parametrize("error_rate", [0.05, 0.025, 0.05 / 28])
def test_with_the_fewest_units_a_clean_sweep_shows_a_difference_and_with_one_less_it_does_not(
    error_rate: float,
) -> None:
    units = min_units(error_rate)

    def shows(count: int) -> bool:
        outcomes = PairOutcomes(count, 0, count)
        return stats.binomtest(count, count).pvalue <= error_rate and paired_interval(outcomes).low > 0.0

    assert shows(units) and (units == 6 or not shows(units - 1))
    ever = min_units(error_rate, at_any_time=True)
    assert anytime_p_value(np.ones(ever)) <= error_rate < anytime_p_value(np.ones(ever - 1))


def test_the_smallest_difference_is_shown_with_the_power_and_one_point_less_is_not() -> None:
    found = detectable_difference(100, 0.05, 0.3)
    assert found is not None
    assert rate_power(100, found, 0.3) >= 0.8 > rate_power(100, found - 0.01, 0.3)
    assert detectable_difference(10, 0.05 / 56) is None


def test_holms_correction_is_that_of_statsmodels_where_every_comparison_can_be_shown() -> None:
    p_values = [0.01, 0.04, 0.03, 0.005]
    expected = multipletests(p_values, method="holm")[1]
    assert holm_tarone(p_values, [0.0] * 4, 0.05, 1.0)[0] == pytest.approx(expected)
    assert holm_tarone([0.02], [0.0], 0.05, 0.5) == ([0.04], 1)


def test_comparisons_that_cannot_be_shown_do_not_count() -> None:
    # R. E. Tarone, Biometrics 46 (1990) 515-522: with k = 2, two of the four can have a p value of 0.025.
    found, count = holm_tarone([0.02, 0.5, 0.3, 1.0], [0.001, 0.01, 0.25, 1.0], 0.05, 1.0)
    assert count == 2
    assert found[0] == pytest.approx(0.04)
    assert all(value > 0.05 for value in found[1:])


def test_the_correction_keeps_the_error_rate_of_identical_methods_with_few_decided_pairs() -> None:
    random = np.random.default_rng(2)
    false = 0
    for _ in range(2000):
        decided = random.integers(0, 9, 12)
        won = random.binomial(decided, 0.5)
        p_values = [1.0 if not all_ else stats.binomtest(int(one), int(all_)).pvalue
                    for one, all_ in zip(won, decided, strict=True)]  # fmt: skip
        false += min(holm_tarone(p_values, [2.0 ** (1 - int(all_)) for all_ in decided], 0.05, 1.0)[0]) <= 0.05
    assert 0 < false <= 130


@pytest.mark.parametrize(("pairs", "difference", "differing"), [(14, 0.8, 0.9), (30, 0.5, 0.7)])
def test_the_power_of_a_sequential_rule_is_at_least_the_share_of_outcomes_that_show_the_difference_at_its_end(
    pairs: int, difference: float, differing: float
) -> None:
    shares = [(differing + difference) / 2, (differing - difference) / 2, 1 - differing]
    counted = sum(
        stats.multinomial.pmf([one, other, pairs - one - other], pairs, shares)
        for one in range(pairs + 1)
        for other in range(min(one, pairs + 1 - one))
        if anytime_p_value(np.repeat([1.0, -1.0, 0.0], [one, other, pairs - one - other])) <= 0.05
    )
    power = rate_power(pairs, difference, differing, at_any_time=True)
    assert power == pytest.approx(counted, abs=1e-9)
    assert power < rate_power(pairs, difference, differing), "looks cost power"


def planned(methods: int, trials: int, problems: int = 0, sequential: bool = False) -> str:
    names = tuple("abcdefgh"[:methods])
    description = replace(
        results_of({name: [] for name in names}, (TIME,), {"task_time": {name: [] for name in names}}).description,
        mode="planning" if problems else "task",
        sequential=sequential,
    )
    episodes = [
        EpisodeSpec(
            methods * trial + place,
            {"method": name},
            trial,
            trial,
            PlanningSettings(problem=Problem(str(trial % problems), "", "")) if problems else EpisodeSettings(),
        )
        for trial in range(trials)
        for place, name in enumerate(names)
    ]
    return power_text(description, episodes)


def test_the_dry_run_says_that_nothing_can_be_shown_with_10_pairs_and_28_comparisons() -> None:
    assert planned(8, 10).count("no difference, since at least 12 scenes would have to be won") == 2


def test_the_dry_run_names_the_smallest_difference_and_what_others_need() -> None:
    text = planned(2, 100)
    assert f"success: from {100 * (detectable_difference(100, 0.025, 0.3) or 0):g} points" in text
    assert f"{pairs_for_rate(0.05, 0.3, 0.025):,}, {pairs_for_rate(0.1, 0.3, 0.025)} and" in text
    assert "60, 70 and 80 % of the pairs won need" in text


def test_the_dry_run_of_a_sequential_experiment_names_the_smallest_difference_and_what_others_need() -> None:
    text = planned(2, 100, sequential=True)
    assert f"after {min_units(0.025, at_any_time=True)} scenes at the earliest" in text
    smallest, needed = detectable_difference(100, 0.025, 0.3, True), pairs_for_rate(0.2, 0.3, 0.025, at_any_time=True)
    assert smallest is not None and needed is not None
    assert f"success: from {100 * smallest:g} points" in text and f"and {needed:,} scenes" in text
    assert "other metrics: from" in text
    assert smallest > (detectable_difference(100, 0.025, 0.3) or 1.0)
    assert needed > (pairs_for_rate(0.2, 0.3, 0.025) or 0)


def test_the_dry_run_counts_repeated_problems_as_one_unit() -> None:
    assert "with 20 problems for each method" in planned(2, 100, problems=20)
    assert "with 100 seeds for each method" in planned(2, 100, problems=1)  # one problem is not drawn
