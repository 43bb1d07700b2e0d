# SPDX-License-Identifier: BSD-3-Clause
"""A result database is what OMPL's Planner Arena reads: its tables, its joins, its attributes and its filters.

The schema is that of the benchmark logs of OMPL; what is read here is what the page of Planner Arena selects.
"""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import pytest
from sample_experiment import METHODS, sample_description, sample_episodes, sample_record

from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.records.experiment import Factor
from modular_framework_benchmark.results.database import open_database

EXPERIMENT_COLUMNS = [
    *("id", "name", "totaltime", "timelimit", "memorylimit", "runcount"),
    *("version", "hostname", "cpuinfo", "date", "seed", "setup"),
]


@pytest.fixture
def arena(tmp_path: Path) -> sqlite3.Connection:
    path = tmp_path / "results.db"
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes())
        for spec in sample_episodes():
            status = EpisodeStatus.FAILED if spec.number == 5 else EpisodeStatus.SUCCEEDED
            database.write(number, sample_record(spec, status))
    connection = sqlite3.connect(path)
    connection.row_factory = sqlite3.Row
    return connection


def columns(connection: sqlite3.Connection, table: str) -> dict[str, str]:
    """Names and declared types, in their order."""
    return {row["name"]: row["type"] for row in connection.execute(f"PRAGMA table_info({table})")}


def test_the_tables_and_their_first_columns_are_those_of_planner_arena(arena: sqlite3.Connection) -> None:
    assert list(columns(arena, "experiments"))[:12] == EXPERIMENT_COLUMNS
    assert list(columns(arena, "plannerConfigs")) == ["id", "name", "settings"]
    assert list(columns(arena, "enums")) == ["name", "value", "description"]
    assert list(columns(arena, "runs"))[:3] == ["id", "experimentid", "plannerid"]
    assert list(columns(arena, "progress"))[:2] == ["runid", "time"]


def test_metrics_are_typed_attributes_from_the_fourth_column_on(arena: sqlite3.Connection) -> None:
    attributes = dict(list(columns(arena, "runs").items())[3:])
    assert attributes == {
        "status": "INTEGER",
        "success": "BOOLEAN",
        "wall_s": "REAL",
        "simulated_s": "REAL",
        "planning_time": "REAL",
        "slipped": "BOOLEAN",
    }


def test_the_other_factors_are_parameters_from_the_thirteenth_column_on(arena: sqlite3.Connection) -> None:
    assert dict(list(columns(arena, "experiments").items())[12:]) == {"object": "VARCHAR(512)", "speed": "REAL"}
    rows = arena.execute("SELECT name, object, speed, runcount FROM experiments ORDER BY object").fetchall()
    assert [tuple(row) for row in rows] == [("picks", "can", 0.5, 3), ("picks", "cup", 0.5, 3)]


def test_every_run_joins_its_planner_and_its_problem(arena: sqlite3.Connection) -> None:
    rows = arena.execute(
        "SELECT p.name AS planner, e.object AS object, e.version, r.planning_time, r.success FROM runs r "
        "JOIN plannerConfigs p ON r.plannerid = p.id JOIN experiments e ON r.experimentid = e.id"
    ).fetchall()
    assert len(rows) == 12
    for method in METHODS:
        for thing in ("cup", "can"):
            times = [row["planning_time"] for row in rows if (row["planner"], row["object"]) == (method, thing)]
            expected = [
                0.125 * (spec.number + 1)
                for spec in sample_episodes()
                if (spec.configuration["grasp_method"], spec.configuration["object"]) == (method, thing)
            ]
            assert sorted(times) == sorted(expected)
    assert {row["version"] for row in rows} == {"0.1.0-7-gabc"}
    assert sum(row["success"] for row in rows) == 11


def test_the_status_is_an_enumeration(arena: sqlite3.Connection) -> None:
    rows = arena.execute(
        "SELECT e.description, count(*) FROM runs r JOIN enums e ON e.value = r.status AND e.name = 'status' "
        "GROUP BY e.description"
    )
    assert {tuple(row) for row in rows} == {("succeeded", 11), ("failed", 1)}


def test_the_table_of_experiments_tells_time_limits_and_times_spent(arena: sqlite3.Connection) -> None:
    for row in arena.execute("SELECT * FROM experiments"):
        assert row["timelimit"] == 60.0
        assert row["totaltime"] == pytest.approx(6 * 12.5)
        assert row["setup"].startswith("# compares two grasp methods")
        assert row["hostname"]
        assert row["cpuinfo"]


def test_the_settings_of_a_planner_are_those_all_its_episodes_share(arena: sqlite3.Connection) -> None:
    settings = dict(arena.execute("SELECT name, settings FROM plannerConfigs").fetchall())
    shared = json.loads(settings["antipodal"])
    assert shared["arguments"] == {"grasp_method": "antipodal"} and shared["parameters"] == {"/speed": 0.5}
    assert "objects" not in shared


def test_an_experiment_has_a_version_before_its_first_episode(tmp_path: Path) -> None:
    with open_database(tmp_path / "results.db", create=True) as database:
        database.add_experiment(sample_description(), sample_episodes())
    with sqlite3.connect(tmp_path / "results.db") as connection:
        assert connection.execute("SELECT DISTINCT version FROM experiments").fetchall() == [("0.0.0",)]


def test_factors_whose_names_are_taken_get_other_columns(tmp_path: Path) -> None:
    factors = (Factor("grasp_method", METHODS), Factor("version", ("1", "2")), Factor("date", ("new", "2")))
    specs = [
        spec.__class__(
            spec.number, {"grasp_method": "antipodal", "version": "2", "date": "new"}, spec.trial, 1, spec.settings
        )
        for spec in sample_episodes(1)[:1]
    ]
    with open_database(tmp_path / "results.db", create=True) as database:
        number = database.add_experiment(sample_description(factors=factors), specs)
        database.write(number, sample_record(specs[0]))
        assert list(database.load(number).episodes["version"]) == ["2"]
    with sqlite3.connect(tmp_path / "results.db") as connection:
        rows = connection.execute("SELECT version, version_level, date_level FROM experiments").fetchall()
    assert rows == [("0.1.0-7-gabc", 2.0, "new")]
