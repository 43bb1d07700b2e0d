# SPDX-License-Identifier: BSD-3-Clause
"""The processor time of a method is measured from outside, with that of everything it starts, and all of it ends."""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from modular_framework_benchmark.episodes.method_node import COMMAND, IN_ITS_FOLDER_OPTION
from modular_framework_benchmark.episodes.process_times import processor_time_s
from modular_framework_core.launching.launch_session import kill_processes_with, processes_with
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
DAEMON = """
import os, sys
def start_daemon(text):
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        return
    os.setsid()
    if os.fork() == 0:
        os.execve(sys.executable, [sys.executable, "-c", text], {})
    os._exit(0)
"""
Start = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    """Starts programs as a launch starts nodes; everything that they start ends with the test."""
    monkeypatch.setenv("TEST_MARK", uuid.uuid4().hex)
    processes: list[subprocess.Popen[str]] = []

    def start(text: str, *prefix: str) -> subprocess.Popen[str]:
        command = [*prefix, sys.executable, "-c", text]
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
        )
        processes.append(process)
        return process

    yield start
    kill_processes_with("TEST_MARK", os.environ["TEST_MARK"])
    for process in processes:
        process.communicate()


def wait_for_line(process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    process.stdout.readline()


def test_all_processes_of_a_method_count_and_no_other_process(start: Start) -> None:
    method, other = start(NODE, *COMMAND), start(BUSY + "print('', flush=True); input()")
    wait_for_line(method)
    wait_for_line(other)
    assert 3 * BUSY_S - TICKS_S <= processor_time_s(os.getpid()) < 3 * BUSY_S + 1.0  # the rest starts interpreters


def test_a_launch_without_a_method_has_no_time(start: Start) -> None:
    wait_for_line(start(BUSY + "print('', flush=True); input()"))
    assert processor_time_s(os.getpid()) == 0.0
    ended = start("")
    ended.communicate()
    assert processor_time_s(ended.pid) == 0.0


@pytest.mark.parametrize("end", ["time.sleep(60)", ""])
def test_a_daemon_with_an_empty_environment_counts_also_after_its_end(start: Start, tmp_path: Path, end: str) -> None:
    done = tmp_path / "done"
    text = f"{BUSY}\nopen({str(done)!r}, 'w').close()\n{end}"
    start(f"{DAEMON}\nstart_daemon({text!r})\ninput()", *COMMAND)
    until(done.is_file, "the daemon's computation")
    assert BUSY_S - TICKS_S <= processor_time_s(os.getpid()) < BUSY_S + 1.0


def test_a_process_that_ends_between_two_readings_counts(
    start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pid, go_on = tmp_path / "pid", tmp_path / "go_on"
    wait = f"while not os.path.exists({str(go_on)!r}): pass"
    text = f"{BUSY}\nimport os\nopen({str(pid)!r}, 'w').write(f'{{os.getpid()}}.')\n{wait}"
    start(f"{DAEMON}\nstart_daemon({text!r})\ninput()", *COMMAND)
    until(lambda: pid.is_file() and pid.read_text().endswith("."), "the daemon's computation")
    daemon = psutil.Process(int(pid.read_text().strip(".")))
    cpu_times = psutil.Process.cpu_times

    @functools.wraps(cpu_times)
    def read_and_let_the_daemon_end(process: psutil.Process) -> Any:
        times = cpu_times(process)
        if not go_on.exists():
            go_on.touch()
            until(lambda: not daemon.is_running(), "the end of the daemon")
        return times

    monkeypatch.setattr(psutil.Process, "cpu_times", read_and_let_the_daemon_end)
    assert processor_time_s(os.getpid()) >= BUSY_S - TICKS_S


def test_the_end_of_a_session_ends_such_daemons(start: Start, tmp_path: Path) -> None:
    file = tmp_path / "daemon"
    text = f"import os, time; open({str(file)!r}, 'w').write(str(os.getpid()) + '.'); time.sleep(60)"
    start(f"{DAEMON}\nstart_daemon({text!r})\ninput()", *COMMAND)
    until(lambda: file.is_file() and file.read_text().endswith("."), "the daemon")
    daemon = psutil.Process(int(file.read_text().strip(".")))
    assert daemon.pid in processes_with("TEST_MARK", os.environ["TEST_MARK"])
    kill_processes_with("TEST_MARK", os.environ["TEST_MARK"])
    until(lambda: not daemon.is_running(), "the end of the daemon")


def test_a_node_that_leaves_a_daemon_and_ends_goes_on_in_it(start: Start, tmp_path: Path) -> None:
    done = tmp_path / "done"
    text = f"{BUSY}\nopen({str(done)!r}, 'w').close()\ntime.sleep(60)"
    method = start(f"{DAEMON}\nstart_daemon({text!r})", *COMMAND)
    until(done.is_file, "the daemon's computation")
    assert method.poll() is None
    assert processor_time_s(os.getpid()) >= BUSY_S - TICKS_S


@pytest.mark.parametrize(
    ("end", "exit_code"),
    [("sys.exit(0)", 0), ("sys.exit(3)", 3), ("import signal; os.kill(os.getpid(), signal.SIGSEGV)", -signal.SIGSEGV)],
)
def test_the_launch_sees_how_a_node_ends(start: Start, end: str, exit_code: int) -> None:
    assert start(f"import os, sys; {end}", *COMMAND).wait(20.0) == exit_code


def test_a_node_that_fails_takes_its_daemons_along(start: Start) -> None:
    method = start(f"{DAEMON}\nstart_daemon('import time; time.sleep(60)')\nsys.exit(3)", *COMMAND)
    assert method.wait(20.0) == 3
    assert processes_with("TEST_MARK", os.environ["TEST_MARK"]) == []


def test_an_interrupt_ends_a_node_in_its_own_way(start: Start) -> None:
    text = "import signal, sys\nsignal.signal(2, lambda *_: sys.exit(7))\nprint('', flush=True)\nsignal.pause()"
    method = start(text, *COMMAND)
    wait_for_line(method)
    os.killpg(method.pid, signal.SIGINT)
    assert method.wait(20.0) == 7


def test_a_node_can_run_in_its_folder(tmp_path: Path) -> None:
    program = tmp_path / "node"
    program.write_text("#!/bin/sh\npwd\n")
    program.chmod(0o755)
    found = subprocess.run([*COMMAND, IN_ITS_FOLDER_OPTION, str(program)], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == str(tmp_path)
