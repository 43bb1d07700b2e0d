# SPDX-License-Identifier: BSD-3-Clause
"""A benchmark that starts the whole framework leaves no process behind when it is interrupted."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import uuid
from pathlib import Path

import psutil
import pytest

from modular_framework_core.launching.launch_session import processes_with
from modular_framework_testing.ros_session import until

MARK = "MODULAR_FRAMEWORK_BENCHMARK"
SIMULATION = Path(__file__).parents[2] / "benchmarks" / "simulation"
PROGRAMS = ("rosmaster", "roslaunch", "modular_framework_simulation", "move_group")
"""Parts of the command lines of processes that run before the interrupt."""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_an_interrupted_benchmark_ends_its_ros_graph(number: signal.Signals, tmp_path: Path) -> None:
    mark = uuid.uuid4().hex

    def started() -> bool:
        lines = ""
        for process in processes_with(MARK, mark, prefix=True):
            with contextlib.suppress(psutil.NoSuchProcess):
                lines += " ".join(psutil.Process(process).cmdline()) + "\n"
        return all(program in lines for program in PROGRAMS)

    command = [SIMULATION, "--only", "resting", "--quick", "--engines", "pybullet"]
    with (
        (tmp_path / "printed").open("w") as output,
        subprocess.Popen(command, env={**os.environ, MARK: mark}, stdout=output, stderr=output) as benchmark,
    ):
        try:
            until(started, f"processes of {', '.join(PROGRAMS)}", 120.0)
            benchmark.send_signal(number)
            assert benchmark.wait(60.0) != 0
        finally:
            benchmark.kill()
    assert not processes_with(MARK, mark, prefix=True)
    assert (tmp_path / "printed").read_text().splitlines()[-1:] == ["interrupted"]
