# SPDX-License-Identifier: BSD-3-Clause
"""Rates: published examples, and properties of the intervals and tests."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize

from modular_framework_benchmark.statistics.rates import (
    Discordance,
    paired_interval,
    paired_p_value,
    rate_interval,
    unpaired_interval,
    unpaired_p_value,
)


@st.composite
def discordances(draw: st.DrawFn) -> Discordance:
    pairs = draw(st.integers(1, 80))
    first = draw(st.integers(0, pairs))
    return Discordance(first, draw(st.integers(0, pairs - first)), pairs)


@pytest.mark.parametrize(
    ("method", "low", "high"),
    [("wilson", 0.2553, 0.3662), ("beta", 0.2527, 0.3676)],
)
def test_the_intervals_of_a_rate_are_those_of_newcombes_first_example(method: str, low: float, high: float) -> None:
    # R. G. Newcombe, Two-sided confidence intervals for the single proportion, Statistics in Medicine 17 (1998) 857.
    interval = rate_interval(81, 263, 0.95, method)  # type: ignore[arg-type]
    assert (interval.low, interval.high) == pytest.approx((low, high), abs=5e-5)


def test_no_successes_of_29_give_the_published_upper_ends() -> None:
    assert rate_interval(0, 29, method="wilson").high == pytest.approx(0.1170, abs=5e-5)
    assert rate_interval(0, 29, method="beta").high == pytest.approx(0.1194, abs=5e-5)


def test_no_episodes_leave_every_rate_possible() -> None:
    interval = rate_interval(0, 0)
    assert (interval.low, interval.high) == (0.0, 1.0)


def test_the_exact_test_of_mcnemar_gives_the_published_p_value() -> None:
    # Fagerland, Lydersen, Laake, The McNemar test for binary matched-pairs data, BMC Med. Res. Methodol. 13:91 (2013):
    # airway hyper-responsiveness before and after stem cell transplantation, 1 and 7 of 21 pairs differ.
    assert paired_p_value(Discordance(1, 7, 21)) == pytest.approx(0.0703, abs=5e-5)


def test_tangos_interval_is_the_published_one() -> None:
    # The same pairs in Fagerland, Lydersen, Laake, Statistics in Medicine 33 (2014) 2850-2875.
    interval = paired_interval(Discordance(1, 7, 21))
    assert (interval.low, interval.high) == pytest.approx((-0.517, -0.026), abs=5e-4)


@given(discordances())
def test_tangos_interval_ends_where_the_score_of_the_likeliest_rates_is_critical(outcomes: Discordance) -> None:
    interval = paired_interval(outcomes)
    for end in (interval.low, interval.high):
        if abs(end) < 1.0 - 1e-6:
            assert abs(_score(outcomes, end)) == pytest.approx(1.959964, abs=2e-3)


def _score(outcomes: Discordance, difference: float) -> float:
    """Returns Tango's score with the likeliest rates found by a numerical search, not by his formula."""
    same = outcomes.pairs - outcomes.first_only - outcomes.second_only

    def surprise(second_rate: float) -> float:
        rates = np.array([second_rate + difference, second_rate, 1.0 - 2.0 * second_rate - difference])
        counts = np.array([outcomes.first_only, outcomes.second_only, same])
        return float(-np.sum(counts * np.log(np.maximum(rates, 1e-300))))

    ends = (max(0.0, -difference), (1.0 - difference) / 2.0)
    second_rate = optimize.minimize_scalar(surprise, bounds=ends, method="bounded", options={"xatol": 1e-12}).x
    variance = outcomes.pairs * (2.0 * second_rate + difference - difference**2)
    return float((outcomes.first_only - outcomes.second_only - outcomes.pairs * difference) / np.sqrt(variance))


@given(discordances())
def test_swapping_the_methods_mirrors_interval_and_keeps_the_p_value(outcomes: Discordance) -> None:
    swapped = Discordance(outcomes.second_only, outcomes.first_only, outcomes.pairs)
    one, other = paired_interval(outcomes), paired_interval(swapped)
    assert (one.low, one.high) == pytest.approx((-other.high, -other.low), abs=1e-9)
    assert paired_p_value(outcomes) == pytest.approx(paired_p_value(swapped))


@given(discordances())
def test_an_exact_test_that_shows_a_difference_has_an_interval_without_0(outcomes: Discordance) -> None:
    interval = paired_interval(outcomes)
    assert interval.low <= outcomes.difference <= interval.high
    if paired_p_value(outcomes) <= 0.05:
        assert interval.low > 0.0 or interval.high < 0.0


def test_25_and_29_of_50_are_not_shown_to_differ_and_25_and_40_are() -> None:
    assert unpaired_p_value((25, 50), (29, 50)) > 0.05
    assert unpaired_p_value((25, 50), (40, 50)) < 0.01


def test_barnards_test_gives_its_published_p_value() -> None:
    # C. R. Mehta, P. Senchaudhuri, Conditional versus unconditional exact tests (2003): 7 of 15 and 12 of 15, one sided
    # 0.034; the example of SciPy's documentation.
    assert unpaired_p_value((7, 15), (12, 15)) == pytest.approx(0.0682, abs=5e-4)


def test_newcombes_interval_of_two_independent_rates_is_the_published_one() -> None:
    # R. G. Newcombe, Interval estimation for the difference between independent proportions, Statistics in Medicine 17
    # (1998) 873-890: 56/70 and 48/80, method 10.
    interval = unpaired_interval((56, 70), (48, 80))
    assert (interval.low, interval.high) == pytest.approx((0.0524, 0.3339), abs=5e-5)


@pytest.mark.parametrize("both", [(0, 0), (20, 20)])
def test_rates_that_are_all_alike_have_no_evidence_of_a_difference(both: tuple[int, int]) -> None:
    assert unpaired_p_value((both[0], 20), (both[1], 20)) == 1.0
