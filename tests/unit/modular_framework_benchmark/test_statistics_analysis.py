# SPDX-License-Identifier: BSD-3-Clause
"""The statistics of an experiment as a user reads them: verdicts, sentences, what is said beside them."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from statistics_results import LENGTH, TIME, outcomes, results_of

from modular_framework_benchmark.metrics.registry import METRICS
from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.reports.report_content import plain_json
from modular_framework_benchmark.statistics.analysis import (
    analyse,
    compare,
    summarise,
    summarise_by_level,
)
from modular_framework_benchmark.statistics.comparison import Comparison, Estimate, Verdict
from modular_framework_ros.reported_figures import Clock

COLLISION = Metric("collision", "execution", MetricKind.RATE, Direction.LOWER)
CLEARANCE = Metric("clearance", "planning", MetricKind.VALUE, Direction.HIGHER, "m")


def successes(first: Sequence[int], second: Sequence[int], **settings: object) -> ExperimentResults:
    return results_of({"A": outcomes(first), "B": outcomes(second)}, **settings)  # type: ignore[arg-type]


def pairs(both: int, only_first: int, only_second: int, none: int, **settings: object) -> ExperimentResults:
    """Returns results with a number of pairs of each kind."""
    first = [1] * (both + only_first) + [0] * (only_second + none)
    second = [1] * both + [0] * only_first + [1] * only_second + [0] * none
    return successes(first, second, **settings)


def of_values(metric: Metric, first: Sequence[float], second: Sequence[float]) -> Comparison:
    statuses = {"A": ["succeeded"] * len(first), "B": ["succeeded"] * len(second)}
    return compare(results_of(statuses, (metric,), {metric.name: {"A": first, "B": second}}))[1]


def mean_of(metric: Metric, values: Sequence[float]) -> Estimate:
    """Returns the mean of a metric."""
    results = results_of({"A": ["succeeded"] * len(values)}, (metric,), {metric.name: {"A": values}})
    (found,) = (item for item in summarise(results) if item.metric == metric.name)
    assert found.mean is not None
    return found.mean


def test_a_difference_that_is_shown_is_a_plain_sentence() -> None:
    (found,) = compare(pairs(120, 40, 16, 24))
    assert found.sentence == "A succeeds more often than B (+12 points, 95 % interval 5 to 20, 200 paired episodes)"
    assert found.verdict is Verdict.FIRST_BETTER
    assert found.p_value == pytest.approx(2 * sum(math.comb(56, n) for n in range(17)) / 2**56)
    assert found.test == "McNemar's exact test"
    assert (found.counts.won, found.counts.lost) == (40, 16)


def test_the_better_method_comes_first_and_its_difference_has_its_sign() -> None:
    (found,) = compare(pairs(120, 16, 40, 24))
    assert found.sentence == "B succeeds more often than A (+12 points, 95 % interval 5 to 20, 200 paired episodes)"
    assert found.verdict is Verdict.SECOND_BETTER
    assert found.difference is not None
    assert found.difference.value == pytest.approx(-0.12)


def test_a_difference_that_is_not_shown_says_how_many_pairs_would_show_5_points() -> None:
    (found,) = compare(pairs(40, 6, 5, 9))
    assert found.sentence.startswith(
        "no difference in success shown between A and B (+2 points, 95 % interval -11 to 14"
    )
    assert found.sentence.endswith(f"; {found.pairs_needed} paired episodes would show 5 points")
    assert found.pairs_needed is not None
    assert found.pairs_needed > 60


def test_a_shorter_time_and_a_higher_clearance_are_better() -> None:
    shorter = of_values(dataclasses.replace(TIME, name="planning_time", limit=None), [1.0, 1.1] * 10, [2.0, 2.2] * 10)
    assert shorter.verdict is Verdict.FIRST_BETTER
    assert shorter.sentence == (
        "A more often has the shorter planning time than B (20 pairs won, 0 lost, +100 points, "
        "95 % interval 61 to 100, 20 paired episodes, mean difference -1.1 s)"
    )
    higher = of_values(CLEARANCE, [0.10, 0.11] * 10, [0.2, 0.22] * 10)
    assert higher.verdict is Verdict.SECOND_BETTER
    assert higher.sentence.startswith("B more often has the higher clearance than A (20 pairs won, 0 lost")


def test_counts_are_more_or_fewer() -> None:
    more = of_values(METRICS["candidates"].metric, [30.0, 31.0] * 10, [158.0, 160.0] * 10)
    assert more.sentence.startswith("B more often has more candidates than A (20 pairs won, 0 lost")
    fewer = of_values(METRICS["attempts"].metric, [1.0, 2.0] * 10, [4.0, 6.0] * 10)
    assert fewer.sentence.startswith("A more often has fewer attempts than B (20 pairs won, 0 lost")


def test_only_the_mean_of_a_bounded_metric_has_an_interval() -> None:
    few = [0.0] * 10 + [2.0, 3.0, 4.0, 1.0, 2.5]
    assert mean_of(LENGTH, few).interval is None
    assert mean_of(METRICS["failed_states"].metric, few).interval is None
    share = mean_of(METRICS["reachable_share"].metric, [1.0] * 15 + [0.5, 0.7, 0.2, 0.9]).interval
    assert share is not None and share.low < 0.9 < share.high <= 1.0
    time = mean_of(dataclasses.replace(TIME, limit=10.0), [10.0] * 10 + [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    assert time.name == "restricted mean"
    assert time.interval is not None and time.interval.high <= 10.0


def test_equal_values_have_a_median_with_an_interval_of_ranks_and_no_interval_of_the_mean() -> None:
    results = results_of({"A": ["succeeded"] * 9}, (LENGTH,), {"path_length": {"A": [2.0] * 9}})
    (found,) = (item for item in summarise(results) if item.metric == "path_length")
    assert found.mean is not None and found.mean.interval is None
    assert found.estimate is not None and found.estimate.name == "median"


def test_a_hold_time_counts_as_measured_and_as_0_in_an_episode_that_lost_the_object() -> None:
    hold = dataclasses.replace(METRICS["hold_time"].metric, limit=0.0)
    statuses = {"A": ["succeeded"] * 15 + ["failed"] * 5, "B": ["succeeded"] * 20}
    held = {"A": [3.0] * 15 + [np.nan] * 5, "B": [6.0] * 20}
    found = compare(results_of(statuses, (hold,), {"hold_time": held}))[1]
    assert found.mean_difference is not None and found.mean_difference.value == 2.25 - 6.0
    assert found.sentence.startswith("B more often has the longer hold time than A (20 pairs won, 0 lost")


def test_a_lower_rate_of_collisions_is_better() -> None:
    results = results_of(
        {"A": ["succeeded"] * 30, "B": ["succeeded"] * 30}, (COLLISION,),
        {"collision": {"A": [0.0] * 30, "B": [1.0] * 15 + [0.0] * 15}},
    )  # fmt: skip
    assert compare(results)[1].sentence.startswith("A has a lower rate of collision than B (-50 points")


def test_a_failure_is_worse_than_any_value_and_two_failures_are_a_tie() -> None:
    statuses = {"A": ["succeeded"] * 15 + ["failed"] * 5, "B": ["succeeded"] * 12 + ["timed_out"] * 8}
    values = {"task_time": {"A": [3.0] * 20, "B": [59.0] * 6 + [2.0] * 6 + [np.nan] * 8}}
    results = results_of(statuses, (TIME,), values)
    summary = next(each for each in summarise(results) if (each.method, each.metric) == ("A", "task_time"))
    assert summary.mean is not None
    assert (summary.mean.name, summary.mean.value) == ("restricted mean", pytest.approx((15 * 3 + 5 * 60) / 20))
    found = compare(results)[1]
    assert (found.counts.won, found.counts.lost, found.counts.pairs) == (9, 6, 20)
    assert "13 of 40 episodes failed and count as worse than any value" in found.notes


def test_a_method_that_is_faster_but_fails_more_is_not_the_slower_one_in_the_claim() -> None:
    # The other one has the shorter restricted mean; the pairs, the direction and the p value all say the opposite.
    random = np.random.default_rng(4)
    scene = random.lognormal(1.5, 0.3, 100)
    times = {"A": scene * 0.8, "B": scene}
    statuses = {"A": outcomes(random.random(100) < 0.85), "B": outcomes(random.random(100) < 0.98)}
    found = compare(results_of(statuses, (dataclasses.replace(TIME, limit=120.0),), {"task_time": times}))[1]
    assert found.mean_difference is not None and found.mean_difference.value > 0.0
    assert found.verdict is Verdict.FIRST_BETTER
    assert found.sentence.startswith("A more often has the shorter task time than B")


def test_a_component_that_did_its_work_keeps_its_time_in_a_task_that_failed_later() -> None:
    planning = dataclasses.replace(TIME, name="planning_time", component="planning")
    statuses = {"A": ["failed"] * 2, "B": ["succeeded"] * 2}
    values = {"planning_time": {"A": [1.0, np.nan], "B": [1.0, 80.0]}}
    results = results_of(statuses, (planning,), values)
    found = {each.method: each for each in summarise(results) if each.metric == "planning_time"}
    assert found["A"].mean.value == pytest.approx(30.5)  # type: ignore[union-attr]
    assert found["B"].mean.value == pytest.approx(30.5)  # type: ignore[union-attr]
    alone = dataclasses.replace(results, description=dataclasses.replace(results.description, mode="planning"))
    found = {each.method: each for each in summarise(alone) if each.metric == "planning_time"}
    assert found["A"].mean.value == pytest.approx(60.0)  # type: ignore[union-attr]


def test_a_time_that_nothing_measured_is_missing_and_not_at_its_limit() -> None:
    search = dataclasses.replace(TIME, name="search_time", component="planning")
    statuses = {"A": ["succeeded", "failed"], "B": ["succeeded"] * 2}
    unmeasured = results_of(statuses, (search,), {"search_time": {"A": [np.nan] * 2, "B": [np.nan] * 2}})
    found = next(each for each in summarise(unmeasured) if each.metric == "search_time")
    assert found.estimate is None and found.counts.censored == 0 and found.counts.missing == 2
    in_part = results_of(statuses, (search,), {"search_time": {"A": [np.nan] * 2, "B": [1.0, np.nan]}})
    found = next(each for each in summarise(in_part) if (each.method, each.metric) == ("A", "search_time"))
    assert found.counts.censored == 1 and found.counts.missing == 1  # the failure, and the success without a value


@pytest.mark.parametrize("clock", [Clock.WALL, Clock.PROCESSOR, Clock.SIMULATED])
def test_a_first_episode_of_a_stack_is_not_compared_in_real_time_with_a_later_one(clock: Clock) -> None:
    first = np.arange(60) % 3 == 0  # of A only: its stack ended after every third episode
    noise = np.random.default_rng(1).normal(0.0, 0.01, (2, 60))
    times = {"A": 1.0 + 0.5 * first + noise[0], "B": 1.0 + noise[1]}
    metric = dataclasses.replace(TIME, clock=clock)
    results = results_of({name: ["succeeded"] * 60 for name in times}, (metric,), {TIME.name: times})
    marked = results.episodes.assign(cold_start=[*first, *[False] * 60])
    found = compare(dataclasses.replace(results, episodes=marked))[1]
    if clock is Clock.SIMULATED:
        assert (found.counts.pairs, found.counts.unlike, found.verdict) == (60, 0, Verdict.SECOND_BETTER)
        return
    assert (found.counts.pairs, found.counts.unlike, found.counts.missing) == (40, 20, 0)
    assert found.verdict is Verdict.NOT_SHOWN
    assert (
        "20 pairs left out because only one episode is the first of its stack, or the numbers of workers differ"
    ) in found.notes
    both = compare(dataclasses.replace(results, episodes=results.episodes.assign(cold_start=[*first, *first])))[1]
    assert (both.counts.pairs, both.counts.unlike) == (60, 0)
    none = compare(
        dataclasses.replace(results, episodes=results.episodes.assign(cold_start=[True] * 60 + [False] * 60))
    )
    assert none[1].verdict is Verdict.NO_DATA and "only one episode is the first of its stack" in none[1].sentence


def test_missing_values_are_left_out_and_counted() -> None:
    found = of_values(LENGTH, [1.0, 2.0, np.nan, 4.0], [2.0, np.nan, np.nan, 5.0])
    assert (found.counts.pairs, found.counts.missing) == (2, 2)
    assert "2 pairs left out because an episode has no value" in found.notes


@pytest.mark.parametrize("status", ["broken", "invalid"])
def test_unmeasured_episodes_count_as_failures_and_what_they_decide_is_told(status: str) -> None:
    statuses = {"A": ["succeeded"] * 20, "B": ["succeeded"] * 12 + [status] * 8}
    (found,) = compare(results_of(statuses))
    assert found.verdict is Verdict.FIRST_BETTER
    assert found.verdict_without_broken is Verdict.NOT_SHOWN
    assert found.notes == (
        "8 broken or invalid episodes counted as failures; without their pairs the verdict changes "
        "(0 points, 95 % interval -30 to 30, 12 paired episodes)",
    )
    of_b = next(each for each in summarise(results_of(statuses)) if each.method == "B")
    assert (of_b.counts.broken + of_b.counts.invalid, of_b.counts.failed) == (8, 0)
    assert f"8 {status}" in of_b.sentence
    assert of_b.estimate is not None
    assert of_b.estimate.value == 0.6


@pytest.mark.parametrize("last", ["broken", "invalid"])
def test_an_experiment_that_measured_no_method_says_why_and_claims_nothing(last: str) -> None:
    results = results_of({"A": ["broken"] * 10, "B": ["broken"] * 9 + [last]})
    analysis = analyse(results)
    assert analysis.comparisons == ()
    assert all(summary.estimate is None for summary in analysis.summaries)
    (sentence,) = analysis.sentences
    count = 20 if last == "broken" else 19
    assert sentence == (
        "every episode of every method ended for a reason outside the methods, so nothing is compared; the most "
        f"frequent ({count} of 20): it broken"
    )


@pytest.mark.parametrize("other", ["failed", "timed_out", "succeeded"])
def test_one_episode_that_measured_a_method_is_enough_for_comparisons(other: str) -> None:
    assert analyse(results_of({"A": ["broken"] * 10, "B": ["broken"] * 9 + [other]})).comparisons


def test_pairs_of_a_seed_count_as_one() -> None:
    # In each of 5 seeds the three objects have the same outcome: 15 pairs for A that are worth 5.
    first, second = np.ones(30, dtype=int), np.repeat([0, 1], 15)
    apart = successes(first.tolist(), second.tolist(), objects=("can", "box", "cup"))
    shared = successes(first.tolist(), second.tolist(), objects=("can", "box", "cup"), seed_per_pair=False)
    assert compare(apart)[0].verdict is Verdict.FIRST_BETTER
    found = compare(shared)[0]
    assert (found.counts.pairs, found.counts.units) == (30, 10)
    assert found.p_value == pytest.approx(2 / 2**5)
    assert found.verdict is Verdict.NOT_SHOWN
    assert "30 paired episodes of 10 scenes" in found.sentence
    assert any("30 pairs of 10 scenes; all pairs of a unit count as one" in note for note in found.notes)


def test_repeated_problems_are_the_units_of_planning() -> None:
    first, second = np.tile([1] * 12 + [0] * 8, 5), np.tile([1] * 4 + [0] * 16, 5)
    results = successes(first.tolist(), second.tolist())
    results = dataclasses.replace(results, description=dataclasses.replace(results.description, mode="planning"))
    results.episodes["drawn_problem"] = (results.episodes["trial"] % 20).astype(str)
    analysis = analyse(results)
    (found,) = analysis.comparisons
    assert (found.counts.pairs, found.counts.units, found.unit_noun) == (100, 20, "problem")
    assert found.p_value == pytest.approx(2 / 2**8)
    assert analysis.scope == (
        "The unit is the problem: 20 problems for 100 trials; all trials of a unit count as one. "
        "Claims are about problems like these."
    )
    rate = next(each for each in analysis.summaries if each.method == "A").estimate
    assert rate is not None and rate.interval is not None
    assert rate.interval.high - rate.interval.low > 0.4  # 20 units, not 100 episodes
    uneven = results.episodes["trial"] % 20 + 100 * (results.episodes["trial"] // 90)
    results.episodes["drawn_problem"] = uneven.astype(str)
    assert compare(results)[0].counts.units == 30


def test_a_problem_that_is_the_only_one_is_not_drawn_and_crossed_units_are_the_coarser_ones() -> None:
    results = successes([1] * 40, [1] * 20 + [0] * 20)
    results.episodes["drawn_problem"] = "one"
    assert compare(results)[0].counts.units == 40
    results.episodes["drawn_problem"] = (results.episodes["trial"] % 10).astype(str)
    results.episodes["seed"] = results.episodes["trial"] // 10
    found = compare(results)[0]
    assert (found.counts.units, found.unit_noun) == (4, "scene")
    assert found.verdict is Verdict.NOT_SHOWABLE


def test_units_whose_pairs_differ_have_the_test_of_sign_flips_and_students_interval() -> None:
    first = [1, 1, 0, 1, 0, 1] * 8
    second = [0, 1, 0, 0, 1, 0] * 4 + [1, 0, 1, 0, 0, 0] * 4
    results = successes(first, second, objects=("can", "box", "cup"), seed_per_pair=False)
    (found,) = compare(results)
    means = (np.array(first) - np.array(second)).reshape(16, 3).mean(axis=1)
    exact = stats.ttest_1samp(means, 0.0)
    assert found.test == "sign flip test of the units"
    assert found.difference is not None and found.difference.interval is not None
    assert found.difference.value == pytest.approx(means.mean())
    interval = exact.confidence_interval(0.95)
    assert (found.difference.interval.low, found.difference.interval.high) == pytest.approx(
        (interval.low, interval.high)
    )


def test_each_level_of_another_factor_has_its_own_summary() -> None:
    results = successes([1, 1] * 20, [0, 1] * 20, objects=("can", "box"))
    found = summarise_by_level(results, "object")
    assert [each.levels for each in found] == ["object=can"] * 2 + ["object=box"] * 2
    assert [each.estimate.value for each in found if each.estimate] == [1.0, 0.0, 1.0, 1.0]


def test_methods_without_a_common_trial_are_paired_at_random() -> None:
    results = successes([1] * 40, [0] * 20 + [1] * 20)
    results.episodes.loc[results.episodes["method"] == "B", "trial"] += 1000
    (found,) = compare(results)
    assert (found.counts.pairs, found.counts.won, found.counts.at_random) == (40, 20, True)
    assert found.sentence == (
        "A succeeds more often than B (+50 points, 95 % interval 34 to 66, 40 pairs of any two episodes)"
    )


def test_a_partner_that_is_not_finished_is_told() -> None:
    results = successes([1, 1, 1, 0], [1, 1, 0, 0], planned=10)
    shorter = dataclasses.replace(results, episodes=results.episodes.iloc[:-1])
    (found,) = compare(shorter)
    assert found.counts.pairs == 3
    assert "1 episode without a partner" in found.notes
    assert found.notes[-1] == "unfinished: 7 of 10 episodes; nothing is claimed before the last episode"


def test_a_fixed_experiment_claims_nothing_before_its_last_episode() -> None:
    assert compare(pairs(120, 40, 16, 24))[0].verdict is Verdict.FIRST_BETTER
    (found,) = compare(pairs(120, 40, 16, 24, planned=401))
    assert found.verdict is Verdict.NOT_SHOWN


def test_an_extended_experiment_uses_tests_that_hold_at_any_time() -> None:
    results = pairs(120, 40, 16, 24)
    results = dataclasses.replace(results, description=dataclasses.replace(results.description, extended=True))
    analysis = analyse(results)
    assert analysis.comparisons[0].test == "betting test, valid at any time"
    assert "because episodes were added after results had been seen" in analysis.rule


@pytest.mark.parametrize("count", [2, 5])
def test_below_6_units_there_is_no_interval_no_test_and_no_claim(count: int) -> None:
    analysis = analyse(successes([1] * count, [0] * count))
    (found,) = analysis.comparisons
    assert (found.verdict, found.p_value) == (Verdict.NOT_SHOWABLE, None)
    assert found.difference is not None and found.difference.interval is None
    assert found.sentence.startswith(
        f"a difference in success between A and B could not have been shown with {count} pairs ({count} won, 0 lost)"
    )
    assert all(each.estimate is not None and each.estimate.interval is None for each in analysis.summaries)


def test_a_mean_difference_has_an_interval_only_on_request_and_only_with_bounds() -> None:
    values = {"task_time": {"A": [3.0, 4.0] * 10, "B": [9.0, 8.0] * 10}}
    results = results_of({name: ["succeeded"] * 20 for name in "AB"}, (TIME,), values)
    without, asked = (compare(results, mean_intervals=flag)[1].mean_difference for flag in (False, True))
    assert without is not None and asked is not None and asked.interval is not None
    assert without.interval is None
    assert asked.interval.low < asked.value == -5.0 < asked.interval.high
    values["path_length"] = values.pop("task_time")
    unbounded = results_of({name: ["succeeded"] * 20 for name in "AB"}, (LENGTH,), values)
    found = compare(unbounded, mean_intervals=True)[1].mean_difference
    assert found is not None and found.interval is None


def test_values_outside_their_bounds_have_no_interval_of_the_mean_difference() -> None:
    metric = Metric("mine", "own", MetricKind.VALUE, Direction.HIGHER, lowest=0.0, highest=1.0)
    values = {"mine": {"a": [0.5] * 11 + [40.0], "b": [0.25] * 12}}
    found = compare(
        results_of({"a": outcomes([True] * 12), "b": outcomes([True] * 12)}, [metric], values), mean_intervals=True
    )
    difference = found[1].mean_difference
    assert difference is not None and difference.interval is None


def test_many_comparisons_are_corrected_together() -> None:
    results = results_of({name: outcomes([1] * 12 + [int(name == "A")] * 8) for name in "ABCD"})
    found = {(each.first, each.second): each for each in compare(results)}
    assert found["A", "B"].p_value == pytest.approx(2 / 2**8)
    # Three of the six have decided pairs; the others cannot be shown and do not count.
    assert found["A", "B"].p_corrected == pytest.approx(3 * 2 / 2**8)
    assert found["A", "B"].verdict is Verdict.FIRST_BETTER
    fewer = results_of({name: outcomes([1] * 12 + [int(name == "A")] * 6) for name in "ABCD"})
    found = {(each.first, each.second): each for each in compare(fewer)}
    assert found["A", "B"].verdict is Verdict.NOT_SHOWN
    assert any("the interval excludes 0, but the corrected test" in note for note in found["A", "B"].notes)


def test_success_and_another_metric_that_can_be_shown_have_half_of_the_error_rate_each() -> None:
    statuses = {"A": ["succeeded"] * 20, "B": ["failed"] * 6 + ["succeeded"] * 14}
    values = {"path_length": {"A": [1.0] * 20, "B": [2.0] * 20}}
    assert compare(results_of(statuses))[0].verdict is Verdict.FIRST_BETTER
    found = compare(results_of(statuses, (LENGTH,), values))[0]
    assert found.p_corrected == pytest.approx(2 * 2 / 2**6)
    assert found.verdict is Verdict.NOT_SHOWN
    tied = {"path_length": {"A": [1.0] * 20, "B": [1.0] * 20}}
    assert compare(results_of(statuses, (LENGTH,), tied))[0].verdict is Verdict.FIRST_BETTER


def test_an_experiment_with_a_stopping_rule_uses_tests_that_hold_at_any_time() -> None:
    analysis = analyse(pairs(120, 40, 16, 24, sequential=True))
    (found,) = analysis.comparisons
    assert found.test == "betting test, valid at any time"
    assert found.p_value is not None
    assert found.p_value > compare(pairs(120, 40, 16, 24))[0].p_value  # type: ignore[operator]
    assert "hold at any time" in analysis.rule
    assert found.pairs_needed is None


@pytest.mark.parametrize(
    ("results", "sentence"),
    [
        (successes([], []), "nothing to compare between A and B in success: no two episodes to compare"),
        (successes([1], []), "nothing to compare between A and B in success: no two episodes to compare"),
        (results_of({"A": ["succeeded"]}), "nothing to compare: the only method is A"),
    ],
)
def test_without_data_the_sentence_says_so(results: ExperimentResults, sentence: str) -> None:
    assert analyse(results).sentences == (sentence,)
    assert all(each.verdict is Verdict.NO_DATA for each in compare(results))


def test_values_that_are_all_missing_or_all_equal_have_a_sentence() -> None:
    missing = of_values(LENGTH, [np.nan] * 3, [np.nan] * 3)
    assert missing.sentence == (
        "nothing to compare between A and B in path length: no pair has both values; 3 pairs lack a value"
    )
    equal = of_values(LENGTH, [2.0] * 9, [2.0] * 9)
    assert equal.verdict is Verdict.NOT_SHOWN
    assert equal.sentence.startswith(
        "no difference in path length shown between A and B (0 pairs won, 0 lost, 0 points"
    )


@settings(max_examples=15)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["succeeded", "failed", "timed_out", "broken"]),
            st.sampled_from(["succeeded", "failed", "timed_out", "broken"]),
            st.sampled_from([np.nan, 0.0, 1.0, 70.0, np.inf]),
            st.sampled_from([np.nan, 0.0, 1.0, 70.0]),
        ),
        max_size=14,
    ),
    st.booleans(),
    st.booleans(),
)
def test_any_results_give_sentences_and_numbers_that_json_can_hold(
    rows: list[tuple[str, str, float, float]], sequential: bool, seed_per_pair: bool
) -> None:
    statuses = {"A": [row[0] for row in rows], "B": [row[1] for row in rows]}
    drawn = {"A": [row[2] for row in rows], "B": [row[3] for row in rows]}
    results = results_of(
        statuses, (TIME, LENGTH), {"task_time": drawn, "path_length": drawn},
        objects=("can", "box"), sequential=sequential, seed_per_pair=seed_per_pair,
    )  # fmt: skip
    analysis = analyse(results)
    json.dumps(plain_json(dataclasses.asdict(analysis)), allow_nan=False)
    assert all(each.sentence and "nan" not in each.sentence for each in (*analysis.comparisons, *analysis.summaries))
    for each in analysis.comparisons:
        shown = each.verdict in (Verdict.FIRST_BETTER, Verdict.SECOND_BETTER)
        assert not shown or (each.p_corrected is not None and each.p_corrected <= 0.05)
        assert (each.verdict is Verdict.NO_DATA) == (each.difference is None)


def test_the_same_results_give_the_same_figures() -> None:
    random = np.random.default_rng(1)
    results = results_of(
        {"A": outcomes(random.random(40) < 0.8), "B": outcomes(random.random(40) < 0.7)}, (TIME,),
        {"task_time": {"A": random.lognormal(1, 1, 40), "B": random.lognormal(1, 1, 40)}},
    )  # fmt: skip
    assert analyse(results) == analyse(results)


def test_an_episode_that_is_there_twice_and_an_unknown_factor_are_refused() -> None:
    results = successes([1, 1], [0, 1])
    results.episodes["trial"] = 7
    with pytest.raises(ValueError, match="two episodes of method A have trial=7"):
        compare(results)
    description = dataclasses.replace(results.description, compared="planner")
    with pytest.raises(ValueError, match="has no factor 'planner'; its factors are: method"):
        compare(dataclasses.replace(results, description=description))
    with pytest.raises(ValueError, match="'method' is not a factor besides the compared factor; allowed: none"):
        summarise_by_level(results, "method")
