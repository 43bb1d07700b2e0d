# SPDX-License-Identifier: BSD-3-Clause
"""A team's PostgreSQL server that is restarted or stopped: nothing is lost, nothing is stored twice."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from sample_experiment import sample_description, sample_episodes, sample_record

from modular_framework_benchmark.results.database import open_database
from modular_framework_benchmark.results.errors import RecordNotStoredError

pytest.importorskip("psycopg", reason="PostgreSQL's driver is not installed: pip install 'psycopg[binary]'")
PROGRAMS = next(iter(sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)), Path("/nonexistent"))
pytestmark = pytest.mark.skipif(
    not (PROGRAMS / "initdb").is_file() or os.geteuid() != 0,
    reason="no PostgreSQL server, or no root to become its user",
)
EPISODES = sample_episodes(3)


class Server:
    """A server of its own folder, on a socket there alone."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.url = f"postgresql+psycopg://postgres@/postgres?host={folder}"
        self._run("initdb", "-D", f"{folder}/data", "-A", "trust", "--no-sync")

    def _run(self, program: str, *arguments: str) -> None:
        command = ["runuser", "-u", "postgres", "--", str(PROGRAMS / program), *arguments]
        subprocess.run(command, check=True, capture_output=True, timeout=300, cwd=self.folder)

    def start(self) -> None:
        options = f"-c listen_addresses= -c unix_socket_directories={self.folder} -c fsync=off"
        self._run("pg_ctl", "-D", f"{self.folder}/data", "-w", "-l", f"{self.folder}/log", "-o", options, "start")

    def stop(self, mode: str = "immediate") -> None:
        self._run("pg_ctl", "-D", f"{self.folder}/data", "-w", "-m", mode, "stop")


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    folder = Path(tempfile.mkdtemp())
    shutil.chown(folder, "postgres")
    monkeypatch.setenv("ROS_HOME", str(folder / "ros_home"))
    made = Server(folder)
    made.start()
    try:
        yield made
    finally:
        with contextlib.suppress(subprocess.CalledProcessError):  # it is stopped already
            made.stop()
        shutil.rmtree(folder)


def test_a_server_that_is_restarted_or_stopped_loses_nothing_and_stores_nothing_twice(server: Server) -> None:
    with open_database(server.url, create=True) as database:
        number = database.add_experiment(sample_description(), EPISODES)
        assert database.write(number, sample_record(EPISODES[0]))
        server.stop()
        server.start()
        assert database.write(number, sample_record(EPISODES[1])), "a restart between two records is not noticed"
        server.stop()
        with pytest.raises(RecordNotStoredError, match="is kept in .*taken in when the database is next opened"):
            database.write(number, sample_record(EPISODES[2]))
        server.start()
    for _ in range(2):
        with open_database(server.url) as database:
            assert database.pending(number) == EPISODES[3:]
            assert not database.write(number, sample_record(EPISODES[2])), "it has its record already"
            assert len(database.load(number).episodes) == 3


def test_tables_of_an_older_release_are_upgraded_and_kept(server: Server) -> None:
    from sqlalchemy import create_engine, text

    with open_database(server.url, create=True) as database:
        database.add_experiment(sample_description(), EPISODES)
    engine = create_engine(server.url)
    with engine.begin() as connection:
        connection.execute(text("UPDATE schema_version SET version = 1"))
        connection.execute(text("DELETE FROM enums WHERE value = 4"))
    with open_database(server.url, read_only=True) as database:
        assert database.experiments()[0].planned == len(EPISODES)
    with engine.connect() as connection:
        assert connection.execute(text("SELECT version FROM schema_version")).scalar_one() == 2
        assert connection.execute(text("SELECT count(*) FROM descriptions_version_1")).scalar_one() == 1
    engine.dispose()
