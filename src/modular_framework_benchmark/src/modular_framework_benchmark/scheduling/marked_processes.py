# SPDX-License-Identifier: BSD-3-Clause
"""Finds and ends the processes that a worker has started, wherever they moved to.

A process group is not enough: roslaunch puts each node into a session of its own. So a worker has a mark in its
environment, which every process inherits that is started below it, and /proc shows it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
from pathlib import Path

from modular_framework_benchmark.episodes.snapshot import RUN_MARK as MARK

__all__ = ["MARK", "end_marked_processes", "marked_processes"]


def marked_processes(mark: str) -> list[int]:
    """Returns the identifiers of the processes whose mark begins with a text.

    Args:
        mark: RUN/ for all processes of a run, or RUN/WORKER/ for those of one worker.
    """
    wanted = f"{MARK}={mark}".encode()
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        try:
            environment = (folder / "environ").read_bytes()
        except OSError:  # it has ended, or is another user's
            continue
        if any(variable.startswith(wanted) for variable in environment.split(b"\0")):
            found.append(int(folder.name))
    return found


def end_marked_processes(mark: str, timeout_s: float = 10.0) -> int:
    """Kills the processes whose mark begins with a text, but not the calling one, until there are none.

    Args:
        mark: As for `marked_processes`.
        timeout_s: Longest time until they are gone [s].

    Returns:
        How many there were.

    Raises:
        TimeoutError: Some are still there.
    """
    killed: set[int] = set()
    end = time.monotonic() + timeout_s
    while left := [number for number in marked_processes(mark) if number != os.getpid()]:
        if time.monotonic() > end:
            raise TimeoutError(
                f"processes {left} of the run {mark} do not end within {timeout_s:g} s; end them by hand"
            )
        for number in left:
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
        killed.update(left)
        time.sleep(0.02)
    return len(killed)
