# SPDX-License-Identifier: BSD-3-Clause
"""A Dask cluster of two worker processes, and a runner that kills its worker once."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import distributed
import fake_runners
import pytest

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec
from modular_framework_benchmark.scheduling.marked_processes import marked_processes


class LosingRunner(fake_runners.QuickRunner):
    """Kills the Dask worker that it belongs to in the first try of episode 3."""

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        tries = Path(os.environ["FAKE_TRIES"])
        with tries.open("a", encoding="utf-8") as stream:
            stream.write(f"{spec.number}\n")
        if spec.number == 3 and tries.read_text().split().count("3") == 1:
            os.kill(os.getppid(), signal.SIGKILL)
            time.sleep(60)  # it is ended with its worker
        return super().run(spec, folder)


@contextmanager
def running_cluster(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[distributed.LocalCluster]:
    """Starts the cluster; tries and runs of episodes are noted in the files `tries` and `runs` of a folder."""
    monkeypatch.setenv("FAKE_TRIES", str(folder / "tries"))
    monkeypatch.setenv("FAKE_RUNS", str(folder / "runs"))
    with distributed.LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, local_directory=str(folder)
    ) as cluster:
        yield cluster


def wait_until_none(mark: str) -> None:
    """Waits until no process of a run is left."""
    end = time.monotonic() + 20
    while marked_processes(mark):
        assert time.monotonic() < end, "a run leaves no process behind"
        time.sleep(0.1)
