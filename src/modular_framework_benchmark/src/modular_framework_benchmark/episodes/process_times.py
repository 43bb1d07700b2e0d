# SPDX-License-Identifier: BSD-3-Clause
"""Measures the processor time of a method from outside, without relying on the method's own reports."""

from __future__ import annotations

import contextlib
import os
import time

import psutil

from modular_framework_benchmark.episodes.method_node import COMMAND


def processor_time_s(launch: int) -> float:
    """Returns the processor time that the nodes of a method have used so far [s].

    All descendants of `method_node` count, including daemons, and ended processes that were waited for. A node that
    roslaunch starts again counts from its restart.

    Args:
        launch: Process id of the launch that starts the nodes; 0.0 if the launch has ended.
    """
    used_s = 0.0
    for process in _children(launch):
        with contextlib.suppress(psutil.Error):  # the process has ended
            if COMMAND[-1] in process.cmdline():
                used_s += sum(map(_time_s, [process, *process.children(recursive=True)]))
    return used_s


def tree_time_s() -> float:
    """Returns the processor time of this process and of all its descendants so far [s].

    Ended descendants count if their parent has waited for them.
    """
    ended = os.times()
    descendants = psutil.Process().children(recursive=True)
    return time.process_time() + ended.children_user + ended.children_system + sum(map(_time_s, descendants))


def _children(launch: int) -> list[psutil.Process]:
    try:
        return psutil.Process(launch).children()
    except psutil.Error:
        return []


def _time_s(process: psutil.Process) -> float:
    """Returns the processor time of a process and of its ended children [s]; 0.0 if the process has ended."""
    try:
        times = process.cpu_times()
    except psutil.Error:
        return 0.0
    return times.user + times.system + times.children_user + times.children_system
