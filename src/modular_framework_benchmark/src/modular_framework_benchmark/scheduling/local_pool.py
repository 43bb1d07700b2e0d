# SPDX-License-Identifier: BSD-3-Clause
"""Worker pool on this machine: processes that run one episode each at a time."""

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
"""Time beyond an episode's limit after which its runner is killed, for starting, stopping and writing [s]."""
MAX_TRIES = 2
"""Maximum number of attempts of an episode whose worker dies."""


class SchedulerError(Exception):
    """A remote worker pool is unusable; the message gives the reason and the remedy."""


class Pool(Protocol):
    """Runs episodes on workers with one or several slots each."""

    def free_slots(self) -> list[str]:
        """Returns the free slots."""

    def submit(self, slot: str, spec: EpisodeSpec, folder: Path) -> None:
        """Submits an episode, to the given slot if possible.

        Args:
            slot: Free slot.
            spec: Specification of the episode.
            folder: Folder of the episode's files.
        """

    def wait(self, timeout_s: float) -> list[EpisodeRecord]:
        """Returns the records of ended episodes as soon as there is one, or none after the timeout [s]."""

    def close(self) -> None:
        """Ends the idle workers."""

    def kill(self) -> None:
        """Kills the workers and their episodes; repeated calls are allowed."""


class LocalPool:
    """Worker processes on this machine; implements `Pool`.

    Args:
        make_runner: Factory of the workers' runners.
        workers: Number of episodes that run in parallel.
        run: Mark of the run, see `marked_processes`.
        logs: Folder of the workers' log files.
        prefix: Prefix of the workers' names.
    """

    def __init__(self, make_runner: RunnerFactory, workers: int, run: str, logs: Path, prefix: str = "worker_") -> None:
        self._make_runner, self._run, self._logs = make_runner, run, logs
        self._workers: dict[str, WorkerProcess | None] = {f"{prefix}{number + 1}": None for number in range(workers)}
        self._ready: set[str] = set()

    def free_slots(self) -> list[str]:
        """Returns the names of the idle workers."""
        return [name for name, worker in self._workers.items() if worker is None or worker.running is None]

    def submit(self, slot: str, spec: EpisodeSpec, folder: Path) -> None:
        """Runs an episode on an idle worker, which is started if necessary.

        Args:
            slot: Name of the worker.
            spec: Specification of the episode.
            folder: Folder of the episode's files.

        Raises:
            WorkerStartError: The worker cannot be started.
        """
        self._start_episode(slot, spec, folder, tries=1)

    def _start_episode(self, slot: str, spec: EpisodeSpec, folder: Path, tries: int) -> None:
        if slot not in self._ready:
            self._start_worker(slot)
        worker = self._workers[slot]
        assert worker is not None
        worker.begin(spec, folder, tries)

    def _start_worker(self, slot: str) -> None:
        """Waits until a worker is ready; launches all workers at once, so that they import in parallel."""
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
        """Returns the records of ended episodes. An episode whose worker died is repeated once.

        Raises:
            WorkerStartError: A worker that died cannot be restarted.
        """
        busy = {worker.connection: worker for worker in self._workers.values() if worker and worker.running}
        ready = wait(list(busy), timeout_s)
        records = [self._finish(worker) for connection, worker in busy.items() if connection in ready]
        records += [self._kill_overdue(worker) for connection, worker in busy.items() if connection not in ready]
        return [record for record in records if record is not None]

    def _finish(self, worker: WorkerProcess) -> EpisodeRecord | None:
        """Returns the record of a worker, or restarts its episode if the worker died."""
        running = worker.running
        assert running is not None
        record = worker.finish()
        if record is not None:
            return dataclasses.replace(record, worker=record.worker or worker.name)
        cause = worker.cause_of_death()
        self._end(worker)
        end_try(running.folder, cause)
        if running.tries < MAX_TRIES:
            self._start_episode(worker.name, running.spec, running.folder, running.tries + 1)
            return None
        return self._unrun_record(running, worker, EpisodeStatus.BROKEN, f"{cause} (after {running.tries} attempts)")

    def _kill_overdue(self, worker: WorkerProcess) -> EpisodeRecord | None:
        running = worker.running
        assert running is not None
        limit_s = running.spec.settings.time_limit + GRACE_S
        if time.monotonic() - running.started < limit_s:
            return None
        self._end(worker)
        cause = f"the runner exceeded {limit_s:g} s, the time limit plus {GRACE_S:g} s; it was killed"
        return self._unrun_record(running, worker, EpisodeStatus.TIMED_OUT, cause)

    def _unrun_record(
        self, running: Running, worker: WorkerProcess, status: EpisodeStatus, cause: str
    ) -> EpisodeRecord:
        wall_s = time.monotonic() - running.started
        return unrun_record(running.spec, status, cause, begun=running.begun, wall_s=wall_s, worker=worker.name)

    def _end(self, worker: WorkerProcess) -> None:
        worker.kill()
        self._workers[worker.name] = None
        self._ready.discard(worker.name)

    def close(self) -> None:
        """Ends the workers; idle workers end their own processes."""
        self._end_all(WorkerProcess.close)

    def kill(self) -> None:
        """Kills the workers and their episodes."""
        self._end_all(WorkerProcess.kill)

    def _end_all(self, end: Callable[[WorkerProcess], None]) -> None:
        for name, worker in self._workers.items():
            if worker is not None:
                end(worker)
            self._workers[name] = None
        self._ready.clear()
