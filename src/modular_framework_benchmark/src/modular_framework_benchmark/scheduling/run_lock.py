# SPDX-License-Identifier: BSD-3-Clause
"""Lock that allows one run per database on this machine, and kills processes left by a killed run."""

from __future__ import annotations

import fcntl
import hashlib
import os
from pathlib import Path
from types import TracebackType
from typing import Self

from modular_framework_benchmark.results.connection import parse_address, shown_target
from modular_framework_benchmark.scheduling.marked_processes import end_marked_processes
from modular_framework_core.files.default_folders import framework_home


class RunLockError(Exception):
    """Another run uses the database."""


class RunLock:
    """Lock of a database during a run.

    Args:
        target: Path of the database file, or its URL.
        folder: Folder of the lock files; the framework's folder by default.
    """

    def __init__(self, target: str, folder: Path | None = None) -> None:
        self.run = hashlib.sha256(parse_address(target).identity.encode()).hexdigest()[:16]
        self._target = shown_target(target)
        self._file = (folder or framework_home() / "runs") / f"{self.run}.lock"
        self._handle = -1

    def __enter__(self) -> Self:
        """Acquires the lock and kills the processes of an earlier run that was killed.

        Raises:
            RunLockError: Another run holds the lock, or processes of an earlier run cannot be killed.
        """
        self._file.parent.mkdir(parents=True, exist_ok=True)
        self._handle = os.open(self._file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            holder = os.read(self._handle, 20).decode(errors="replace").strip()
            os.close(self._handle)
            raise RunLockError(
                f"process {holder or 'of another run'} runs episodes of {self._target} already; wait until it has "
                "ended, or end it"
            ) from error
        os.ftruncate(self._handle, 0)
        os.pwrite(self._handle, f"{os.getpid()}\n".encode(), 0)
        try:
            self.ended_processes = end_marked_processes(f"{self.run}/")
        except TimeoutError as error:
            raise RunLockError(str(error)) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        os.close(self._handle)
