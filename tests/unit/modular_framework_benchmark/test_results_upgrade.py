# SPDX-License-Identifier: BSD-3-Clause
"""A database of an older release is upgraded and kept as a copy; one of a newer release is refused."""

from __future__ import annotations

import logging
import os
import sqlite3
from pathlib import Path

import pytest
from sqlalchemy import Connection

from modular_framework_benchmark.records.experiment import Metric
from modular_framework_benchmark.results import schema_upgrade
from modular_framework_benchmark.results.database import open_database
from modular_framework_benchmark.results.errors import DatabaseFullError, SchemaVersionError, StorageError
from modular_framework_benchmark.results.schema import SCHEMA_VERSION
from modular_framework_ros.reported_figures import Clock, Source

VERSION_1 = Path(__file__).with_name("results_version_1.sql")


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A database as the release with version 1 wrote it: three of four episodes are finished."""
    path = tmp_path / "results.db"
    with sqlite3.connect(path) as connection:
        connection.executescript(VERSION_1.read_text())
    return path


def dump(path: Path) -> str:
    with sqlite3.connect(path) as connection:
        return "\n".join(connection.iterdump())


def version_of(path: Path) -> int:
    with sqlite3.connect(path) as connection:
        return int(connection.execute("SELECT version FROM schema_version").fetchone()[0])


@pytest.mark.parametrize("read_only", [False, True], ids=["writer", "reader"])
def test_an_older_database_is_upgraded_and_loses_nothing(old: Path, read_only: bool, caplog) -> None:  # type: ignore[no-untyped-def]
    before = dump(old)
    with caplog.at_level(logging.WARNING), open_database(old, read_only=read_only) as database:
        (stored,) = database.experiments()
        episodes = database.load(stored.id).episodes
        last = database.record(stored.id, 2)
    copy = old.with_name("results.db.version_1")
    assert version_of(old) == SCHEMA_VERSION
    assert dump(copy) == before
    assert str(copy) in caplog.text
    assert (stored.planned, stored.finished) == (4, 3)
    assert list(episodes["planning_time"]) == [0.125, 0.25, 0.375]
    assert list(episodes["success"]) == [True, True, False]
    assert (last.cause, last.snapshot["version"], len(last.spans)) == ("no motion found", "0.1.0-7-gabc", 2)


def test_metrics_of_an_older_database_say_their_clock_and_source(old: Path) -> None:
    with open_database(old) as database:
        (stored,) = database.experiments()
    metrics: dict[str, Metric] = {metric.name: metric for metric in stored.description.metrics}
    assert metrics["planning_time"].clock is Clock.WALL
    assert metrics["task_time"].clock is Clock.SIMULATED
    assert metrics["slipped"].clock is None
    assert metrics["candidates"].source is Source.SAID
    assert metrics["success"].source is Source.MEASURED


def test_the_run_of_an_older_database_goes_on(old: Path) -> None:
    with open_database(old) as database:
        (stored,) = database.experiments()
        (spec,) = database.pending(stored.id)
        done = database.record(stored.id, 0)
        assert database.write(stored.id, done.__class__(**{**_fields(done), "spec": spec}))
        assert not database.pending(stored.id)


def _fields(record: object) -> dict[str, object]:
    return {name: getattr(record, name) for name in record.__slots__}  # type: ignore[attr-defined]


def test_it_is_upgraded_once_and_an_earlier_copy_stays(old: Path) -> None:
    earlier = old.with_name("results.db.version_1")
    earlier.write_text("mine")
    for _ in range(2):
        open_database(old).close()
    assert earlier.read_text() == "mine"
    assert version_of(old.with_name("results.db.version_1.2")) == 1
    assert len(list(old.parent.glob("results.db.version_*"))) == 2


def test_an_upgrade_that_fails_leaves_the_old_tables(old: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole, before = schema_upgrade.MIGRATIONS[1], dump(old)

    def fail(connection: Connection) -> None:
        whole.apply(connection)
        raise KeyboardInterrupt

    step = schema_upgrade.Migration(whole.changed, fail)
    monkeypatch.setattr(schema_upgrade, "MIGRATIONS", {1: step})
    with pytest.raises(KeyboardInterrupt):
        open_database(old)
    assert dump(old) == before


def test_without_a_copy_there_is_no_upgrade(old: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before, connect = dump(old), sqlite3.connect

    def full(path: object, *arguments: object, **keywords: object) -> sqlite3.Connection:
        if str(path).endswith(".version_1"):
            raise sqlite3.OperationalError("disk full")
        return connect(path, *arguments, **keywords)  # type: ignore[arg-type, call-overload, no-any-return]

    monkeypatch.setattr(schema_upgrade.sqlite3, "connect", full)
    with pytest.raises(DatabaseFullError, match=r"its copy .*version_1 could not be written \(disk full\)"):
        open_database(old)
    monkeypatch.undo()
    assert dump(old) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write every file")
def test_a_reader_that_may_not_write_says_so(old: Path) -> None:
    old.chmod(0o444)
    with pytest.raises(StorageError, match="cannot be written"):
        open_database(old, read_only=True)


@pytest.mark.parametrize(
    ("version", "text"),
    [
        (0, "has tables of version 0, which no release has written; allowed: 1 to"),
        (99, "has tables of version 99, of a newer release; allowed: 1 to .*; update this software"),
    ],
)
@pytest.mark.parametrize("read_only", [False, True])
def test_a_version_that_cannot_be_read_is_refused(old: Path, version: int, text: str, read_only: bool) -> None:
    with sqlite3.connect(old) as connection:
        connection.execute("UPDATE schema_version SET version = ?", (version,))
    before = dump(old)
    with pytest.raises(SchemaVersionError, match=text):
        open_database(old, read_only=read_only)
    assert dump(old) == before
    assert not list(old.parent.glob("*.version_*"))


def test_each_version_up_to_this_one_has_a_migration() -> None:
    assert sorted(schema_upgrade.MIGRATIONS) == list(range(1, SCHEMA_VERSION))
