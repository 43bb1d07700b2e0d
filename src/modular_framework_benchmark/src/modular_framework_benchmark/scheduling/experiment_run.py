# SPDX-License-Identifier: BSD-3-Clause
"""Runs the pending episodes of an experiment of a database, each exactly once."""

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
    """How a run ended.

    Attributes:
        episodes: How many episodes it ran.
        stopped_because: Why the stopping rule ended it early; empty when it did not.
        disk_full: Why the disk ended it early; empty when it did not.
    """

    episodes: int
    stopped_because: str = ""
    disk_full: str = ""


class ExperimentRun:
    """Gives the pending episodes to a pool, and writes each record as it comes.

    Args:
        database: Where the experiment is, and the records go.
        experiment: Its identifier there.
        folder: Where the folders of the episodes are made; below the folder of the database.
        rule: When to stop; None: when all episodes have ended.
        disk: Ends the run before the disk is full; None: at the default limit.
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
        """Returns how many episodes are still to be run."""
        return len(self._pending)

    def run(self, make_pool: Callable[[], Pool], progress: Progress) -> RunEnd:
        """Runs the episodes; whatever ends it early, an exception or a signal, ends the running episodes too.

        Args:
            make_pool: Makes the workers; not called when there is nothing to do.
            progress: Shows how far it is.

        Raises:
            RecordNotStoredError: The database cannot be written; the record that was to be written is kept in a file.
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
        """Gives an episode to each free slot that can take one while the disk has room; returns how many run then."""
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
