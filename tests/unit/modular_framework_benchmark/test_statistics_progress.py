# SPDX-License-Identifier: BSD-3-Clause
"""Progress is partial credit: a failed episode counts with what it reached, and one without a value with nothing."""

from __future__ import annotations

import numpy as np
import pytest
from statistics_results import outcomes, results_of

from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics.analysis import compare
from modular_framework_benchmark.statistics.comparison import Comparison, Verdict
from modular_framework_benchmark.statistics.observations import EpisodeTable
from modular_framework_benchmark.statistics.stopping import AnytimeValid

PROGRESS = Metric("progress", "task", MetricKind.PARTIAL_CREDIT, Direction.HIGHER, lowest=0.0, highest=1.0)


def experiment(
    first: list[float], second: list[float], sequential: bool = False, planned: int = 0
) -> ExperimentResults:
    values = {"progress": {"first": first, "second": second}}
    statuses = {"first": outcomes([False] * len(first)), "second": outcomes([False] * len(second))}
    return results_of(statuses, [PROGRESS], values, sequential=sequential, planned=planned or 2 * len(first))


def of_progress(results: ExperimentResults) -> Comparison:
    (found,) = [item for item in compare(results) if item.metric == "progress"]
    return found


def test_failed_episodes_are_compared_by_how_far_they_got() -> None:
    found = of_progress(experiment([0.75] * 12, [0.25] * 12))
    assert found.verdict is Verdict.FIRST_BETTER and (found.counts.won, found.counts.failed) == (12, 0)
    assert found.mean_difference is not None and found.mean_difference.value == pytest.approx(0.5)
    interval = found.mean_difference.interval
    assert interval is not None and interval.low < 0.5 < interval.high <= 1.0
    assert "mean difference +50 points" in found.sentence


def test_an_episode_without_progress_counts_as_none_and_not_as_worse() -> None:
    values = {"progress": {"only": [0.5, float("nan"), 0.0]}}
    results = results_of({"only": ["failed", "broken", "timed_out"]}, [PROGRESS], values)
    observed = EpisodeTable(results).observations(PROGRESS, "only")
    assert observed.scores.tolist() == observed.values.tolist() == [0.5, 0.0, 0.0]


def test_an_experiment_without_milestones_has_no_progress() -> None:
    found = of_progress(experiment([float("nan")] * 12, [float("nan")] * 12))
    assert found.verdict is Verdict.NO_DATA


def test_a_sequential_experiment_stops_on_progress_although_no_episode_succeeds() -> None:
    random = np.random.default_rng(4)
    reached = [random.integers(0, 5, 60) / 4, random.integers(0, 3, 60) / 4]
    results = experiment(reached[0].tolist(), reached[1].tolist(), sequential=True, planned=400)
    decision = AnytimeValid("progress").decide(results)
    assert decision.stop and "first more often has the higher progress than second" in decision.reason
    assert not AnytimeValid("success").decide(results).stop


def test_looking_at_progress_after_every_pair_claims_a_difference_of_identical_methods_in_at_most_5_percent() -> None:
    random = np.random.default_rng(5)
    false_claims = 0
    for _ in range(60):
        easy = random.random(40)
        first, second = ((random.random((40, 4)) < easy[:, None]).cumprod(axis=1).mean(axis=1) for _ in range(2))
        looks = [
            experiment(first[:n].tolist(), second[:n].tolist(), sequential=True, planned=400) for n in (10, 20, 40)
        ]
        false_claims += any(AnytimeValid("progress").decide(results).stop for results in looks)
    assert false_claims <= 3
