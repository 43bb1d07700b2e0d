# SPDX-License-Identifier: BSD-3-Clause
"""A process of the arm's driver begins as an ordinary one, says what it has to, and ends."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import pytest

from modular_framework_drivers.ur.child_process import ChildProcess

TELLER = """
import os
policy = os.sched_getscheduler(0)
import socket, sys
with socket.socket(fileno=int(sys.argv[2])) as channel:
    channel.send(f"{sys.argv[1]} {policy} {os.getpid()}".encode())
    channel.recv(1)
"""


def test_it_begins_with_ordinary_scheduling_though_its_starter_runs_in_real_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, real_time_permitted: bool
) -> None:
    if not real_time_permitted:
        pytest.skip("no real-time scheduling is permitted here")
    (tmp_path / "teller.py").write_text(TELLER)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")
    started: list[ChildProcess] = []

    def start() -> None:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(70))
        started.append(ChildProcess("teller", ["state"]))

    starter = threading.Thread(target=start)
    starter.start()
    starter.join()
    said: list[bytes] = []
    deadline_s = time.monotonic() + 20.0
    while not said and time.monotonic() < deadline_s:
        said.extend(started[0].messages())
        time.sleep(0.01)
    role, policy, number = said[0].decode().split()
    assert (role, int(policy)) == ("state", os.SCHED_OTHER)
    started[0].end()
    with pytest.raises(ProcessLookupError):
        os.kill(int(number), 0)
