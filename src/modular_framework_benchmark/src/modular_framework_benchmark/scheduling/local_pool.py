# SPDX-License-Identifier: BSD-3-Clause
"""Workers on this machine: processes that run one episode each at a time."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from multiprocessing.connection import wait
from pathlib import Path
from typing import Protocol

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.scheduling.earlier_tries import end_try
from modular_framework_benchmark.scheduling.episode_runner import RunnerFactory, unrun_record
from modular_framework_benchmark.scheduling.worker_process import Running, WorkerProcess

GRACE_S = 60.0
"""Time a runner has beyond the limit of its episode, before it is killed: to start, stop and write [s]."""
TRIES = 2
"""How often an episode is started whose worker dies."""


class SchedulerError(Exception):
    """A pool of workers elsewhere cannot be used; the message says why and what to do."""


class Pool(Protocol):
    """Runs episodes on workers, each of which has one or several slots."""

    def free(self) -> list[str]:
        """Returns the slots that can take an episode."""

    def submit(self, slot: str, spec: EpisodeSpec, folder: Path) -> None:
        """Has an episode run, in that slot if it can."""

    def wait(self, timeout_s: float) -> list[EpisodeRecord]:
        """Returns the records of episodes that have ended, as soon as there is one, or none after a time."""

    def close(self) -> None:
        """Ends the workers, which are idle."""

    def kill(self) -> None:
        """Ends the workers and what they run, at once; may be called twice."""


class LocalPool:
    """Worker processes on this machine; implements `Pool`.

    Args:
        make_runner: Makes the runner of each worker.
        workers: How many episodes run at the same time.
        run: Mark of the run, see `marked_processes`.
        logs: Folder of the workers' log files.
        prefix: What the names of the workers begin with.
    """

    def __init__(self, make_runner: RunnerFactory, workers: int, run: str, logs: Path, prefix: str = "worker_") -> None:
        self._make_runner, self._run, self._logs = make_runner, run, logs
        self._workers: dict[str, WorkerProcess | None] = {f"{prefix}{number + 1}": None for number in range(workers)}
        self._ready: set[str] = set()

    def free(self) -> list[str]:
        """Returns the names of the idle workers."""
        return [name for name, worker in self._workers.items() if worker is None or worker.running is None]

    def submit(self, slot: str, spec: EpisodeSpec, folder: Path) -> None:
        """Has an idle worker run an episode; starts the worker if there is none yet.

        Raises:
            WorkerStartError: The worker cannot be started.
        """
        self._begin(slot, spec, folder, tries=1)

    def _begin(self, slot: str, spec: EpisodeSpec, folder: Path, tries: int) -> None:
        if slot not in self._ready:
            self._start(slot)
        worker = self._workers[slot]
        assert worker is not None
        worker.begin(spec, folder, tries)

    def _start(self, slot: str) -> None:
        """Waits until a worker is ready; all of them are launched at once, so that they import together."""
        for name, worker in self._workers.items():
            if worker is None:
                launched = WorkerProcess(name, self._make_runner, self._run, self._logs / f"{name}.log")
                launched.launch()
                self._workers[name] = launched
        worker = self._workers[slot]
        assert worker is not None
        worker.wait_until_ready()
        self._ready.add(slot)

    def wait(self, timeout_s: float) -> list[EpisodeRecord]:
        """Returns the records of episodes that have ended. An episode whose worker died runs again, once.

        Raises:
            WorkerStartError: A worker that died cannot be started again.
        """
        busy = {worker.connection: worker for worker in self._workers.values() if worker and worker.running}
        ready = wait(list(busy), timeout_s)
        records = [self._after(worker) for connection, worker in busy.items() if connection in ready]
        records += [self._over_limit(worker) for connection, worker in busy.items() if connection not in ready]
        return [record for record in records if record is not None]

    def _after(self, worker: WorkerProcess) -> EpisodeRecord | None:
        """Returns the record of a worker that has one; starts the episode of one that has died again."""
        running = worker.running
        assert running is not None
        record = worker.finish()
        if record is not None:
            return dataclasses.replace(record, worker=record.worker or worker.name)
        cause = worker.cause_of_death()
        self._end(worker)
        end_try(running.folder, cause)
        if running.tries < TRIES:
            self._begin(worker.name, running.spec, running.folder, running.tries + 1)
            return None
        return self._unrun(running, worker, EpisodeStatus.BROKEN, f"{cause} (it was tried {running.tries} times)")

    def _over_limit(self, worker: WorkerProcess) -> EpisodeRecord | None:
        running = worker.running
        assert running is not None
        limit_s = float(running.spec.settings.get("time_limit", float("inf"))) + GRACE_S
        if time.monotonic() - running.started < limit_s:
            return None
        self._end(worker)
        cause = f"the runner did not return within {limit_s:g} s, {GRACE_S:g} s more than the time limit; it was killed"
        return self._unrun(running, worker, EpisodeStatus.TIMED_OUT, cause)

    def _unrun(self, running: Running, worker: WorkerProcess, status: EpisodeStatus, cause: str) -> EpisodeRecord:
        wall_s = time.monotonic() - running.started
        return unrun_record(running.spec, status, cause, running.begun, wall_s, worker.name)

    def _end(self, worker: WorkerProcess) -> None:
        worker.kill()
        self._workers[worker.name] = None
        self._ready.discard(worker.name)

    def close(self) -> None:
        """Ends the workers; those that are idle end what they keep running by themselves."""
        self._end_all(WorkerProcess.close)

    def kill(self) -> None:
        """Ends the workers and what they run."""
        self._end_all(WorkerProcess.kill)

    def _end_all(self, end: Callable[[WorkerProcess], None]) -> None:
        for name, worker in self._workers.items():
            if worker is not None:
                end(worker)
            self._workers[name] = None
        self._ready.clear()
