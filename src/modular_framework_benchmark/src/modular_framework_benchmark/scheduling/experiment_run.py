# SPDX-License-Identifier: BSD-3-Clause
"""Runs the pending episodes of a stored experiment, each exactly once."""

from __future__ import annotations

import dataclasses
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from modular_framework_benchmark.experiments.design import stack_of
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.results.database import ResultDatabase
from modular_framework_benchmark.scheduling.disk_guard import DiskGuard
from modular_framework_benchmark.scheduling.earlier_tries import forget_tries
from modular_framework_benchmark.scheduling.local_pool import Pool
from modular_framework_benchmark.scheduling.progress import Progress

if TYPE_CHECKING:  # the statistics take seconds to import
    from modular_framework_benchmark.statistics.stopping import StoppingRule

PAUSE_FACTOR = 10.0
"""Pause between interim analyses as a multiple of their duration, which bounds their cost."""


class TrialWatch:
    """Applies a stopping rule when all episodes of a trial have ended.

    Args:
        rule: Stopping rule; None to run all episodes.
        load: Function that loads the results so far.
        pending: Remaining episodes.
    """

    def __init__(
        self, rule: StoppingRule | None, load: Callable[[], ExperimentResults], pending: Iterable[EpisodeSpec]
    ) -> None:
        self._rule, self._load = rule, load
        self._remaining: dict[int, int] = {}
        for spec in pending:
            self._remaining[spec.trial] = self._remaining.get(spec.trial, 0) + 1
        self._is_due = rule is not None  # the results of an earlier run may already be sufficient
        self._next_time = 0.0

    def count_episode(self, spec: EpisodeSpec) -> None:
        """Counts an ended episode."""
        self._remaining[spec.trial] -= 1
        self._is_due = self._is_due or self._remaining[spec.trial] == 0

    def reason_to_stop(self) -> str:
        """Applies the rule if a trial has ended since the last call and the pause has passed.

        Returns:
            Reason to stop the experiment; "" to continue.
        """
        if self._rule is None or not self._is_due or time.monotonic() < self._next_time:
            return ""
        start = time.monotonic()
        decision = self._rule.decide(self._load())
        end = time.monotonic()
        self._is_due, self._next_time = False, end + PAUSE_FACTOR * (end - start)
        return decision.reason if decision.stop else ""


class EpisodeQueue:
    """Queue of the remaining episodes.

    Args:
        episodes: Episodes in the order of the run.
    """

    def __init__(self, episodes: Iterable[EpisodeSpec]) -> None:
        self._groups: list[tuple[str, deque[EpisodeSpec]]] = []
        for spec in episodes:
            stack = stack_of(spec.settings)
            if not self._groups or self._groups[-1][0] != stack:
                self._groups.append((stack, deque()))
            self._groups[-1][1].append(spec)
        self._groups.reverse()  # pop() removes the last element in constant time
        self._owned: dict[str, deque[EpisodeSpec]] = {}
        self._running: dict[str, str] = {}  # stack of each slot's latest episode

    def __len__(self) -> int:
        return sum(len(group) for _, group in self._groups) + sum(len(group) for group in self._owned.values())

    def next_for(self, slot: str, alone: bool = False) -> EpisodeSpec | None:
        """Returns the next episode for a slot, or None without an episode for it.

        A slot runs the episodes of one stack, then the episodes of the next unassigned stack. Without an unassigned
        stack, it helps the slot with most remaining episodes. It does not take the last episode of that slot if it
        would have to start another stack for this episode.

        Args:
            slot: Name of the slot.
            alone: Whether no other slot runs an episode, so that this slot takes any remaining episode.
        """
        own = self._owned.get(slot)
        if not own and self._groups:
            own = self._owned[slot] = self._groups.pop()[1]
        if not own:
            own = max(self._owned.values(), key=len, default=None)
            if not own or (len(own) == 1 and not alone and self._running.get(slot) != stack_of(own[0].settings)):
                return None
        spec = own.popleft()
        self._running[slot] = stack_of(spec.settings)
        return spec


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
        return RunEnd(progress.ended_count, reason, self._disk_full) if len(queue) else RunEnd(progress.ended_count)

    def _fill(self, pool: Pool, queue: EpisodeQueue, running: int) -> int:
        """Submits an episode to each suitable free slot while the disk has space; returns the running episodes."""
        for slot in pool.free_slots():
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
        self._disk.add_episode(folder)
        has_files = folder.is_dir() and any(folder.iterdir())
        if folder.is_dir() and not has_files:
            folder.rmdir()
        relative = str(folder.relative_to(self._database.folder)) if has_files else ""
        self._database.write(self._experiment, dataclasses.replace(record, folder=relative))
        forget_tries(folder)
        self._watch.count_episode(record.spec)

    def _results(self) -> ExperimentResults:
        return self._database.load(self._experiment, spans=False)
