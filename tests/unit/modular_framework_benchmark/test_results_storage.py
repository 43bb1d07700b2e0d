# SPDX-License-Identifier: BSD-3-Clause
"""A disk that is full, read-only, locked or damaged gives a clear error and loses no finished episode."""

from __future__ import annotations

import json
import multiprocessing
import os
import resource
import shutil
import signal
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from sample_experiment import sample_description, sample_episodes, sample_record
from sqlalchemy import create_engine, text
from sqlalchemy.exc import DBAPIError

from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.results.connection import shown_target
from modular_framework_benchmark.results.database import ResultDatabase, open_database
from modular_framework_benchmark.results.errors import (
    DatabaseCorruptError,
    DatabaseFullError,
    DatabaseLockedError,
    DatabaseMissingError,
    DatabaseReadOnlyError,
    RecordNotStoredError,
    ResultsError,
    SchemaVersionError,
    StorageError,
    storage_error,
)
from modular_framework_benchmark.results.json_records import record_to_json

FORK = multiprocessing.get_context("fork")
NOBODY = 65534
EPISODES = sample_episodes()


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder that another user may enter too, unlike those of pytest."""
    path = Path(tempfile.mkdtemp())
    path.chmod(0o777)
    yield path
    path.chmod(0o777)
    shutil.rmtree(path)


@pytest.fixture
def filled(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A database with an experiment that has one finished episode."""
    monkeypatch.setenv("ROS_HOME", str(folder / "ros_home"))
    with open_database(folder / "results.db", create=True) as database:
        database.write(database.add_experiment(sample_description(), EPISODES), sample_record(EPISODES[0]))
    return folder / "results.db"


def in_child(action: Callable[[], str]) -> str:
    """Runs an action in a child process, whose limits and rights it may change; returns its text."""
    receiver, sender = FORK.Pipe(duplex=False)

    def run() -> None:
        try:
            sender.send(action())
        except BaseException as error:
            sender.send(f"failed: {error!r}")

    child = FORK.Process(target=run)
    child.start()
    assert receiver.poll(30.0)
    answer = receiver.recv()
    child.join(10.0)
    return answer


def write_and_tell(database: ResultDatabase, spec: EpisodeSpec, **changes: object) -> str:
    try:
        database.write(1, sample_record(spec, **changes))
    except RecordNotStoredError as error:
        return f"{type(error.__cause__).__name__} {error.saved_to} {error}"
    return "stored"


def finished(path: Path, episodes: Sequence[EpisodeSpec] = EPISODES) -> frozenset[str]:
    with open_database(path) as database:
        return frozenset({spec.key for spec in episodes} - {spec.key for spec in database.pending(1)})


def test_a_full_disk_loses_no_episode(filled: Path) -> None:
    def fill() -> str:
        database = open_database(filled)
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (filled.stat().st_size, resource.RLIM_INFINITY))
        for spec in EPISODES[1:]:
            if (answer := write_and_tell(database, spec, cause="x" * 9000)) != "stored":
                return f"{answer} KEY {spec.key}"
        return "never full"

    answer, _, key = in_child(fill).partition(" KEY ")
    assert answer.startswith(f"DatabaseFullError {filled}.unwritten/")
    assert f"{filled}: reading or writing failed; check for a full disk" in answer
    assert "imported when the database is next opened" in answer
    with sqlite3.connect(filled) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        assert connection.execute(
            "SELECT count(*) FROM runs JOIN episodes USING (id) WHERE key = ?", (key,)
        ).fetchone() == (0,)
    assert key in finished(filled)
    assert list(filled.with_name("results.db.unwritten").iterdir()) == []


def test_a_full_disk_is_told_as_such(tmp_path: Path) -> None:
    with create_engine(f"sqlite:///{tmp_path / 'small.db'}").connect() as connection:
        connection.execute(text("CREATE TABLE numbers (value TEXT)"))
        connection.execute(text("PRAGMA max_page_count = 2"))
        with pytest.raises(DBAPIError) as caught:
            connection.execute(text("INSERT INTO numbers VALUES (zeroblob(100000))"))
    error = storage_error(caught.value, "small.db")
    assert isinstance(error, DatabaseFullError)
    assert str(error).startswith("small.db: the disk is full; free space, then resume")


def test_a_file_system_that_turns_read_only_loses_no_episode(filled: Path) -> None:
    def turn_read_only() -> str:
        if os.geteuid() == 0:  # root may write what is read-only
            os.chown(filled.parent, NOBODY, NOBODY)
            os.chown(filled, NOBODY, NOBODY)
            os.setuid(NOBODY)
        database = open_database(filled)
        (filled.parent / "ros_home").mkdir()
        filled.chmod(0o444)
        filled.parent.chmod(0o555)
        return write_and_tell(database, EPISODES[1])

    answer = in_child(turn_read_only)
    assert answer.startswith(f"DatabaseReadOnlyError {filled.parent}/ros_home/modular_framework_benchmark/unwritten/")
    assert f"{filled}: it cannot be written; give write permission to the file and its folder" in answer
    filled.parent.chmod(0o777)
    filled.chmod(0o666)
    for path in (filled.parent / "ros_home").rglob("*"):
        os.chown(path, os.geteuid(), -1)  # the same user takes in what waits
    assert EPISODES[1].key in finished(filled)


