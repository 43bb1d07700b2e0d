# SPDX-License-Identifier: BSD-3-Clause
"""The planner of episodes: exact power by counting every outcome, sample sizes that reach it, Holm's correction."""

from __future__ import annotations

import pytest
from scipy import stats

from modular_framework_benchmark.statistics.corrections import corrected, families
from modular_framework_benchmark.statistics.power import pairs_for_rate, pairs_for_value, rate_power
from modular_framework_benchmark.statistics.rates import Discordance, paired_p_value


@pytest.mark.parametrize(("pairs", "difference", "differing"), [(12, 0.5, 0.6), (30, 0.2, 0.4), (25, 0.0, 0.3)])
def test_power_is_the_share_of_all_outcomes_that_show_the_difference(
    pairs: int, difference: float, differing: float
) -> None:
    shares = [(differing + difference) / 2, (differing - difference) / 2, 1 - differing]
    counted = sum(
        stats.multinomial.pmf([one, other, pairs - one - other], pairs, shares)
        for one in range(pairs + 1)
        for other in range(pairs + 1 - one)
        if one > other and paired_p_value(Discordance(one, other, pairs)) <= 0.05
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


def test_values_need_the_pairs_of_a_t_test_and_a_few_more() -> None:
    # A paired t test of half a standard deviation needs 34 pairs (33.4 before rounding); 33.4 / 0.955 = 34.9.
    assert pairs_for_value(0.5, 1.0) == 35
    assert pairs_for_value(2.0, 4.0) == 35
    assert pairs_for_value(100.0, 1.0) == 6


def test_a_difference_that_would_take_more_than_a_million_pairs_has_no_plan() -> None:
    assert pairs_for_rate(0.0005, 0.5) is None
    assert pairs_for_value(0.0005, 1.0) is None


def test_holms_correction_gives_the_published_p_values() -> None:
    assert corrected([0.01, 0.04, None, 0.03, 0.005]) == pytest.approx([0.03, 0.06, None, 0.06, 0.02])
    assert corrected([0.02], share=0.5) == [0.04]
    assert corrected([None]) == [None]
    assert corrected([]) == []


def test_success_and_the_other_metrics_share_the_error_rate_half_and_half() -> None:
    assert families(["success", "task_time", "path_length"], "success") == (0.5, 0.5)
    assert families(["success"], "success") == (1.0, 1.0)
