# SPDX-License-Identifier: BSD-3-Clause
"""The database keeps every finished episode once, and is all that a resume needs."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from sample_experiment import METHODS, sample_description, sample_episodes, sample_record

from modular_framework_benchmark.experiments.planning_mode import PlanningSettings
from modular_framework_benchmark.experiments.problem_sets import Problem
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.records.episode import EpisodeStatus, Span
from modular_framework_benchmark.records.experiment import Direction, Factor, Metric, MetricKind
from modular_framework_benchmark.results.database import open_database
from modular_framework_benchmark.results.errors import (
    DescriptionError,
    ExperimentChangedError,
    RecordRefusedError,
    ResultsError,
    UnknownExperimentError,
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "results.db"


def test_a_resume_needs_nothing_but_the_database(path: Path) -> None:
    episodes = sample_episodes()
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), episodes)
        for spec in episodes[:5]:
            assert database.write(number, sample_record(spec))

    with open_database(path) as database:
        (stored,) = database.experiments()
        assert (stored.planned, stored.finished) == (12, 5)
        assert stored.description == sample_description()
        assert database.pending(database.find("picks")) == episodes[5:]


def test_a_record_is_read_as_it_was_written(path: Path) -> None:
    first, second = sample_episodes()[:2]
    good, bad = sample_record(first), sample_record(second, EpisodeStatus.TIMED_OUT, simulated_s=None)
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes())
        assert database.write(number, good)
        assert database.write(number, bad)

        assert database.record(number, 0) == good
        assert database.record(number, 1) == bad
        with pytest.raises(ResultsError, match="episode 2 of 'picks' is not finished"):
            database.record(number, 2)
        with pytest.raises(ResultsError, match="episode 99 of 'picks' does not exist"):
            database.record(number, 99)


def test_an_episode_is_stored_once_and_the_first_record_stays(path: Path) -> None:
    spec = sample_episodes()[0]
    with open_database(path, create=True) as database, open_database(path) as other:
        number = database.add_experiment(sample_description(), sample_episodes())
        assert database.write(number, sample_record(spec))
        assert not database.write(number, sample_record(spec, EpisodeStatus.FAILED))
        assert not other.write(number, sample_record(spec, EpisodeStatus.FAILED))
        assert database.record(number, 0).succeeded
        assert len(database.load(number).spans) == 2


def test_the_tables_of_results_have_typed_columns(path: Path) -> None:
    episodes = sample_episodes()
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), episodes)
        database.write(number, sample_record(episodes[7], EpisodeStatus.BROKEN, metrics={"planning_time": math.nan}))
        database.write(number, sample_record(episodes[2], snapshot={"cold_start": True}))
        results = database.load(number)

    table = results.episodes
    assert results.planned == 12
    assert list(table["number"]) == [2, 7]
    assert list(table["status"]) == ["succeeded", "broken"]
    for name in ("success", "cold_start"):
        assert list(table[name]) == [True, False]
        assert table[name].dtype == bool
    assert list(table["grasp_method"]) == ["antipodal", "antipodal"]
    assert list(table["speed"]) == ["0.50", "0.50"]
    assert table["planning_time"][0] == 0.375
    assert math.isnan(table["planning_time"][1])
    assert table["slipped"].isna().all()
    assert list(results.spans["name"]) == ["PICK/APPROACH", "planning"] * 2
    assert list(results.spans["failed"]) == [False, False, False, True]
    assert math.isnan(results.spans["ended_s"][1])


def test_an_experiment_without_a_finished_episode_gives_empty_tables_with_all_columns(path: Path) -> None:
    with open_database(path, create=True) as database:
        results = database.load(database.add_experiment(sample_description(), sample_episodes()))
    assert results.episodes.empty
    assert {"grasp_method", "planning_time", "success"} <= set(results.episodes.columns)
    assert results.spans.empty


def test_spans_can_be_left_out_read_for_some_episodes_and_added_up(path: Path) -> None:
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes())
        for spec in sample_episodes()[:4]:
            database.write(number, sample_record(spec))
        assert database.load(number, spans=False).spans.empty
        assert set(database.spans(number, [1, 3])["number"]) == {1, 3}
        sums = database.span_totals(number).set_index(["name", "grasp_method"])
    for method in METHODS:
        assert sums.loc[("PICK/APPROACH", method), "total_s"] == 2 * 3.5
        assert sums.loc[("planning", method), "count"] == 2
        assert sums.loc[("planning", method), "ended"] == 0


def test_spans_at_the_same_time_cover_their_time_once(path: Path) -> None:
    spans = [(0.0, 2.0), (1.0, 5.0), (1.5, 3.0), (7.0, 8.0), (8.0, None), (9.0, 9.5)]
    record = replace(
        sample_record(sample_episodes()[0]),
        spans=tuple(Span("component", "planning", started_s, ended_s) for started_s, ended_s in spans),
    )
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes())
        database.write(number, record)
        (row,) = database.span_totals(number).to_dict("records")
    assert (row["count"], row["ended"]) == (6, 5)
    assert row["total_s"] == pytest.approx(2.0 + 4.0 + 1.5 + 1.0 + 0.5)
    assert row["covered_s"] == pytest.approx(5.0 + 1.0 + 0.5)


def test_what_episodes_ran_with_is_kept_once_and_counted(path: Path) -> None:
    episodes = sample_episodes()
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), episodes)
        for spec in episodes[:3]:
            database.write(number, sample_record(spec))
        database.write(number, sample_record(episodes[3], snapshot={"version": "0.2.0"}))
        values = database.snapshot_values(number)
    assert values["version"] == [("0.1.0-7-gabc", 3), ("0.2.0", 1)]
    assert values["machine"] == [({"processors": 2}, 3)]


def test_the_same_experiment_resumes_and_new_words_of_its_file_are_taken_over(path: Path) -> None:
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes())
        database.write(number, sample_record(sample_episodes()[0]))
        again = sample_description(text="# another comment\n", confidence=0.9)
        assert database.add_experiment(again, sample_episodes()) == number
        assert database.load(number).description == again
        assert len(database.pending(number)) == 11


@pytest.mark.parametrize("finished", [0, 1])
def test_an_extension_after_an_episode_has_run_is_kept_as_a_look_at_the_results(path: Path, finished: int) -> None:
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes(trials=3))
        for spec in sample_episodes()[:finished]:
            database.write(number, sample_record(spec))
        database.add_experiment(sample_description(digest="d2"), sample_episodes(trials=6))
        assert database.load(number).description.extended is bool(finished)
        database.add_experiment(sample_description(digest="d2"), sample_episodes(trials=6))  # a run that resumes
    with open_database(path) as database:
        assert database.load(number).description.extended is bool(finished)


def test_a_sequential_experiment_that_becomes_a_fixed_one_has_been_looked_at(path: Path) -> None:
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(sequential=True), sample_episodes())
        database.write(number, sample_record(sample_episodes()[0]))
        database.add_experiment(sample_description(), sample_episodes())
        assert database.load(number).description.extended


def test_episodes_of_planning_say_which_problem_they_had(path: Path) -> None:
    episodes = [
        replace(spec, settings=PlanningSettings(problem=Problem(f"box/{spec.trial % 2}", "scene", "request")))
        for spec in sample_episodes(trials=4)
    ]
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(mode="planning"), episodes)
        for spec in episodes:
            database.write(number, sample_record(spec))
        table = database.load(number).episodes
    assert [table["drawn_problem"][row] == table["drawn_problem"][0] for row in (0, 4, 8)] == [True, False, True]


def test_more_repetitions_and_levels_extend_an_experiment(path: Path) -> None:
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes(2))
        for spec in sample_episodes(2):
            database.write(number, sample_record(spec))
        larger = sample_description(digest="d2")
        shuffled = [replace(spec, number=15 - spec.number) for spec in sample_episodes(4)]
        assert database.add_experiment(larger, shuffled) == number
        pending = database.pending(number)
        assert {spec.key for spec in pending} == {spec.key for spec in sample_episodes(4)[8:]}
        assert [spec.number for spec in pending] == list(range(8, 16))
        assert database.load(number).planned == 16


@pytest.mark.parametrize(
    ("description", "trials", "message"),
    [
        (sample_description(digest="d2"), 2, "in the database and no longer in the experiment"),
        (sample_description(digest="d2", time_limit_s=30.0), 3, "time_limit_s was 60.0 and is now 30.0"),
        (sample_description(digest="d2", mode="grasps"), 3, "mode was 'task'"),
        (sample_description(digest="d2"), 3, "the software of its methods differs"),
    ],
)
def test_a_changed_experiment_of_the_same_name_is_refused(path: Path, description, trials: int, message: str) -> None:
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes())
        with pytest.raises(ExperimentChangedError, match=message):
            database.add_experiment(description, sample_episodes(trials))
        assert database.load(number).description == sample_description()


def test_a_changed_seed_or_setting_is_named(path: Path) -> None:
    episodes = sample_episodes()
    with open_database(path, create=True) as database:
        database.add_experiment(sample_description(), episodes)
        other = [replace(spec, settings=replace(spec.settings, time_limit=9.0)) for spec in episodes]
        with pytest.raises(ExperimentChangedError, match=r"'time_limit' of episode .* was 300.0 and is now 9.0"):
            database.add_experiment(sample_description(digest="d2"), other)
        with pytest.raises(ExperimentChangedError, match=r"the seed of episode .* was 1000 and is now 7"):
            database.add_experiment(sample_description(digest="d2"), [replace(spec, seed=7) for spec in episodes])


def test_one_database_holds_several_experiments(path: Path) -> None:
    with open_database(path, create=True) as database:
        first = database.add_experiment(sample_description(), sample_episodes())
        metrics = (Metric("reached", "generation", MetricKind.VALUE, Direction.HIGHER),)
        factors = (Factor("grasp_method", METHODS), Factor("object", ("cup", "can")), Factor("speed", ("0.50", "fast")))
        second = database.add_experiment(
            sample_description("reaches", metrics=metrics, factors=factors), sample_episodes(1)
        )
        spec = sample_episodes()[0]
        database.write(second, sample_record(spec, metrics={"reached": 0.5}))
        assert database.load(first).episodes.empty
        assert list(database.load(second).episodes["reached"]) == [0.5]
        with pytest.raises(
            UnknownExperimentError, match="has no experiment 'pick'; allowed: picks, reaches; did you mean"
        ):
            database.find("pick")
        with pytest.raises(UnknownExperimentError, match="no experiment number 7"):
            database.load(7)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"metrics": (Metric("wall_s", "task", MetricKind.TIME, Direction.LOWER),)},
            "metric 'wall_s': the name is taken",
        ),
        ({"metrics": (Metric("a b", "task", MetricKind.TIME, Direction.LOWER),)}, "metric 'a b' is not an identifier"),
        ({"metrics": (Metric("success", "task", MetricKind.TIME, Direction.LOWER),)}, "`success` is a rate"),
        ({"compared": "planner"}, "compared factor 'planner': allowed: grasp_method, object, speed"),
        (
            {"factors": (Factor("grasp_method", METHODS), Factor("Status", ("1",)))},
            "factor 'status': the name is taken",
        ),
    ],
)
def test_names_that_cannot_be_columns_are_refused(path: Path, changes: dict[str, object], message: str) -> None:
    with open_database(path, create=True) as database:
        with pytest.raises(DescriptionError, match=message):
            database.add_experiment(sample_description(**changes), sample_episodes())
        assert database.experiments() == []


def test_a_metric_keeps_its_kind_within_a_database(path: Path) -> None:
    metrics = (Metric("planning_time", "planning", MetricKind.RATE, Direction.LOWER),)
    with open_database(path, create=True) as database:
        database.add_experiment(sample_description(), sample_episodes())
        with pytest.raises(DescriptionError, match="'planning_time' is in this database already .* a number"):
            database.add_experiment(sample_description("others", metrics=metrics), sample_episodes())


def test_episodes_that_do_not_fit_their_experiment_are_refused(path: Path) -> None:
    episodes = sample_episodes()
    with open_database(path, create=True) as database:
        for wrong, message in (
            ([], "has no episodes"),
            ([*episodes, replace(episodes[0], number=99)], "is planned twice"),
            (
                [replace(episodes[0], configuration={"object": "cup"})],
                "has levels for object; allowed: one for each of",
            ),
            (
                [replace(episodes[0], settings=TaskSettings(parameters={"/object": object()}))],
                "cannot be stored; use numbers, texts",
            ),
        ):
            with pytest.raises(DescriptionError, match=message):
                database.add_experiment(sample_description(), wrong)


def test_records_that_do_not_fit_their_experiment_are_refused(path: Path) -> None:
    spec = sample_episodes()[0]
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes())
        for record, message in (
            (sample_record(replace(spec, trial=99)), "experiment 'picks' has no episode"),
            (
                sample_record(spec, metrics={"height": 1.0}),
                "has the metrics height, .* allowed: planning_time, slipped",
            ),
            (sample_record(spec, metrics={"slipped": 0.5}), "the rate 'slipped' is 0.5; allowed: 0, 1 or none"),
            (sample_record(spec, snapshot={"log": object()}), "cannot be stored"),
        ):
            with pytest.raises(RecordRefusedError, match=message):
                database.write(number, record)
        assert database.load(number).episodes.empty