def test_a_read_only_database_is_refused_for_writing_and_read_for_reports(filled: Path) -> None:
    filled.chmod(0o444)
    filled.parent.chmod(0o555)

    def use() -> str:
        if os.geteuid() == 0:
            os.setuid(NOBODY)
        with open_database(filled, read_only=True) as database:
            count = len(database.load(1).episodes)
        try:
            open_database(filled)
        except DatabaseReadOnlyError as error:
            return f"{count} {error}"
        return "opened"

    assert in_child(use).startswith(f"1 {filled}: it cannot be written; give write permission")


def test_a_reader_writes_nothing(filled: Path) -> None:
    with (
        open_database(filled, read_only=True) as database,
        pytest.raises(RecordNotStoredError, match="cannot be written"),
    ):
        database.write(1, sample_record(EPISODES[1]))
    assert EPISODES[1].key in finished(filled)  # it waited beside the database


@pytest.mark.parametrize("umask", [0o022, 0o002, 0o000])
def test_a_locked_database_loses_no_episode(
    filled: Path, umask: int, request: pytest.FixtureRequest, caplog: pytest.LogCaptureFixture
) -> None:
    request.addfinalizer(partial(os.umask, os.umask(umask)))
    with open_database(filled, busy_timeout_s=0.05) as database:
        holder = sqlite3.connect(filled, isolation_level=None)
        holder.execute("BEGIN EXCLUSIVE")
        with pytest.raises(RecordNotStoredError, match="another process holds its lock; end that process") as caught:
            database.write(1, sample_record(EPISODES[1]))
        assert isinstance(caught.value.__cause__, DatabaseLockedError)
        with pytest.raises(DatabaseLockedError, match="results.db"):
            database.load(1)
        holder.close()
    assert finished(filled) == {EPISODES[0].key, EPISODES[1].key}, caplog.text


def test_a_waiting_record_that_cannot_be_used_stays_with_a_warning(
    filled: Path, caplog: pytest.LogCaptureFixture
) -> None:
    waiting = filled.with_name("results.db.unwritten")
    waiting.mkdir()
    (waiting / "torn.json").write_text('{"database": ')
    with open_database(filled, busy_timeout_s=0.05) as database:
        holder = sqlite3.connect(filled, isolation_level=None)
        holder.execute("BEGIN EXCLUSIVE")
        with pytest.raises(RecordNotStoredError) as caught:
            database.write(1, sample_record(EPISODES[1]))
        holder.close()
    saved = caught.value.saved_to
    assert saved is not None
    content = json.loads(saved.read_text())
    content["record"]["spec"]["trial"] = 99
    saved.write_text(json.dumps(content))
    assert finished(filled) == {EPISODES[0].key}
    assert "torn.json: not a record of an episode" in caplog.text
    assert "experiment 'picks' has no episode" in caplog.text
    assert {path.name for path in waiting.iterdir()} == {"torn.json", saved.name}


by_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can make files of another user")


@pytest.mark.parametrize(
    "planted",
    [
        pytest.param("folder of another", marks=by_root),
        pytest.param("file of another", marks=by_root),
        "folder that anybody may fill",
        "file that a group may write",
        "link",
    ],
)
def test_planted_records_are_not_taken_in(filled: Path, planted: str, caplog: pytest.LogCaptureFixture) -> None:
    waiting = filled.with_name("results.db.unwritten")
    waiting.mkdir(mode=0o700)
    record = json.loads(record_to_json(sample_record(EPISODES[1])))
    file = waiting / "1.json"
    file.write_text(json.dumps({"database": str(filled), "experiment": 1, "record": record}))
    file.chmod(0o600)
    match planted:
        case "folder of another":
            os.chown(waiting, NOBODY, NOBODY)
        case "folder that anybody may fill":
            waiting.chmod(0o777)
        case "file that a group may write":
            file.chmod(0o660)
        case "file of another":
            os.chown(file, NOBODY, NOBODY)
        case _:
            waiting.rename(waiting.with_name("elsewhere"))
            waiting.symlink_to(waiting.with_name("elsewhere"))
    assert finished(filled) == {EPISODES[0].key}
    refused = file if planted.startswith("file") else waiting
    mode = 600 if refused is file else 700
    assert "other users may write it" in caplog.text
    assert f"remove it, or make it your own (chmod {mode})" in caplog.text and str(refused) in caplog.text
    if planted == "folder that anybody may fill":
        waiting.chmod(0o700)
        assert finished(filled) == {EPISODES[0].key, EPISODES[1].key}


