# SPDX-License-Identifier: BSD-3-Clause
"""The quick part of `benchmarks/statistics`: simulated experiments keep the bars of claims, intervals and power."""

from __future__ import annotations

import math
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from modular_framework_benchmark.statistics.rates import paired_interval, paired_p_value

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
import enumerated_outcomes as enumerated  # noqa: E402
import statistics_conditions as conditions  # noqa: E402

EXPERIMENTS = 40
QUICK = [each for each in conditions.CONDITIONS if each.quick]


def test_there_are_at_most_60_conditions_each_with_a_name_of_its_own() -> None:
    names = [(each.kind, each.name) for each in conditions.CONDITIONS]
    assert len(names) == len(set(names)) <= 60


@pytest.mark.parametrize("condition", QUICK, ids=lambda each: f"{each.kind}-{each.name}")
def test_simulated_experiments_keep_their_bar(condition: conditions.Condition, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modular_framework_benchmark.statistics.verdicts.pairs_for_rate", lambda *_: None)
    generator = np.random.default_rng(5)
    found = sum((condition.count(generator) for _ in range(EXPERIMENTS)), Counter())
    rows = list(conditions.rows_of(condition, found))
    assert rows
    assert [row.text() for row in rows if not row.passed] == []


def test_a_rule_that_claims_too_much_and_an_interval_that_holds_too_little_are_found() -> None:
    claims = conditions.Condition("claims", "", lambda _: Counter())
    assert [each.passed for each in conditions.rows_of(claims, Counter(hit=32, no=368))] == [False]
    assert [each.passed for each in conditions.rows_of(claims, Counter(hit=31, no=369))] == [True]
    coverage = conditions.Condition("coverage", "", lambda _: Counter())
    assert [each.passed for each in conditions.rows_of(coverage, Counter({"rate/held": 350, "rate/missed": 50}))] == [
        False
    ]


def test_half_a_deviation_that_is_shown_in_73_percent_of_experiments_is_too_little() -> None:
    (half,) = [each for each in conditions.CONDITIONS if "half a deviation of the differences" in each.name]
    assert [each.passed for each in conditions.rows_of(half, Counter(hit=292, no=108))] == [False]
    assert [each.passed for each in conditions.rows_of(half, Counter(hit=300, no=100))] == [True]
    for success in (each for each in conditions.CONDITIONS if each.kind == "power" and each is not half):
        assert [each.passed for each in conditions.rows_of(success, Counter(hit=292, no=108))] == [True]


def test_the_enumerated_coverage_and_false_claims_are_sums_over_the_outcomes() -> None:
    pairs, won, lost = 7, 0.3, 0.15
    point = int(np.flatnonzero((enumerated.grid() == (won, lost)).all(axis=1))[0])
    outcomes = enumerated.outcomes_of(pairs)
    ends, chances = enumerated.intervals_of(outcomes), enumerated.probabilities_of(outcomes)
    coverage = claims = 0.0
    for item, (low, high) in zip(outcomes, ends, strict=True):
        ties = pairs - item.won - item.lost
        ways = math.comb(pairs, item.won) * math.comb(pairs - item.won, item.lost)
        chance = ways * won**item.won * lost**item.lost * (1.0 - won - lost) ** ties
        interval, p_value = paired_interval(item), paired_p_value(item)
        assert (low, high) == pytest.approx((interval.low, interval.high), abs=1e-9)
        coverage += chance * (interval.low <= won - lost <= interval.high)
        claims += chance * (p_value <= 0.05 and interval.high < 0.0)
    assert enumerated.covered(ends, chances)[point] == pytest.approx(coverage)
    assert enumerated.false_claims(outcomes, ends, chances)[point] == pytest.approx(claims)


@pytest.mark.parametrize("pairs", [6, 11, 21])
def test_enumerated_claims_and_intervals_keep_their_bounds(pairs: int) -> None:
    figures = enumerated.figures_of(pairs)
    assert figures["false claims"].probability <= 0.05
    assert figures["win difference"].probability >= 0.93
    assert figures["rate"].probability >= 0.95
    assert max(figures[alone].probability for alone in ("Tango alone", "Wilson")) < 0.90
