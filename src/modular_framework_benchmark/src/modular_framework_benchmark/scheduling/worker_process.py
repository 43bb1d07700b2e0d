# SPDX-License-Identifier: BSD-3-Clause
"""Handle of a worker process: starts the process, submits episodes, detects its death, ends it."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
import uuid
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec
from modular_framework_benchmark.scheduling.episode_runner import RunnerFactory
from modular_framework_benchmark.scheduling.marked_processes import MARK, end_marked_processes

START_TIMEOUT_S = 120.0
"""Maximum time until a worker is ready, which includes imports on a busy machine [s]."""
CLOSE_TIMEOUT_S = 60.0


class WorkerStartError(Exception):
    """A worker cannot run episodes of this experiment; the message contains its output."""


@dataclass(frozen=True, slots=True)
class Running:
    """Running episode of a worker.

    Attributes:
        spec: Specification of the episode.
        folder: Folder of the episode's files.
        begun: Start time [s since 1970].
        started: Start time by the monotonic clock [s].
        tries: Number of attempts.
    """

    spec: EpisodeSpec
    folder: Path
    begun: float
    started: float
    tries: int


class WorkerProcess:
    """A process in its own session that runs one episode at a time.

    Args:
        name: Name in records and of the log file.
        make_runner: Factory of the runner.
        run: Mark of the run, see `marked_processes`.
        log_file: File of the worker's output.
    """

    def __init__(self, name: str, make_runner: RunnerFactory, run: str, log_file: Path) -> None:
        self.name = name
        self.running: Running | None = None
        self._make_runner, self._log_file = make_runner, log_file
        self._mark = f"{run}/{uuid.uuid4().hex}/"
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._lifeline = -1

    def launch(self) -> None:
        """Starts the process; call `wait_until_ready` before submitting episodes."""
        ours, theirs = socket.socketpair()
        watched, self._lifeline = os.pipe()
        self._log_file.parent.mkdir(parents=True, exist_ok=True)
        with self._log_file.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", f"{__package__}.worker_main", str(theirs.fileno()), str(watched)],
                env=os.environ | {MARK: self._mark},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                pass_fds=(theirs.fileno(), watched),
                start_new_session=True,
            )
        theirs.close()
        os.close(watched)
        self._connection = Connection(ours.detach())
        with contextlib.suppress(OSError):
            self._connection.send(sys.path)
            self._connection.send(self._make_runner)

    def wait_until_ready(self) -> None:
        """Waits until the worker is ready.

        Raises:
            WorkerStartError: The worker cannot run episodes.
        """
        try:
            problem = self.connection.recv() if self.connection.poll(START_TIMEOUT_S) else "it does not answer"
        except (EOFError, OSError):
            problem = f"it ended: {self._last_output()}"
        if problem is not None:
            self.kill()
            raise WorkerStartError(f"worker {self.name} cannot start: {problem.strip()}; its log is {self._log_file}")

    @property
    def connection(self) -> Connection:
        """Returns the connection, which becomes readable when the worker sends a record or ends."""
        if self._connection is None:
            raise RuntimeError("the worker was not started")
        return self._connection

    def begin(self, spec: EpisodeSpec, folder: Path, tries: int = 1) -> None:
        """Submits an episode; `finish` detects a worker that has died meanwhile.

        Args:
            spec: Specification of the episode.
            folder: Folder of the episode's files.
            tries: Number of this attempt.
        """
        self.running = Running(spec, folder, time.time(), time.monotonic(), tries)
        with contextlib.suppress(OSError):
            self.connection.send((spec, folder))

    def finish(self) -> EpisodeRecord | None:
        """Returns the record of the ended episode, or None if the worker has died."""
        try:
            record: EpisodeRecord = self.connection.recv()
        except (EOFError, OSError):
            return None
        self.running = None
        return record

    def cause_of_death(self) -> str:
        """Returns the cause of a worker's unexpected end, with its last output."""
        code: int | None = None
        if self._process is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                code = self._process.wait(5.0)
        how = "was lost" if code is None else f"ended with exit code {code}"
        if code is not None and code < 0:
            how = f"was killed by signal {signal.Signals(-code).name}"
        return f"the worker process {how}; its last output: {self._last_output()}"

    def _last_output(self) -> str:
        try:
            lines = self._log_file.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            return "nothing"
        output = [line.strip() for line in lines[-50:] if line.strip() and not line.startswith("---- ")]
        return output[-1][:500] if output else "nothing"

    def close(self) -> None:
        """Requests the end of an idle worker, and kills it after a timeout."""
        if self._connection is not None and self._process is not None and self.running is None:
            with contextlib.suppress(OSError, subprocess.TimeoutExpired):
                self._connection.send(None)
                self._process.wait(CLOSE_TIMEOUT_S)
        self.kill()

    def kill(self) -> None:
        """Kills the worker and all its descendants; repeated calls are allowed."""
        end_marked_processes(self._mark)
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        if self._connection is not None:
            self._connection.close()
            os.close(self._lifeline)
        self._process, self._connection = None, None
