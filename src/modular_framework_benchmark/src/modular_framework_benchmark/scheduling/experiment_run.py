# SPDX-License-Identifier: BSD-3-Clause
"""Runs the pending episodes of a stored experiment, each exactly once."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.results.database import ResultDatabase
from modular_framework_benchmark.scheduling.disk_guard import DiskGuard
from modular_framework_benchmark.scheduling.earlier_tries import forget_tries
from modular_framework_benchmark.scheduling.episode_queue import EpisodeQueue
from modular_framework_benchmark.scheduling.local_pool import Pool
from modular_framework_benchmark.scheduling.progress import Progress
from modular_framework_benchmark.scheduling.stopping import TrialWatch

if TYPE_CHECKING:
    from modular_framework_benchmark.statistics.stopping import StoppingRule

POLL_S = 0.5


@dataclass(frozen=True, slots=True)
class RunEnd:
    """Result of a run.

    Attributes:
        episodes: Number of episodes that ran.
        stopped_because: Reason of the stopping rule for an early end; "" for none.
        disk_full: Reason of the disk guard for an early end; "" for none.
    """

    episodes: int
    stopped_because: str = ""
    disk_full: str = ""


class ExperimentRun:
    """Distributes the pending episodes to a pool and writes each record when it arrives.

    Args:
        database: Database of the experiment and its records.
        experiment: Identifier of the experiment in the database.
        folder: Parent folder of the episodes' folders, below the folder of the database.
        rule: Stopping rule; None to run all episodes.
        disk: Disk guard; None for the default limit.
    """

    def __init__(
        self,
        database: ResultDatabase,
        experiment: int,
        folder: Path,
        rule: StoppingRule | None = None,
        disk: DiskGuard | None = None,
    ) -> None:
        self._database, self._experiment, self._folder = database, experiment, folder
        self._disk, self._disk_full = disk or DiskGuard(folder), ""
        self._pending = database.pending(experiment)
        self._watch = TrialWatch(rule, self._results, self._pending)

    @property
    def pending(self) -> int:
        """Returns the number of remaining episodes."""
        return len(self._pending)

    def run(self, make_pool: Callable[[], Pool], progress: Progress) -> RunEnd:
        """Runs the episodes; an early end through an exception or a signal also ends the running episodes.

        Args:
            make_pool: Factory of the workers, not called without pending episodes.
            progress: Display of the progress.

        Raises:
            RecordNotStoredError: The database is not writable; the record is saved in a file.
            WorkerStartError: A worker cannot be started.
        """
        if not self._pending:
            return RunEnd(0)
        reason = self._watch.reason_to_stop()
        pool = make_pool()
        try:
            queue, running = EpisodeQueue(self._pending), 0
            while True:
                if not reason:
                    running = self._fill(pool, queue, running)
                if not running:
                    break
                for record in pool.wait(POLL_S):
                    running -= 1
                    self._store(record)
                    progress.add(record)
                progress.show()
                reason = reason or self._watch.reason_to_stop()
            progress.end()
            pool.close()
        finally:
            pool.kill()
        return RunEnd(progress.ended, reason, self._disk_full) if len(queue) else RunEnd(progress.ended)

    def _fill(self, pool: Pool, queue: EpisodeQueue, running: int) -> int:
        """Submits an episode to each suitable free slot while the disk has space; returns the running episodes."""
        for slot in pool.free():
            self._disk_full = self._disk_full or self._disk.reason_to_stop(running)
            if self._disk_full:
                break
            spec = queue.next_for(slot, alone=not running)
            if spec is not None:
                pool.submit(slot, spec, self._folder_of(spec))
                running += 1
        return running

    def _folder_of(self, spec: EpisodeSpec) -> Path:
        return self._folder / f"{spec.number:06}"

    def _store(self, record: EpisodeRecord) -> None:
        folder = self._folder_of(record.spec)
        self._disk.ended(folder)
        has_files = folder.is_dir() and any(folder.iterdir())
        if folder.is_dir() and not has_files:
            folder.rmdir()
        relative = str(folder.relative_to(self._database.folder)) if has_files else ""
        self._database.write(self._experiment, dataclasses.replace(record, folder=relative))
        forget_tries(folder)
        self._watch.ended(record.spec)

    def _results(self) -> ExperimentResults:
        return self._database.load(self._experiment, spans=False)
