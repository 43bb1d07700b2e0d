# SPDX-License-Identifier: BSD-3-Clause
"""Curve of a metric: shares counted by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from statistics_results import LENGTH, TIME, results_of

from modular_framework_benchmark.records.experiment import Direction
from modular_framework_benchmark.statistics.curves import performance_profile


def test_a_profile_counts_the_episodes_at_least_as_good_as_each_value() -> None:
    statuses = {"a": ["succeeded"] * 5}
    values = {"path_length": {"a": [1.0, 2.0, 2.0, 4.0, np.nan]}}
    curve = performance_profile(results_of(statuses, (LENGTH,), values), "path_length", "a", [0.5, 2.0, 9.0])
    assert curve.fractions == (0.0, 0.75, 1.0)
    assert (curve.episodes, curve.missing) == (4, 1)
    assert all(low <= share <= high for low, share, high in zip(curve.low, curve.fractions, curve.high, strict=True))
    higher = dataclasses.replace(LENGTH, better=Direction.HIGHER)
    curve = performance_profile(results_of(statuses, (higher,), values), "path_length", "a", [0.5, 2.0, 9.0])
    assert curve.fractions == (1.0, 0.75, 0.0)


def test_a_failure_reaches_no_time() -> None:
    statuses = {"a": ["succeeded", "succeeded", "failed", "failed"]}
    results = results_of(statuses, (TIME,), {"task_time": {"a": [5.0, 6.0, 7.0, np.nan]}})
    curve = performance_profile(results, "task_time", "a")
    assert curve.values == (5.0, 6.0)
    assert curve.fractions == (0.25, 0.5)


def test_a_profile_of_many_episodes_has_at_most_200_points() -> None:
    values = np.random.default_rng(1).lognormal(0.0, 1.0, 3000)
    results = results_of({"a": ["succeeded"] * 3000}, (LENGTH,), {"path_length": {"a": values}})
    curve = performance_profile(results, "path_length", "a")
    assert len(curve.values) == 200
    assert curve.fractions[-1] == 1.0


def test_a_method_without_episodes_has_an_empty_profile() -> None:
    results = results_of({"a": []}, (LENGTH,), {"path_length": {"a": []}})
    assert performance_profile(results, "path_length", "a").values == ()


def test_a_metric_that_is_not_measured_is_refused() -> None:
    results = results_of({"a": ["succeeded"]}, (LENGTH,), {"path_length": {"a": [1.0]}})
    with pytest.raises(
        ValueError, match="metric 'speed' is not measured; the measured metrics are: success, path_length"
    ):
        performance_profile(results, "speed", "a")
