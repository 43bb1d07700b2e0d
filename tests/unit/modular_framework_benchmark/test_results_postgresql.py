# SPDX-License-Identifier: BSD-3-Clause
"""A team's PostgreSQL server that is restarted or stopped: nothing is lost, nothing is stored twice."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from postgresql_server import Server, running_server
from sample_experiment import sample_description, sample_episodes, sample_record

from modular_framework_benchmark.results.database import open_database
from modular_framework_benchmark.results.errors import RecordNotStoredError

EPISODES = sample_episodes(3)


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Server]:
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "ros_home"))
    with running_server() as made:
        yield made


def test_a_server_that_is_restarted_or_stopped_loses_nothing_and_stores_nothing_twice(server: Server) -> None:
    with open_database(server.url, create=True) as database:
        number = database.add_experiment(sample_description(), EPISODES)
        assert database.write(number, sample_record(EPISODES[0]))
        server.stop()
        server.start()
        assert database.write(number, sample_record(EPISODES[1])), "a restart between two records is not noticed"
        server.stop()
        with pytest.raises(RecordNotStoredError, match="is saved in .*imported when the database is next opened"):
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
