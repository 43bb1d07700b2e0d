# SPDX-License-Identifier: BSD-3-Clause
"""Values and times: published examples, closed forms and properties of tests and intervals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from modular_framework_benchmark.records.experiment import Direction
from modular_framework_benchmark.statistics.comparison import Interval
from modular_framework_benchmark.statistics.rates import Discordance
from modular_framework_benchmark.statistics.rates import paired_p_value as mcnemar
from modular_framework_benchmark.statistics.values import (
    improvement,
    interquartile_mean,
    interquartile_mean_interval,
    mean_interval,
    optimality_gap,
    paired_p_value,
    rank_biserial,
    sign_flip_p_value,
    unpaired_improvement,
    unpaired_interval,
    unpaired_p_value,
)

# M. Hollander, D. Wolfe, Nonparametric Statistical Methods (1973): depression of 9 patients before and after.
BEFORE = np.array([1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30])
AFTER = np.array([0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29])


def strata(values: np.ndarray, count: int = 1) -> np.ndarray:
    return np.arange(len(values)) % count


def interval_of_mean(values: np.ndarray, of_strata: np.ndarray) -> Interval:
    found = mean_interval(values, of_strata, 0.95, generator())
    assert found is not None
    return found


def generator() -> np.random.Generator:
    return np.random.default_rng(1)


def test_the_signed_rank_test_gives_the_published_p_value() -> None:
    assert paired_p_value(BEFORE - AFTER) == pytest.approx(0.03906, abs=5e-6)


def test_the_rank_biserial_correlation_follows_from_the_published_rank_sum() -> None:
    # V = 40 of 45: (40 - 5) / 45.
    assert rank_biserial(BEFORE - AFTER).value == pytest.approx(35 / 45)


def test_the_sign_flip_test_of_single_pairs_is_mcnemars_exact_test() -> None:
    differences = np.array([1.0] * 9 + [-1.0] * 2 + [0.0] * 2)
    assert sign_flip_p_value(differences, generator()) == pytest.approx(mcnemar(Discordance(9, 2, 13)), abs=1e-9)


def test_mann_whitney_gives_the_p_value_of_two_samples_that_do_not_overlap() -> None:
    # The least of the 252 ways to rank 5 and 5, on either side.
    assert unpaired_p_value(np.arange(5.0), np.arange(5.0) + 10.0) == pytest.approx(2 / 252)


def test_the_mean_of_a_normal_sample_has_nearly_students_interval() -> None:
    values = generator().normal(3.0, 1.0, 400)
    found = interval_of_mean(values, strata(values))
    low, high = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((low, high), abs=0.02)
    assert "bootstrap" in found.method


def test_levels_of_other_factors_that_differ_much_do_not_widen_the_interval_of_a_mean() -> None:
    values = generator().normal(0.0, 1.0, 90) + 10.0 * strata(np.zeros(90), 3)
    apart = interval_of_mean(values, strata(values, 3))
    as_one = interval_of_mean(values, strata(values))
    assert apart.high - apart.low < 0.3 * (as_one.high - as_one.low)


def test_levels_with_few_values_are_resampled_as_one() -> None:
    values = generator().normal(0.0, 1.0, 27)
    apart = interval_of_mean(values, strata(values, 9))
    as_one = interval_of_mean(values, strata(values))
    assert apart == as_one


@pytest.mark.parametrize(
    ("values", "low", "high", "method"),
    [
        ([2.0] * 9, 2.0, 2.0, "all values are equal"),
        ([1.0, 2.0, 3.0], -0.4841, 4.4841, "Student's t"),
        ([0.0] * 19 + [1.0], -0.0547, 0.1547, "Student's t"),  # most resamples are all 0: they have no spread
    ],
)
def test_intervals_of_few_or_equal_values_say_how_they_were_made(
    values: list[float], low: float, high: float, method: str
) -> None:
    array = np.array(values)
    found = interval_of_mean(array, strata(array))
    assert (found.low, found.high) == pytest.approx((low, high), abs=5e-5)
    assert found.method == method


def test_a_single_value_has_no_interval() -> None:
    assert mean_interval(np.array([2.0]), np.array([0]), 0.95, generator()) is None
    assert unpaired_interval(np.array([2.0]), np.array([1.0, 2.0]), 0.95) is None


def test_an_interval_of_many_values_needs_no_bootstrap() -> None:
    values = generator().exponential(1.0, 50_000)
    found = interval_of_mean(values, strata(values))
    assert found.method == "Student's t"
    assert found.high - found.low == pytest.approx(2 * 1.96 * values.std() / np.sqrt(50_000), rel=1e-3)


def test_the_interquartile_mean_leaves_out_a_quarter_on_either_side() -> None:
    assert interquartile_mean(np.array([-1000.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 1000.0])) == 2.5


@pytest.mark.parametrize("count", [3, 40, 1500])
def test_the_interval_of_an_interquartile_mean_holds_it(count: int) -> None:
    values = generator().lognormal(0.0, 1.0, count)
    found = interquartile_mean_interval(values, strata(values), 0.95, generator())
    assert found.low < interquartile_mean(values) < found.high


@pytest.mark.parametrize("values", [[4.0] * 20, [4.0] * 19 + [9.0], [1.0, *[4.0] * 18, 9.0]])
def test_an_interquartile_mean_of_equal_values_has_no_width(values: list[float]) -> None:
    found = interquartile_mean_interval(np.array(values), strata(np.array(values)), 0.95, generator())
    assert (found.low, found.high) == (4.0, 4.0)


def test_the_same_generator_gives_the_same_interval() -> None:
    values = generator().lognormal(0.0, 1.0, 30)
    assert mean_interval(values, strata(values), 0.9, generator()) == mean_interval(
        values, strata(values), 0.9, generator()
    )


@settings(max_examples=25)
@given(st.lists(st.integers(-5, 5), min_size=1, max_size=30))
def test_swapping_the_methods_mirrors_every_paired_figure(numbers: list[int]) -> None:
    differences = np.array(numbers, dtype=float)
    assert paired_p_value(differences) == pytest.approx(paired_p_value(-differences))
    assert rank_biserial(differences).value == pytest.approx(-rank_biserial(-differences).value)
    zeros = np.zeros_like(differences)
    better = improvement(differences, zeros, Direction.HIGHER)
    assert better == pytest.approx(1.0 - improvement(zeros, differences, Direction.HIGHER))
    assert better == pytest.approx(improvement(zeros, differences, Direction.LOWER))
    assert 0.0 <= paired_p_value(differences) <= 1.0


def test_the_probability_of_improvement_of_unpaired_episodes_counts_ties_half() -> None:
    first, second = np.array([1.0, 2.0]), np.array([2.0, 3.0])  # of 4 meetings 0 are higher and 1 is a tie
    assert unpaired_improvement(first, second, Direction.HIGHER) == pytest.approx(0.125)
    assert unpaired_improvement(first, second, Direction.LOWER) == pytest.approx(0.875)


def test_welchs_interval_of_unpaired_values_is_that_of_his_formula() -> None:
    first, second = np.array([1.0, 2.0, 3.0, 4.0]), np.array([2.0, 2.5, 3.0])
    parts = first.var(ddof=1) / 4, second.var(ddof=1) / 3
    freedom = sum(parts) ** 2 / (parts[0] ** 2 / 3 + parts[1] ** 2 / 2)
    half = stats.t.isf(0.025, freedom) * np.sqrt(sum(parts))
    found = unpaired_interval(first, second, 0.95)
    assert found is not None
    assert (found.low, found.high) == pytest.approx((-half, half))


def test_the_optimality_gap_counts_what_is_beyond_the_target_as_the_target() -> None:
    assert optimality_gap(np.array([0.5, 1.0, 2.0]), 1.0, Direction.HIGHER) == pytest.approx(0.5 / 3)
    assert optimality_gap(np.array([0.5, 1.0, 2.0]), 1.0, Direction.LOWER) == pytest.approx(1.0 / 3)