def test_a_waiting_folder_that_cannot_be_entered_does_not_end_the_opening(filled: Path) -> None:
    waiting = filled.with_name("results.db.unwritten")
    waiting.mkdir(mode=0o000)

    def open_with_it() -> str:
        if os.geteuid() == 0:  # root may enter every folder
            for path in (filled, filled.parent, waiting):
                os.chown(path, NOBODY, NOBODY)
            os.setuid(NOBODY)
        return ",".join(finished(filled))

    answer = in_child(open_with_it)
    waiting.chmod(0o700)  # for the end of the fixture
    assert answer == EPISODES[0].key


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(DatabaseMissingError, match="there is no such file; name a result database, or run"):
        open_database(tmp_path / "results.db")
    with pytest.raises(DatabaseMissingError, match=f"there is no folder {tmp_path}/none; make it"):
        open_database(tmp_path / "none" / "results.db", create=True)
    with pytest.raises(ResultsError, match="a database in memory is lost"):
        open_database("sqlite://")
    with pytest.raises(ResultsError, match="not a URL of a database"):
        open_database("://x")
    with pytest.raises(ResultsError, match="install the driver that the URL names"):
        open_database("nosuchserver://me@host/results")


def test_a_driver_that_is_missing_is_named_as_pip_calls_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(ResultsError, match=r"install\.sh exec pip install 'psycopg\[binary\]'") as caught:
        open_database("postgresql+psycopg://me:secret@host/results")
    assert "secret" not in str(caught.value)


def test_a_password_of_a_url_is_not_shown() -> None:
    assert shown_target("postgresql+psycopg://me:secret@host/results") == "postgresql+psycopg://me:***@host/results"
    assert shown_target("picks.db") == "picks.db"


def test_a_url_of_a_sqlite_file_is_that_file(tmp_path: Path) -> None:
    with open_database(f"sqlite:///{tmp_path}/a b.db", create=True) as database:
        assert database.folder == tmp_path
    assert (tmp_path / "a b.db").is_file()


def test_a_damaged_file_is_told(filled: Path) -> None:
    content = bytearray(filled.read_bytes())
    content[4096 * 2 : 4096 * 6] = os.urandom(4096 * 4)
    filled.write_bytes(content)
    with pytest.raises(DatabaseCorruptError, match=r"results.db: it is damaged .*restore a copy"):
        open_database(filled)


def test_a_file_that_is_no_database_is_told(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("no database at all, but long enough to be taken for one" * 10)
    with pytest.raises(DatabaseCorruptError, match="notes.txt: it is not a SQLite file"):
        open_database(path)


def test_the_database_of_another_program_is_told(tmp_path: Path) -> None:
    path = tmp_path / "other.db"
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE experiments (id INTEGER)")
    with pytest.raises(
        SchemaVersionError, match="is not a result database: its tables are experiments; name another file"
    ):
        open_database(path, create=True)


def test_a_server_that_does_not_answer_keeps_the_password_to_itself(tmp_path: Path) -> None:
    error = storage_error(DBAPIError("select 1", {}, OSError("connection refused")), "postgresql://me:***@host/results")
    assert type(error) is StorageError
    assert "connection refused" in str(error)


def test_kill_9_at_random_moments_neither_loses_nor_doubles_an_episode(tmp_path: Path) -> None:
    path, episodes = tmp_path / "results.db", sample_episodes(125)
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), episodes)

    def run(sender: Any) -> None:
        with open_database(path) as database:
            for spec in database.pending(number):
                sender.send((spec.key, database.write(number, sample_record(spec))))
        sender.send(None)

    told: list[str] = []
    for moment in range(20):
        receiver, sender = FORK.Pipe(duplex=False)
        child = FORK.Process(target=run, args=(sender,))
        child.start()
        sender.close()
        assert receiver.poll(30.0)  # the first episode is written
        child.join((moment * 7919 % 20) * 0.002)  # moments spread over 40 ms, several writes
        child.kill()
        child.join()
        told += drain(receiver)
        with sqlite3.connect(path) as connection:  # undoes the write that was cut
            assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            done = connection.execute("SELECT count(*), count(DISTINCT runid) FROM records").fetchone()
        assert done[0] == done[1]
        assert set(told) <= finished(path, episodes)
        assert len(told) == len(set(told))
    assert 20 <= len(told) < len(episodes)

    with open_database(path) as database:
        for spec in database.pending(number):
            assert database.write(number, sample_record(spec))
        results = database.load(number)
    assert list(results.episodes["number"]) == list(range(500))
    assert len(results.spans) == 1000


def drain(receiver: Any) -> list[str]:
    keys = []
    try:
        while (answer := receiver.recv()) is not None:
            key, stored = answer
            assert stored
            keys.append(key)
    except EOFError:
        pass
    return keys


def test_of_several_processes_one_stores_each_episode(tmp_path: Path) -> None:
    path, episodes = tmp_path / "results.db", sample_episodes(10)
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), episodes)

    receivers = []
    for _ in range(3):
        receiver, sender = FORK.Pipe(duplex=False)
        child = FORK.Process(target=lambda out: out.send(sum(_write_all(path, number))), args=(sender,))
        child.start()
        receivers.append((child, receiver))
    stored = [receiver.recv() for _, receiver in receivers]
    for child, _ in receivers:
        child.join()
    assert sum(stored) == len(episodes)
    with open_database(path) as database:
        assert database.pending(number) == []


def _write_all(path: Path, number: int) -> list[bool]:
    with open_database(path) as database:
        return [database.write(number, sample_record(spec)) for spec in sample_episodes(10)]
