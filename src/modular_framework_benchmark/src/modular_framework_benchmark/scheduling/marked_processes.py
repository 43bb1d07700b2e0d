# SPDX-License-Identifier: BSD-3-Clause
"""Finds and kills all processes that a worker started, regardless of their process groups.

Process groups are not sufficient, because roslaunch starts each node in a new session. A worker therefore has a mark in
its environment, which all its descendants inherit.
"""

from __future__ import annotations

from modular_framework_benchmark.episodes.snapshot import RUN_ID_VARIABLE as MARK
from modular_framework_core.launching.launch_session import kill_processes_with, processes_with

__all__ = ["MARK", "end_marked_processes", "marked_processes"]


def marked_processes(mark: str) -> list[int]:
    """Returns the ids of other processes whose mark starts with a text.

    Args:
        mark: RUN/ for all processes of a run, or RUN/WORKER/ for the processes of a worker.
    """
    return processes_with(MARK, mark, prefix=True)


def end_marked_processes(mark: str, timeout_s: float = 10.0) -> int:
    """Kills the processes of `marked_processes` until none remains; returns their number.

    Args:
        mark: See `marked_processes`.
        timeout_s: Maximum duration [s].

    Raises:
        TimeoutError: Processes remain after the timeout.
    """
    return kill_processes_with(MARK, mark, prefix=True, timeout_s=timeout_s)
