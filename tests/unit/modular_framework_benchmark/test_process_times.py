# SPDX-License-Identifier: BSD-3-Clause
"""Processor time of a node is measured from outside, with that of everything it starts."""

from __future__ import annotations

import os
import subprocess
import sys
import uuid
from collections.abc import Iterator

import pytest

from modular_framework_benchmark.episodes.process_times import processor_time_s

BUSY_S, TICKS_S = 0.4, 0.06
BUSY = f"import time\nwhile time.process_time() < {BUSY_S}: pass\n"
NODE = f"""
import subprocess, sys
{BUSY}
run = [sys.executable, "-c", {BUSY!r}]
subprocess.run(run)                                    # a child that ends
orphan = [sys.executable, "-c", {BUSY + "print('', flush=True); input()"!r}]
starter = "import subprocess, sys; subprocess.Popen(sys.argv[1:], stdout=1, stdin=0)"
subprocess.run([sys.executable, "-c", starter, *orphan])   # a grandchild without its parent
input()
"""


def started(text: str, name: str) -> subprocess.Popen[str]:
    """Starts a process as roslaunch starts a node; returns once its first line has come."""
    process = subprocess.Popen(
        [sys.executable, "-c", text, f"__name:={name}"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    process.stdout.readline()
    return process


@pytest.fixture
def session(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[subprocess.Popen[str]]]:
    """A ROS session of its own, whose processes end with the test."""
    monkeypatch.setenv("ROS_HOME", f"/nowhere/{uuid.uuid4().hex}")
    processes: list[subprocess.Popen[str]] = []
    yield processes
    for process in processes:
        os.killpg(process.pid, 9)
        process.communicate()


def test_the_whole_tree_of_a_node_counts_and_no_other_process(session: list[subprocess.Popen[str]]) -> None:
    session.append(started(NODE, "method"))
    session.append(started(BUSY + "print('', flush=True); input()", "method_2"))
    used_s = processor_time_s(["/robot/method"])
    assert 3 * BUSY_S - TICKS_S <= used_s < 3 * BUSY_S + 1.0  # the rest is the interpreters' start
    assert BUSY_S - TICKS_S <= processor_time_s(["/method_2"]) < used_s
    assert processor_time_s(["/other"]) == 0.0
    assert processor_time_s([]) == 0.0


def test_processes_of_another_session_do_not_count(
    session: list[subprocess.Popen[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    session.append(started(BUSY + "print('', flush=True); input()", "method"))
    monkeypatch.setenv("ROS_HOME", "/nowhere/else")
    assert processor_time_s(["/method"]) == 0.0
