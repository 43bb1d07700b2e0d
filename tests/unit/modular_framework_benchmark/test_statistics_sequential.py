# SPDX-License-Identifier: BSD-3-Clause
"""Tests that hold at any time: betting on no difference is a fair game, and looking often claims no more."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import special
from statistics_results import LENGTH, outcomes, results_of

from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics.rates import PairOutcomes, paired_interval
from modular_framework_benchmark.statistics.sequential import (
    anytime_interval,
    anytime_p_value,
    log_capital,
)
from modular_framework_benchmark.statistics.stopping import AnytimeValid

SIDES = np.array([-1.0, 0.0, 1.0])


@given(st.floats(0.01, 0.98), st.floats(0.0, 1.0), st.integers(1, 6))
def test_betting_against_the_true_difference_neither_wins_nor_loses_on_average(
    differing: float, won: float, pairs: int
) -> None:
    shares = np.array([differing * (1 - won), 1 - differing, differing * won])
    true = float(shares @ SIDES)
    expected = 0.0
    for sequence in product(range(3), repeat=pairs):
        counts = np.bincount(sequence, minlength=3).astype(float)
        expected += float(np.prod(shares[list(sequence)]) * np.exp(log_capital(SIDES, counts, true)))
    assert expected == pytest.approx(1.0, abs=1e-9)


def test_the_capital_is_that_of_the_mixture_of_likelihood_ratios() -> None:
    # Against no difference with sizes of the bet spread evenly: 2^n times the beta function, by its closed form.
    for one, other in ((0, 0), (3, 0), (7, 2), (20, 11)):
        exact = (one + other) * np.log(2) + special.betaln(one + 1, other + 1)
        assert log_capital(SIDES, np.array([other, 50, one], dtype=float)) == pytest.approx(exact, abs=1e-9)


def test_looking_after_every_pair_claims_a_difference_between_identical_methods_in_at_most_5_percent() -> None:
    random = np.random.default_rng(3)
    experiments, pairs = 1000, 200
    success = random.random((experiments, pairs, 2)) < random.beta(3.0, 1.0, (experiments, pairs, 1))
    differences = success[..., 0].astype(int) - success[..., 1]
    counts = np.cumsum(differences[..., None] == SIDES, axis=1).astype(float)
    ever = np.max(log_capital(SIDES, counts), axis=1) >= np.log(20)
    assert 0 < ever.sum() <= 50  # 5 %


@settings(max_examples=30)
@given(st.integers(0, 40), st.integers(0, 40), st.integers(0, 40))
def test_an_interval_for_any_time_is_wider_than_one_for_a_fixed_number_and_agrees_with_its_test(
    one: int, other: int, same: int
) -> None:
    pairs = one + other + same
    if not pairs:
        return
    differences = np.repeat(SIDES, [other, same, one])
    found, fixed = anytime_interval(differences, 0.95), paired_interval(PairOutcomes(one, other, pairs))
    assert found.low <= float(np.mean(differences)) <= found.high
    assert found.high - found.low >= fixed.high - fixed.low - 1e-6
    shown = anytime_p_value(differences) <= 0.05
    assert shown == (found.low > 0.0 or found.high < 0.0)


def test_the_order_of_the_pairs_does_not_matter() -> None:
    differences = np.random.default_rng(1).choice(SIDES, 60, p=[0.1, 0.5, 0.4])
    assert anytime_p_value(differences) == pytest.approx(anytime_p_value(differences[::-1]))


def sequential(first: list[int], second: list[int], planned: int = 1000) -> ExperimentResults:
    return results_of({"a": outcomes(first), "b": outcomes(second)}, sequential=True, planned=planned)


def test_the_rule_goes_on_without_evidence_and_stops_once_a_difference_is_shown() -> None:
    rule = AnytimeValid()
    undecided = rule.decide(sequential([1, 0, 1], [0, 1, 1]))
    assert not undecided.stop
    assert undecided.reason == "not decided yet after 3 pairs: a and b"
    decided = rule.decide(sequential([1] * 20, [0] * 20))
    assert decided.stop
    assert decided.reason.startswith(
        "every comparison of success is decided: a succeeds more often than b (+100 points"
    )


def test_the_rule_stops_when_the_methods_are_alike_enough() -> None:
    alike = sequential([1] * 300, [1] * 300)
    assert not AnytimeValid().decide(alike).stop
    decision = AnytimeValid(smallest_difference=0.05).decide(alike)
    assert decision.stop
    assert decision.reason == "every comparison of success is decided: a and b differ by less than 5 points"


def test_the_rule_stops_when_the_planned_episodes_are_finished() -> None:
    same = [1, 0] * 4
    assert AnytimeValid().decide(sequential(same, same, planned=16)).stop


def test_the_rule_looks_at_other_metrics_than_success() -> None:
    statuses = {"a": ["succeeded"] * 30, "b": ["succeeded"] * 30}
    values = {"path_length": {"a": [1.0] * 30, "b": [2.0] * 30}}
    results = results_of(statuses, (LENGTH,), values, sequential=True, planned=1000)
    decision = AnytimeValid("path_length").decide(results)
    assert decision.stop
    assert "a more often has the lower path length than b" in decision.reason


def test_equal_first_values_do_not_make_methods_alike() -> None:
    statuses = {"a": ["succeeded"] * 2, "b": ["succeeded"] * 2}
    values = {"path_length": {"a": [1.0, 1.0], "b": [1.0, 1.0]}}
    few = results_of(statuses, (LENGTH,), values, sequential=True, planned=1000)
    assert not AnytimeValid("path_length", 0.2).decide(few).stop
    statuses = {name: ["succeeded"] * 60 for name in "ab"}
    many = results_of(statuses, (LENGTH,), {"path_length": dict.fromkeys("ab", [1.0] * 60)}, sequential=True,
                      planned=1000)  # fmt: skip
    assert AnytimeValid("path_length", 0.2).decide(many).reason.endswith("differ by less than 20 points of pairs won")


def test_a_rule_with_one_method_or_no_episodes_goes_on() -> None:
    assert not AnytimeValid().decide(results_of({"a": outcomes([1])}, sequential=True, planned=9)).stop
    assert not AnytimeValid().decide(results_of({"a": [], "b": []}, sequential=True, planned=9)).stop


@pytest.mark.parametrize(
    ("rule", "words"),
    [
        (lambda: AnytimeValid(smallest_difference=0.0), "smallest_difference is 0.0; it must be above 0 and at most 1"),
        (
            lambda: AnytimeValid("speed").decide(sequential([1], [1])),
            "uses 'speed', which is not measured; measured are: success",
        ),
        (
            lambda: AnytimeValid().decide(results_of({"a": outcomes([1]), "b": outcomes([1])})),
            "experiment 'test' is not sequential",
        ),
    ],
)
def test_a_rule_that_cannot_be_kept_is_refused(rule: object, words: str) -> None:
    with pytest.raises(ValueError, match=words.replace("(", r"\(")):
        rule()  # type: ignore[operator]
