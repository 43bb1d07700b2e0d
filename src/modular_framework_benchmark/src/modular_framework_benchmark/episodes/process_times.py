# SPDX-License-Identifier: BSD-3-Clause
"""Measures the processor time of ROS nodes through /proc, without relying on the nodes' own reports."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

from modular_framework_core.launching.launch_session import processes_with


def processor_time_s(nodes: Collection[str]) -> float:
    """Returns the processor time that nodes of this process's ROS session have used so far [s].

    The process trees count completely: children, ended children that were waited for, and processes that left their
    parent but not the Unix session that roslaunch opens for each node. A process that left both (a daemon) counts too:
    nodes of the framework start no daemons.

    Args:
        nodes: Absolute names of the nodes.
    """
    marks = {f"__name:={name.rpartition('/')[2]}".encode() for name in nodes}
    processes = processes_with("ROS_HOME", os.environ["ROS_HOME"]) if nodes else []
    known_parents = {*processes, os.getpid(), os.getppid()}  # the parent of this process starts roslaunch
    trees: set[int] = set()
    ticks = 0
    for process in sorted(processes):  # parents first
        folder = Path("/proc", str(process))
        try:
            words = set((folder / "cmdline").read_bytes().split(b"\0"))
            fields = (folder / "stat").read_text().rpartition(")")[2].split()  # starts at the third field, see proc(5)
        except OSError:  # the process has ended
            continue
        parent, session = int(fields[1]), int(fields[3])
        is_daemon = parent not in known_parents and (session == process or session not in known_parents)
        if marks & words or trees & {parent, session} or is_daemon:
            trees |= {process, session}
            ticks += sum(map(int, fields[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")
