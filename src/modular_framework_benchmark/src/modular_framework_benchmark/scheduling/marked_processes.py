# SPDX-License-Identifier: BSD-3-Clause
"""Finds and ends the processes that a worker has started, wherever they moved to.

A process group is not enough: roslaunch puts each node into a session of its own. So a worker has a mark in its
environment, which every process inherits that is started below it.
"""

from __future__ import annotations

from modular_framework_benchmark.episodes.snapshot import RUN_MARK as MARK
from modular_framework_core.launching.launch_session import kill_processes_with, processes_with

__all__ = ["MARK", "end_marked_processes", "marked_processes"]


def marked_processes(mark: str) -> list[int]:
    """Returns the identifiers of the other processes whose mark begins with a text.

    Args:
        mark: RUN/ for all processes of a run, or RUN/WORKER/ for those of one worker.
    """
    return processes_with(MARK, mark, prefix=True)


def end_marked_processes(mark: str, timeout_s: float = 10.0) -> int:
    """Kills the processes that `marked_processes` returns, until there are none; returns how many there were.

    Raises:
        TimeoutError: Some are still there after `timeout_s` [s].
    """
    return kill_processes_with(MARK, mark, prefix=True, timeout_s=timeout_s)
