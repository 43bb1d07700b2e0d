# SPDX-License-Identifier: BSD-3-Clause
"""The quick part of `benchmarks/statistics`: simulated experiments keep the bars of claims, intervals and power."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
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
