# SPDX-License-Identifier: BSD-3-Clause
"""A process of the arm's driver begins as an ordinary one, says what it has to, and ends."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from modular_framework_drivers.ur.arm_messages import ALIVE, FAILED, MESSAGE_SIZE
from modular_framework_drivers.ur.child_process import ChildProcess
from modular_framework_drivers.ur.delay_watch import PORT

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


def test_the_reason_of_an_end_comes_although_the_control_loop_is_late() -> None:
    address = f"127.45.{os.getpid() % 250}.7"
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, socket.create_server((address, PORT)) as arm:
        arm.settimeout(30.0)
        with theirs:
            theirs.setblocking(False)
            with pytest.raises(BlockingIOError):
                while True:  # what the control loop has not read yet
                    theirs.send(ALIVE)
            module = [sys.executable, "-m", "modular_framework_drivers.ur.rtde_process", "state", str(theirs.fileno())]
            process = subprocess.Popen([*module, address], pass_fds=[theirs.fileno()])
        arm.accept()[0].close()
        time.sleep(0.3)  # the process notices it, and has no room for its last message
        ours.settimeout(20.0)
        messages = [ours.recv(MESSAGE_SIZE)]
        while messages[-1][:1] not in (FAILED, b""):
            messages.append(ours.recv(MESSAGE_SIZE))
    assert process.wait(20.0) == 1
    assert messages[-1].startswith(FAILED + f"Could not connect to {address}:{PORT}".encode())
