# SPDX-License-Identifier: BSD-3-Clause
"""Measures the processor time of a method from outside, without relying on the method's own reports."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable

import psutil

from modular_framework_benchmark.episodes.method_node import COMMAND

MAX_READINGS = 10
"""Limit of the repeated readings, for methods that start and end processes all the time."""


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
                used_s += _tree_time_s(process, _time_s)
    return used_s


def tree_time_s() -> float:
    """Returns the processor time of this process and of all its descendants so far [s].

    Ended descendants count if their parent has waited for them.
    """
    return _tree_time_s(psutil.Process(), _own_time_s)


def _tree_time_s(process: psutil.Process, root_time_s: Callable[[psutil.Process], float]) -> float:
    """Returns the processor time of a process and its descendants [s].

    A process that ends between the readings would be counted neither as running nor as an ended child of its parent,
    so the sum is repeated until the same processes exist before and after it.

    Args:
        process: Root of the tree.
        root_time_s: Function that returns the time of the root and of its ended children [s].
    """
    descendants, total_s = process.children(recursive=True), 0.0
    for _ in range(MAX_READINGS):
        total_s = root_time_s(process) + sum(map(_time_s, descendants))
        before, descendants = descendants, process.children(recursive=True)
        if set(before) <= set(descendants):
            break
    return total_s


def _own_time_s(_: psutil.Process) -> float:
    """Returns the processor time of this process and of its ended children [s], more precisely than `_time_s`."""
    ended = os.times()
    return time.process_time() + ended.children_user + ended.children_system


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
