# SPDX-License-Identifier: BSD-3-Clause
"""A benchmark needs no sourced shell, and leaves no program behind however it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

ROOT = Path(__file__).resolve().parents[3]
STARTS_A_PROGRAM = """
import workspace
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True)
print(child.pid, flush=True)
time.sleep(600)
"""

HAS_A_WORKER = f"""
import workspace
import subprocess, sys, time
worker = subprocess.Popen([sys.executable, "-c", {STARTS_A_PROGRAM!r}], stdout=subprocess.PIPE, text=True)
print(worker.stdout.readline(), flush=True)
worker.kill()
time.sleep(600)
"""
"""The worker has no time to end what it started."""

SPAWNS = """
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
    time.sleep(600)
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


def test_help_needs_no_sourced_shell() -> None:
    bare = {name: os.environ[name] for name in ("HOME",)}
    printed = subprocess.run(
        [ROOT / "benchmarks" / "planning", "--help"],
        env={**bare, "PATH": "/usr/local/bin:/usr/bin:/bin"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout
    assert "--planner PLANNER" in printed
