# SPDX-License-Identifier: BSD-3-Clause
"""A team's PostgreSQL and Dask under faults: a server restarted, a worker killed, the network cut; each result once."""

from __future__ import annotations

import io
import os
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import distributed
import pytest
from dask_cluster import LosingRunner, running_cluster, wait_until_none
from experiment_texts import PICK, read
from postgresql_server import Network, running_server
from sqlalchemy import create_engine, text

from modular_framework_benchmark.experiments.design import digest_of, plan_episodes
from modular_framework_benchmark.records.episode import EpisodeRecord
from modular_framework_benchmark.results.database import open_database
from modular_framework_benchmark.results.errors import RecordNotStoredError
from modular_framework_benchmark.scheduling.dask_pool import DaskPool
from modular_framework_benchmark.scheduling.experiment_run import ExperimentRun
from modular_framework_benchmark.scheduling.progress import Progress

EXPERIMENT = PICK.replace("planner: [RRTConnect, PRM]", "planner: [RRTConnect]")
MOST_RUNS = 12


class FaultyProgress(Progress):
    """Causes a fault when a number of records are stored."""

    def __init__(self, total: int, faults: dict[int, Callable[[], None]]) -> None:
        super().__init__(total, 0, io.StringIO())
        self._faults = faults
        self.stored = 0

    @property
    def faults_left(self) -> int:
        """How many faults have not happened."""
        return len(self._faults)

    def add(self, record: EpisodeRecord) -> None:
        super().add(record)
        self.stored += 1
        self._faults.pop(self.stored, lambda: None)()


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[distributed.LocalCluster]:
    monkeypatch.chdir(tmp_path)  # the folders of episodes are relative to the working folder
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "ros_home"))
    with running_cluster(tmp_path, monkeypatch) as cluster:
        yield cluster


def test_nothing_is_lost_and_nothing_is_stored_twice(cluster: distributed.LocalCluster, tmp_path: Path) -> None:
    experiment = read(EXPERIMENT, tmp_path)
    episodes = plan_episodes(experiment)
    mark = f"team{os.getpid()}"
    with running_server() as server:
        network = Network(server)

        def restart() -> None:
            server.stop()
            server.start()

        def lose_requests() -> None:
            network.cuts_before_commit += 1

        def lose_answers() -> None:
            network.cuts_after_commit += 1

        faults = {2: restart, 4: network.cut, 7: lose_requests, 9: lose_answers, 12: network.cut, 14: restart}
        progress = FaultyProgress(len(episodes), faults)
        kept = runs = 0
        while runs < MOST_RUNS:
            runs += 1
            with open_database(network.url, create=True) as database:
                number = database.add_experiment(experiment.describe(digest_of(experiment, episodes), {}), episodes)
                run = ExperimentRun(database, number, tmp_path / "episodes")
                try:
                    run.run(
                        lambda: DaskPool(cluster.scheduler_address, LosingRunner, mark, tmp_path / "logs"), progress
                    )
                except RecordNotStoredError:
                    kept += 1  # the record waits in a file for the next run
                    continue
                assert database.pending(number) == []
                records = [database.record(number, spec.number) for spec in episodes]
            break
        network.close()
        engine = create_engine(server.url)
        with engine.connect() as connection:
            stored = connection.execute(text("SELECT count(*), count(DISTINCT id) FROM runs")).one()
        engine.dispose()
    assert not progress.faults_left, "every fault happened"
    assert stored == (len(episodes), len(episodes)) and all(record.succeeded for record in records)
    assert kept >= 2, "a request and an answer that are lost end a run"
    tries = Counter((tmp_path / "tries").read_text().split())
    assert tries["3"] >= 2, "the episode whose worker was killed ran again"
    assert set(Counter((tmp_path / "runs").read_text().split())) == {spec.key for spec in episodes}
    wait_until_none(f"{mark}/")
