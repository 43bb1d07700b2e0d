# SPDX-License-Identifier: BSD-3-Clause
"""A Dask cluster of real worker processes: a lost worker's episodes run again, and every result is stored once."""

from __future__ import annotations

import io
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import distributed
import fake_runners
import pytest
from dask_cluster import LosingRunner, running_cluster, wait_until_none
from experiment_texts import PICK, read

from modular_framework_benchmark.experiments.design import digest_of, plan_episodes
from modular_framework_benchmark.results.database import open_database
from modular_framework_benchmark.scheduling import dask_pool
from modular_framework_benchmark.scheduling.dask_pool import DaskPool
from modular_framework_benchmark.scheduling.earlier_tries import EARLIER_TRIES, LOST
from modular_framework_benchmark.scheduling.experiment_run import ExperimentRun, RunEnd
from modular_framework_benchmark.scheduling.local_pool import SchedulerError
from modular_framework_benchmark.scheduling.progress import Progress

SMALL = PICK.replace("trials: 6", "trials: 2").replace("planner: [RRTConnect, PRM]", "planner: [RRTConnect]")


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[distributed.LocalCluster]:
    with running_cluster(tmp_path, monkeypatch) as cluster:
        yield cluster


def test_the_episode_of_a_lost_worker_runs_again_and_each_result_is_stored_once(
    cluster: distributed.LocalCluster, tmp_path: Path
) -> None:
    experiment = read(SMALL, tmp_path)
    episodes = plan_episodes(experiment)
    mark = f"dask{os.getpid()}"
    with open_database(tmp_path / "results.db", create=True) as database:
        number = database.add_experiment(experiment.describe(digest_of(experiment, episodes), {}), episodes)
        run = ExperimentRun(database, number, tmp_path / "episodes")
        end = run.run(
            lambda: DaskPool(cluster.scheduler_address, LosingRunner, mark, tmp_path / "logs"),
            Progress(len(episodes), 0, io.StringIO()),
        )
        assert end == RunEnd(8), "as many records came as there are episodes"
        records = [database.record(number, spec.number) for spec in episodes]
        assert database.pending(number) == []
    assert all(record.succeeded for record in records)
    assert {record.worker.partition(" at ")[2].partition("://")[0] for record in records} == {"tcp"}
    tries = Counter((tmp_path / "tries").read_text().split())
    assert tries["3"] == 2, "the episode that was lost ran again"
    ended = Counter((tmp_path / "runs").read_text().split())
    assert set(ended) == {spec.key for spec in episodes}
    assert ended[episodes[3].key] == 1
    earlier = [record.snapshot.get(EARLIER_TRIES, []) for record in records]
    assert [len(texts) for texts in earlier] == [spec.number == 3 for spec in episodes]
    assert earlier[3][0].startswith("begun 2") and earlier[3][0].endswith(f": {LOST}")
    wait_until_none(f"{mark}/")


def test_an_address_without_a_scheduler_is_refused_with_what_to_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_pool, "CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(SchedulerError, match=r"answers at tcp://127.0.0.1:9 .*start one with 'dask scheduler'"):
        DaskPool("tcp://127.0.0.1:9", fake_runners.QuickRunner, "none", tmp_path)
