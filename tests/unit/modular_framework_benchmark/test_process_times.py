# SPDX-License-Identifier: BSD-3-Clause
"""Processor time of a node is measured from outside, with that of everything it starts."""

from __future__ import annotations

import os
import subprocess
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from modular_framework_benchmark.episodes.process_times import processor_time_s
from modular_framework_core.launching.launch_session import kill_processes_with
from modular_framework_testing.ros_session import until

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


def test_a_daemon_of_a_method_counts(session: list[subprocess.Popen[str]], tmp_path: Path) -> None:
    daemon = tmp_path / "daemon"
    text = f"""
import os
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        {BUSY.replace(chr(10), chr(10) + "        ")}
        open({str(daemon)!r}, "w").write(str(os.getpid()))
        time.sleep(60)
    os._exit(0)
os.wait()
"""
    session.append(started(text + "print('', flush=True); input()", "method"))
    try:
        until(daemon.is_file, "the daemon")
        assert BUSY_S - TICKS_S <= processor_time_s(["/method"]) < BUSY_S + 1.0
    finally:
        kill_processes_with("ROS_HOME", os.environ["ROS_HOME"])


def test_processes_of_another_session_do_not_count(
    session: list[subprocess.Popen[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    session.append(started(BUSY + "print('', flush=True); input()", "method"))
    monkeypatch.setenv("ROS_HOME", "/nowhere/else")
    assert processor_time_s(["/method"]) == 0.0
