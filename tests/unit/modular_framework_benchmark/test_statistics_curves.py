# SPDX-License-Identifier: BSD-3-Clause
"""Curves of a metric: the published Kaplan-Meier example, shares counted by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from statistics_results import LENGTH, TIME, results_of

from modular_framework_benchmark.records.experiment import Direction
from modular_framework_benchmark.statistics.curves import performance_profile, share_finished


def test_the_share_finished_is_that_of_the_published_remission_times() -> None:
    # E. Freireich and others, Blood 21 (1963) 699-716: 6-mercaptopurine; a patient whose observation ended is like an
    # episode that broke.
    ended = [6, 6, 6, 7, 10, 13, 16, 22, 23]
    left = [6, 9, 10, 11, 17, 19, 20, 25, 32, 32, 34, 35]
    statuses = {"a": ["succeeded"] * len(ended) + ["broken"] * len(left)}
    results = results_of(statuses, (TIME,), {"task_time": {"a": [float(time) for time in ended + left]}})
    results.episodes["simulated_s"] = [float(time) for time in ended + left]
    curve = share_finished(results, "task_time", "a")
    remaining = dict(zip(curve.at, (1 - share for share in curve.share), strict=True))
    published = {6: 0.857, 7: 0.807, 10: 0.753, 13: 0.690, 16: 0.627, 22: 0.538, 23: 0.448}
    assert {time: remaining[float(time)] for time in published} == pytest.approx(published, abs=5e-4)
    place = curve.at.index(10.0)
    # Its log-log interval at 10 weeks, as R's survfit gives it with conf.type = "log-log".
    assert (1 - curve.high[place], 1 - curve.low[place]) == pytest.approx((0.503, 0.889), abs=1e-3)


def test_failed_episodes_never_finish_and_broken_ones_without_a_time_are_told() -> None:
    statuses = {"a": ["succeeded", "succeeded", "failed", "timed_out", "broken"]}
    results = results_of(statuses, (TIME,), {"task_time": {"a": [5.0, 10.0, 7.0, np.nan, np.nan]}})
    curve = share_finished(results, "task_time", "a")
    assert curve.share[-1] == pytest.approx(0.5)
    assert (curve.episodes, curve.left_out) == (4, 1)


def test_no_finished_episode_gives_an_empty_curve_that_says_so() -> None:
    results = results_of({"a": ["failed"] * 3}, (TIME,), {"task_time": {"a": [1.0] * 3}})
    curve = share_finished(results, "task_time", "a")
    assert (curve.at, curve.method) == ((), "Kaplan-Meier: no episode finished")


def test_a_profile_counts_the_episodes_at_least_as_good_as_each_value() -> None:
    statuses = {"a": ["succeeded"] * 5}
    values = {"path_length": {"a": [1.0, 2.0, 2.0, 4.0, np.nan]}}
    curve = performance_profile(results_of(statuses, (LENGTH,), values), "path_length", "a", [0.5, 2.0, 9.0])
    assert curve.share == (0.0, 0.75, 1.0)
    assert (curve.episodes, curve.left_out) == (4, 1)
    assert all(low <= share <= high for low, share, high in zip(curve.low, curve.share, curve.high, strict=True))
    higher = dataclasses.replace(LENGTH, better=Direction.HIGHER)
    curve = performance_profile(results_of(statuses, (higher,), values), "path_length", "a", [0.5, 2.0, 9.0])
    assert curve.share == (1.0, 0.75, 0.0)


def test_an_episode_at_the_limit_reaches_no_time() -> None:
    statuses = {"a": ["succeeded", "succeeded", "failed", "failed"]}
    results = results_of(statuses, (TIME,), {"task_time": {"a": [5.0, 6.0, 7.0, np.nan]}})
    curve = performance_profile(results, "task_time", "a")
    assert curve.at == (5.0, 6.0)
    assert curve.share == (0.25, 0.5)


def test_a_profile_of_many_episodes_has_at_most_200_points() -> None:
    values = np.random.default_rng(1).lognormal(0.0, 1.0, 3000)
    results = results_of({"a": ["succeeded"] * 3000}, (LENGTH,), {"path_length": {"a": values}})
    curve = performance_profile(results, "path_length", "a")
    assert len(curve.at) == 200
    assert curve.share[-1] == 1.0


def test_a_method_without_episodes_has_an_empty_profile() -> None:
    results = results_of({"a": []}, (LENGTH,), {"path_length": {"a": []}})
    assert performance_profile(results, "path_length", "a").at == ()


def test_a_metric_that_is_not_measured_or_has_no_limit_is_refused() -> None:
    results = results_of({"a": ["succeeded"]}, (LENGTH,), {"path_length": {"a": [1.0]}})
    with pytest.raises(ValueError, match="metric 'speed' is not measured; measured are: success, path_length"):
        performance_profile(results, "speed", "a")
    with pytest.raises(ValueError, match="metric 'path_length' is no time with a limit"):
        share_finished(results, "path_length", "a")
