# SPDX-License-Identifier: BSD-3-Clause
"""Comparisons of two experiments: refused experiments, and allowed names of factors."""

from __future__ import annotations

import dataclasses

import pytest
from statistics_results import results_of

from modular_framework_benchmark.records.experiment import Factor
from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.reports.regression import Change, compare_experiments

SOUND = results_of({"a": ["succeeded"] * 12, "b": ["succeeded"] * 12})


@pytest.mark.parametrize("status", ["broken", "invalid"])
def test_an_experiment_that_measured_no_method_is_not_compared(status: str) -> None:
    unmeasured = results_of({"a": [status] * 12, "b": [status] * 12})
    reason = "every episode of every method ended for a reason outside the methods, so nothing is compared; .*"
    with pytest.raises(ReportError, match=f"^later experiment test: {reason}it {status}"):
        compare_experiments(SOUND, unmeasured)
    with pytest.raises(ReportError, match=f"^earlier experiment test: {reason}it {status}"):
        compare_experiments(unmeasured, SOUND)


@pytest.mark.parametrize("compared", ["method", "side"])
def test_a_factor_may_be_named_side(compared: str) -> None:
    plain = results_of({"a": ["succeeded", "failed"] * 10, "b": ["succeeded"] * 20}, objects=("left", "right"))
    factors = (Factor("method", ("a", "b")), Factor("side", ("left", "right")))
    results = dataclasses.replace(
        plain,
        description=dataclasses.replace(plain.description, factors=factors, compared=compared),
        episodes=plain.episodes.rename(columns={"object": "side"}),
    )
    found = compare_experiments(results, results)
    assert [each.method for each in found.changes] == list(
        next(factor.levels for factor in factors if factor.name == compared)
    )
    assert all(each.change is not Change.WORSE for each in found.changes)
    assert all(each.comparison.counts.pairs == 20 for each in found.changes)
