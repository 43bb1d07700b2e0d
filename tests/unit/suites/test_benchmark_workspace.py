# SPDX-License-Identifier: BSD-3-Clause
"""A benchmark needs no sourced shell, and leaves no program behind however it ends."""

from __future__ import annotations

import ast
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

ROOT = Path(__file__).resolve().parents[3]
WAIT = "while True: time.sleep(0.1)"
"""Python handles a signal that arrives just before a sleep after it, so that one long sleep could delay the end."""
STARTS_A_PROGRAM = f"""
import workspace
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True)
print(child.pid, flush=True)
{WAIT}
"""

ENDS_SLOWLY = f"""
import workspace
import subprocess, sys, time
from modular_framework_core.launching import launch_session
kill = launch_session.kill_processes_with

def ask_first(*arguments, **options):
    print("ends", flush=True)
    sys.stdin.readline()
    return kill(*arguments, **options)

launch_session.kill_processes_with = ask_first
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True)
print(child.pid, flush=True)
{WAIT}
"""

HAS_A_WORKER = f"""
import workspace
import subprocess, sys, time
worker = subprocess.Popen([sys.executable, "-c", {STARTS_A_PROGRAM!r}], stdout=subprocess.PIPE, text=True)
print(worker.stdout.readline(), flush=True)
worker.kill()
{WAIT}
"""
"""The worker has no time to end what it started."""

SPAWNS = f"""
import workspace
import multiprocessing, time

def work(ready):
    ready.set()
    time.sleep(600)

if __name__ == "__main__":
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    context.Process(target=work, args=(ready,), daemon=True).start()
    ready.wait()
    print("ready", flush=True)
    {WAIT}
"""


@pytest.mark.parametrize("program", [STARTS_A_PROGRAM, HAS_A_WORKER], ids=["itself", "a worker"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_what_a_benchmark_started_ends_with_it(number: signal.Signals, program: str) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": f"{ROOT / 'benchmarks'}:{os.environ['PYTHONPATH']}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as benchmark:
        assert benchmark.stdout is not None
        child = psutil.Process(int(benchmark.stdout.readline()))
        benchmark.send_signal(number)
    assert psutil.wait_procs([child], 30.0) == ([child], [])


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_spawned_process_ends_without_a_traceback(number: signal.Signals, tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(SPAWNS)
    with subprocess.Popen(
        [sys.executable, program],
        env={**os.environ, "PYTHONPATH": f"{ROOT / 'benchmarks'}:{os.environ['PYTHONPATH']}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as benchmark:
        assert benchmark.stdout is not None
        if benchmark.stdout.readline() == "ready\n":
            os.killpg(benchmark.pid, number)
        printed = benchmark.communicate(timeout=60.0)[1]
    assert printed == "interrupted\n"


def test_a_second_interrupt_does_not_save_what_a_benchmark_started() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", ENDS_SLOWLY],
        env={**os.environ, "PYTHONPATH": f"{ROOT / 'benchmarks'}:{os.environ['PYTHONPATH']}"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as benchmark:
        assert benchmark.stdin is not None and benchmark.stdout is not None
        child = psutil.Process(int(benchmark.stdout.readline()))
        benchmark.send_signal(signal.SIGINT)
        assert benchmark.stdout.readline() == "ends\n"
        benchmark.send_signal(signal.SIGINT)
        benchmark.stdin.write("go on\n")
        benchmark.stdin.flush()
    assert psutil.wait_procs([child], 30.0) == ([child], [])


def help_of(folder: Path) -> str:
    """Returns what `planning --help` prints in a shell without the workspace."""
    return subprocess.run(
        [folder / "benchmarks" / "planning", "--help"],
        env={"HOME": os.environ["HOME"], "PATH": "/usr/local/bin:/usr/bin:/bin"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout


def test_help_needs_no_sourced_shell() -> None:
    assert "--planner PLANNER" in help_of(ROOT)


def test_help_in_a_clone_without_a_build_sets_nothing_up(tmp_path: Path) -> None:
    (tmp_path / "benchmarks").mkdir()
    for name in ("planning", "workspace.py"):
        shutil.copy(ROOT / "benchmarks" / name, tmp_path / "benchmarks" / name)
    (tmp_path / "install.sh").write_text("#!/bin/sh\necho set-up; exit 1\n")
    (tmp_path / "install.sh").chmod(0o755)
    printed = help_of(tmp_path)
    assert "benchmarks/planning" in printed and "./install.sh sets the framework up" in printed
    assert "set-up" not in printed


def test_every_benchmark_enters_the_workspace_before_anything_else() -> None:
    programs = [path for path in (ROOT / "benchmarks").iterdir() if path.is_file() and os.access(path, os.X_OK)]
    assert len(programs) > 30
    for program in programs:
        statements = ast.parse(program.read_text()).body
        imported = [
            statement.module if isinstance(statement, ast.ImportFrom) else statement.names[0].name
            for statement in statements
            if isinstance(statement, ast.Import | ast.ImportFrom)
        ]
        assert [name for name in imported if name != "__future__"][0] == "workspace", program
