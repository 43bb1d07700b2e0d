# SPDX-License-Identifier: BSD-3-Clause
"""Runs a stored experiment from its current state to its end, and prints the results."""

from __future__ import annotations

import math
import shlex
import signal
import sys
from dataclasses import dataclass
from types import FrameType
from typing import TYPE_CHECKING

from modular_framework_benchmark.commands.mode_runners import runner_factory
from modular_framework_benchmark.experiments.experiment import Stopping, StoppingKind
from modular_framework_benchmark.experiments.experiment_file import read_run_settings
from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.results.connection import parse_address, shown_target
from modular_framework_benchmark.results.database import ResultDatabase
from modular_framework_benchmark.scheduling.disk_guard import GB, DiskGuard
from modular_framework_benchmark.scheduling.experiment_run import ExperimentRun, RunEnd
from modular_framework_benchmark.scheduling.local_pool import LocalPool, Pool
from modular_framework_benchmark.scheduling.progress import Progress

if TYPE_CHECKING:
    from modular_framework_benchmark.statistics.stopping import StoppingRule

EXIT_FAILED, EXIT_INTERRUPTED = 1, 130
COMMAND = "rosrun modular_framework_benchmark"


@dataclass(frozen=True, slots=True)
class SessionOptions:
    """Options of a run.

    Attributes:
        target: Database as named by the user.
        workers: Number of parallel episodes; None for the number in the experiment file.
        scheduler: Address of a Dask scheduler; None for workers on this machine.
        runner: MODULE:NAME of a user's runner; "" for the runner of the mode.
        disk_limit_gb: Maximum size of the episodes' files [GB].
    """

    target: str
    workers: int | None
    scheduler: str | None
    runner: str
    disk_limit_gb: float = math.inf


class ExperimentSession:
    """A run of the pending episodes.

    Args:
        database: Database of the experiment.
        number: Identifier of the experiment in the database.
        run: Mark of the run's processes.
        options: Options of the run.
    """

    def __init__(self, database: ResultDatabase, number: int, run: str, options: SessionOptions) -> None:
        (self._stored,) = (stored for stored in database.experiments() if stored.id == number)
        self._database, self._number, self._run_mark, self._options = database, number, run, options
        description = self._stored.description
        self._settings = read_run_settings(description.text, description.metrics)
        self._name = description.name
        self._shown = shown_target(options.target)
        path = parse_address(options.target).path
        stem = path.stem if path else self._name
        self._folder = database.folder.resolve() / f"{stem}_episodes" / self._name

    def run(self) -> int:
        """Runs the episodes and prints the results; returns the exit code."""
        make_runner = runner_factory(self._stored.description.mode, self._options.runner)
        rule = _stopping_rule(self._settings.stopping)
        disk = DiskGuard(self._folder, self._options.disk_limit_gb * GB)
        run = ExperimentRun(self._database, self._number, self._folder, rule, disk)
        progress = Progress(self._stored.planned, self._stored.finished, sys.stderr)

        def make_pool() -> Pool:
            logs = self._folder / "workers"
            if self._options.scheduler:
                from modular_framework_benchmark.scheduling.dask_pool import DaskPool  # slow to import

                return DaskPool(self._options.scheduler, make_runner, self._run_mark, logs)
            workers = min(self._options.workers or self._settings.workers, run.pending)
            return LocalPool(make_runner, workers, self._run_mark, logs)

        print(f"{self._name}: {run.pending} of {self._stored.planned} episodes to run; results in {self._shown}")
        sys.stdout.flush()
        with _InterruptHandler():
            try:
                end = run.run(make_pool, progress)
            except KeyboardInterrupt:
                return self._ended_early("", EXIT_INTERRUPTED)
        if end.disk_full:
            return self._ended_early(
                f": {end.disk_full}. '{COMMAND} prune {shlex.quote(self._shown)}' deletes files of episodes",
                EXIT_FAILED,
            )
        return self._print_results(end)

    def _ended_early(self, why: str, exit_code: int) -> int:
        resume = f"{COMMAND} resume {shlex.quote(self._shown)} --experiment {self._name}"
        if self._options.runner:
            resume += f" --runner {self._options.runner}"
        print(f"\nstopped{why}; every ended episode is stored. To continue: {resume}", file=sys.stderr)
        return exit_code

    def _print_results(self, end: RunEnd) -> int:
        """Prints the summary of the report and writes the page; returns an error if nothing was measured."""
        from modular_framework_benchmark.commands.report_command import write_page  # slow to import
        from modular_framework_benchmark.reports.report_source import OpenedExperiment
        from modular_framework_benchmark.statistics.observations import unmeasured_reason

        if end.stopped_because:
            print(f"ended before all trials: {end.stopped_because}")
        page = self._database.folder / f"{self._name}.html"
        results = self._database.load(self._number, spans=False)
        try:
            answer = write_page(OpenedExperiment(self._database, self._number, results), page)
        except ReportError as error:
            again = f"{COMMAND} report {shlex.quote(self._shown)} --experiment {self._name} --into FILE"
            print(f"error: no report: {error}; the results are stored. To write it: {again}", file=sys.stderr)
            return EXIT_FAILED
        print(answer, f"report: {page}", sep="\n")
        if reason := unmeasured_reason(results):
            print(f"error: {reason}", file=sys.stderr)
            return EXIT_FAILED
        return 0


def _stopping_rule(stopping: Stopping) -> StoppingRule | None:
    """Returns the stopping rule of an experiment, or None for a fixed number of trials."""
    match stopping.kind:
        case StoppingKind.FIXED:
            return None
        case StoppingKind.SEQUENTIAL:
            # Imported here, because the statistics are slow to import.
            from modular_framework_benchmark.statistics.stopping import AnytimeValid

            return AnytimeValid(stopping.metric, stopping.smallest_difference)


class _InterruptHandler:
    """Makes SIGTERM and SIGHUP end a run like Ctrl-C, unless they are ignored, as with nohup."""

    def __enter__(self) -> None:
        caught = [kind for kind in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(kind) is not signal.SIG_IGN]
        self._before = {kind: signal.signal(kind, _interrupt) for kind in caught}

    def __exit__(self, *_: object) -> None:
        for kind, handler in self._before.items():
            signal.signal(kind, handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
