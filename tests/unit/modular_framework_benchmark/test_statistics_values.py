# SPDX-License-Identifier: BSD-3-Clause
"""Means and medians of units: closed forms, SciPy's tests and intervals, counts of every outcome."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from modular_framework_benchmark.statistics.rates import PairOutcomes, paired_p_value
from modular_framework_benchmark.statistics.values import (
    bounded_mean_interval,
    median_interval,
    restricted_mean_interval,
    sign_flip_p_value,
)


def sizes_of(means: np.ndarray, size: int = 1) -> np.ndarray:
    return np.full(len(means), size)


def test_the_sign_flip_test_of_single_pairs_is_mcnemars_exact_test() -> None:
    means = np.array([1.0] * 9 + [-1.0] * 2 + [0.0] * 2)
    assert sign_flip_p_value(means, sizes_of(means)) == pytest.approx(paired_p_value(PairOutcomes(9, 2, 13)), abs=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(-5, 5), min_size=2, max_size=11).filter(any))
def test_the_sign_flip_test_of_units_is_scipys_permutation_test(wins: list[int]) -> None:
    means = np.array(wins) / 5

    def mean(values: np.ndarray, zeros: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.mean(values, axis=axis) - np.mean(zeros, axis=axis)

    exact = stats.permutation_test(
        (means, np.zeros_like(means)), mean, permutation_type="samples", vectorized=True, n_resamples=np.inf
    )
    assert sign_flip_p_value(means, sizes_of(means, 5)) == pytest.approx(exact.pvalue, abs=1e-9)


def test_the_mean_of_bounded_units_has_students_interval() -> None:
    means = np.random.default_rng(1).uniform(0.2, 0.9, 30)
    found = bounded_mean_interval(means, (0.0, 1.0), 0.95)
    exact = stats.ttest_1samp(means, 0.0).confidence_interval(0.95)
    assert found is not None
    assert (found.low, found.high) == pytest.approx((exact.low, exact.high))


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(-5, 5), min_size=8, max_size=9), st.floats(-1.0, 1.0))
def test_the_interval_of_a_few_units_holds_every_mean_that_the_sign_flip_test_does_not_reject(
    wins: list[int], true_mean: float
) -> None:
    means = np.array(wins) / 5
    found = bounded_mean_interval(means, (-1.0, 1.0), 0.95)
    assert found is not None
    if "sign flips" in found.method and not found.low - 1e-9 <= true_mean <= found.high + 1e-9:
        zeros = np.zeros_like(means)
        exact = stats.permutation_test(
            (means - true_mean, zeros),
            lambda a, b: np.mean(a) - np.mean(b),
            permutation_type="samples",
            n_resamples=np.inf,
        )
        assert exact.pvalue <= 0.05 + 1e-9


def test_seven_of_eight_units_with_one_sign_do_not_exclude_a_mean_of_0() -> None:
    found = bounded_mean_interval(np.array([0.7] * 4 + [0.68] * 3 + [-0.7]), (-1.0, 1.0), 0.95)
    assert found is not None
    assert found.low <= 0.0


@pytest.mark.parametrize(("value", "bounds", "low", "high"), [
    (1.0, (0.0, 1.0), 0.025**0.1, 1.0), (0.0, (0.0, 1.0), 0.0, 1 - 0.025**0.1),
    (1.0, (-1.0, 1.0), 2 * 0.025**0.1 - 1, 1.0),
])  # fmt: skip
def test_equal_values_at_a_bound_have_the_exact_end(
    value: float, bounds: tuple[float, float], low: float, high: float
) -> None:
    found = bounded_mean_interval(np.full(10, value), bounds, 0.95)
    assert found is not None
    assert (found.low, found.high) == pytest.approx((low, high))


def test_equal_values_within_the_bounds_have_an_interval_with_a_width() -> None:
    found = bounded_mean_interval(np.full(20, 0.5), (0.0, 1.0), 0.95)
    assert found is not None
    assert found.low < 0.45 < 0.55 < found.high


@pytest.mark.parametrize("count", [1, 5])
def test_fewer_than_6_units_have_no_interval(count: int) -> None:
    assert bounded_mean_interval(np.ones(count), (0.0, 1.0), 0.95) is None
    assert median_interval(np.arange(float(count)), 0.95) is None


@pytest.mark.parametrize("count", [6, 9, 20, 41, 200])
def test_the_interval_of_a_median_holds_it_at_least_as_often_as_it_says_and_no_narrower_one_does(count: int) -> None:
    found = median_interval(np.arange(float(count)), 0.95)
    assert found is not None
    rank = int(found.low)
    assert found.high == count - 1 - rank
    assert 1 - 2 * stats.binom.cdf(rank, count, 0.5) >= 0.95 > 1 - 2 * stats.binom.cdf(rank + 1, count, 0.5)


def test_the_interval_of_a_median_may_end_in_a_failure() -> None:
    found = median_interval(np.array([1.0, 2.0, 3.0, 4.0, np.inf, np.inf]), 0.95)
    assert found is not None
    assert (found.low, found.high) == (1.0, math.inf)


def test_a_restricted_mean_joins_the_intervals_of_failures_and_of_successes() -> None:
    values = np.array([3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 60.0, 60.0])
    failed = values == 60.0
    found = restricted_mean_interval(values, failed, (60.0, 0.0), 0.95)
    rate = stats.binomtest(2, 8).proportion_ci(0.975, "exact")
    kept = stats.ttest_1samp(values[~failed], 0.0).confidence_interval(0.975)
    assert found is not None
    assert found.low == pytest.approx(rate.low * 60 + (1 - rate.low) * kept.low)
    assert found.high == pytest.approx(rate.high * 60 + (1 - rate.high) * kept.high)


def test_a_restricted_mean_without_enough_or_different_successes_has_no_interval() -> None:
    values = np.array([5.0] * 5 + [60.0] * 20)
    assert restricted_mean_interval(values, values == 60.0, (60.0, 0.0), 0.95) is None
    assert restricted_mean_interval(np.full(20, 5.0), np.zeros(20, dtype=bool), (60.0, 0.0), 0.95) is None
