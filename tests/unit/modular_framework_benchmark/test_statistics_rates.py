# SPDX-License-Identifier: BSD-3-Clause
"""Rates: published examples, and properties of the intervals and tests."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize, stats

from modular_framework_benchmark.statistics.rates import (
    PairOutcomes,
    paired_interval,
    paired_p_value,
    rate_interval,
    score_interval,
)


@st.composite
def pair_outcomes(draw: st.DrawFn) -> PairOutcomes:
    pairs = draw(st.integers(1, 80))
    first = draw(st.integers(0, pairs))
    return PairOutcomes(first, draw(st.integers(0, pairs - first)), pairs)


def test_the_interval_of_a_rate_is_that_of_newcombes_examples() -> None:
    # R. G. Newcombe, Two-sided confidence intervals for the single proportion, Statistics in Medicine 17 (1998) 857.
    interval = rate_interval(81, 263)
    assert (interval.low, interval.high) == pytest.approx((0.2527, 0.3676), abs=5e-5)
    assert rate_interval(0, 29).high == pytest.approx(0.1194, abs=5e-5)


@given(st.integers(1, 200), st.floats(0.0, 1.0))
def test_the_interval_of_a_rate_is_the_exact_one_of_scipy(episodes: int, share: float) -> None:
    successes = round(share * episodes)
    found, exact = rate_interval(successes, episodes), stats.binomtest(successes, episodes).proportion_ci(0.95, "exact")
    assert (found.low, found.high) == pytest.approx((exact.low, exact.high), abs=1e-9)


def test_no_episodes_leave_every_rate_possible() -> None:
    interval = rate_interval(0, 0)
    assert (interval.low, interval.high) == (0.0, 1.0)


def test_the_exact_test_of_mcnemar_gives_the_published_p_value() -> None:
    # Fagerland, Lydersen, Laake, The McNemar test for binary matched-pairs data, BMC Med. Res. Methodol. 13:91 (2013):
    # airway hyper-responsiveness before and after stem cell transplantation, 1 and 7 of 21 pairs differ.
    assert paired_p_value(PairOutcomes(1, 7, 21)) == pytest.approx(0.0703, abs=5e-5)


def test_tangos_interval_is_the_published_one() -> None:
    # The same pairs in Fagerland, Lydersen, Laake, Statistics in Medicine 33 (2014) 2850-2875.
    interval = score_interval(PairOutcomes(1, 7, 21), 0.95, correction=0.0)
    assert (interval.low, interval.high) == pytest.approx((-0.517, -0.026), abs=5e-4)


@given(pair_outcomes())
def test_the_exact_test_is_scipys_binomial_test_of_the_decided_pairs(outcomes: PairOutcomes) -> None:
    decided = outcomes.won + outcomes.lost
    expected = stats.binomtest(outcomes.won, decided).pvalue if decided else 1.0
    assert paired_p_value(outcomes) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("pairs", [6, 20])
def test_where_nearly_all_pairs_are_won_the_interval_is_that_of_two_exact_rates(pairs: int) -> None:
    for lost in range(4):
        found = paired_interval(PairOutcomes(pairs - 3, lost, pairs))
        ends = [stats.binomtest(count, pairs).proportion_ci(0.975, "exact") for count in (pairs - 3, lost)]
        assert (found.low, found.high) == pytest.approx((ends[0].low - ends[1].high, ends[0].high - ends[1].low))


@given(pair_outcomes())
def test_tangos_interval_ends_where_the_score_of_the_likeliest_rates_is_critical(outcomes: PairOutcomes) -> None:
    if outcomes.pairs - max(outcomes.won, outcomes.lost) <= 3:
        return  # the other interval
    interval = paired_interval(outcomes)
    for end in (interval.low, interval.high):
        if abs(end) < 1.0 - 1e-6:
            score = _score(outcomes, end) * (1.0 - 0.5 / (outcomes.pairs * abs(outcomes.difference - end)))
            assert abs(score) == pytest.approx(1.959964, abs=2e-3)


def _score(outcomes: PairOutcomes, difference: float) -> float:
    """Returns Tango's score with the likeliest rates found by a numerical search, not by his formula."""
    same = outcomes.pairs - outcomes.won - outcomes.lost

    def surprise(second_rate: float) -> float:
        rates = np.array([second_rate + difference, second_rate, 1.0 - 2.0 * second_rate - difference])
        counts = np.array([outcomes.won, outcomes.lost, same])
        return float(-np.sum(counts * np.log(np.maximum(rates, 1e-300))))

    ends = (max(0.0, -difference), (1.0 - difference) / 2.0)
    second_rate = optimize.minimize_scalar(surprise, bounds=ends, method="bounded", options={"xatol": 1e-12}).x
    variance = outcomes.pairs * (2.0 * second_rate + difference - difference**2)
    return float((outcomes.won - outcomes.lost - outcomes.pairs * difference) / np.sqrt(variance))


@given(pair_outcomes())
def test_swapping_the_methods_mirrors_interval_and_keeps_the_p_value(outcomes: PairOutcomes) -> None:
    swapped = PairOutcomes(outcomes.lost, outcomes.won, outcomes.pairs)
    one, other = paired_interval(outcomes), paired_interval(swapped)
    assert (one.low, one.high) == pytest.approx((-other.high, -other.low), abs=1e-9)
    assert paired_p_value(outcomes) == pytest.approx(paired_p_value(swapped))


@given(pair_outcomes())
def test_an_exact_test_that_shows_a_difference_has_an_interval_without_0(outcomes: PairOutcomes) -> None:
    interval = paired_interval(outcomes)
    assert interval.low <= outcomes.difference <= interval.high
    if paired_p_value(outcomes) <= 0.05 and outcomes.pairs >= 7:
        assert interval.low > 0.0 or interval.high < 0.0
