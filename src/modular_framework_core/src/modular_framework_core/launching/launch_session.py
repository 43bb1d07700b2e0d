# SPDX-License-Identifier: BSD-3-Clause
"""Launches on a ROS master of their own, beside a user's master and beside other sessions, stopped without a trace."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import urlparse

STOP_TIMEOUT_S = 15.0
"""How long a launch has to stop [s] before it is killed."""

KILL_POLL_S = 0.01
"""Time between two looks for processes that are left [s]."""


def free_port() -> int:
    """Returns a TCP port of the loopback interface that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def processes_with(variable: str, value: str, prefix: bool = False) -> list[int]:
    """Returns the other processes that were started with a variable of the environment at a value.

    Args:
        variable: Name of the variable.
        value: Its value.
        prefix: Whether the value may go on after `value`.
    """
    mark, found = f"{variable}={value}".encode(), []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # ended meanwhile, or another user's
            entries = (folder / "environ").read_bytes().split(b"\0")
            marked = any(entry.startswith(mark) for entry in entries) if prefix else mark in entries
            if marked and int(folder.name) != os.getpid():
                found.append(int(folder.name))
    return found


def kill_processes_with(variable: str, value: str, prefix: bool = False, timeout_s: float = math.inf) -> int:
    """Kills those that `processes_with` returns until there are none: one may start another meanwhile.

    Args:
        variable: Name of the variable.
        value: Its value.
        prefix: Whether the value may go on after `value`.
        timeout_s: Longest time until they are gone [s].

    Returns:
        How many there were.

    Raises:
        TimeoutError: Some are still there.
    """
    killed: set[int] = set()
    end_s = time.monotonic() + timeout_s
    while left := processes_with(variable, value, prefix):
        if time.monotonic() > end_s:
            raise TimeoutError(
                f"processes {left} with {variable}={value} do not end within {timeout_s:g} s; end them by hand"
            )
        for process in left:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        killed.update(left)
        time.sleep(KILL_POLL_S)
    return len(killed)


class Launch:
    """A running launch on a given master, in a process group of its own; stopped as a user would, with SIGINT.

    Attributes:
        process: The process of the launch.
    """

    def __init__(self, command: Sequence[str], env: Mapping[str, str], log_path: Path) -> None:
        """Starts a command.

        Args:
            command: Program and arguments.
            env: Environment.
            log_path: File for what it prints.
        """
        self._log_path = log_path
        with log_path.open("w") as log_file:
            self.process = subprocess.Popen(
                command, env=dict(env), stdout=log_file, stderr=subprocess.STDOUT, start_new_session=True
            )

    def alive(self) -> bool:
        """Returns whether it still runs."""
        return self.process.poll() is None

    def log(self) -> str:
        """Returns everything it has printed so far."""
        return self._log_path.read_text(errors="replace")

    def wait(self, timeout_s: float) -> int:
        """Waits until it ends by itself, and returns its exit code.

        Raises:
            TimeoutError: It still ran after `timeout_s` [s]; the text has what it printed.
        """
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise TimeoutError(f"the launch still ran after {timeout_s} s; its log:\n{self.log()}") from None

    def stop(self, timeout_s: float = STOP_TIMEOUT_S) -> None:
        """Stops it and everything it started. May be called twice.

        Args:
            timeout_s: How long it has to stop [s] before it is killed.
        """
        with contextlib.suppress(ProcessLookupError):
            if self.alive():
                self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(timeout_s)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait(timeout_s)


class LaunchSession:
    """A ROS master's port and the launches on it.

    Attributes:
        port: TCP port of the master.
        folder: Folder of the session's files, removed with it.
        env: Environment for processes of the session.
    """

    def __init__(self, master_uri: str | None = None, log_folder: Path | None = None) -> None:
        """Chooses a port and makes the folder; starts nothing.

        Args:
            master_uri: URI of a master that runs already; None: a launch of the session starts its own.
            log_folder: Folder for the logs of the nodes; None: in the session's folder.
        """
        self.port = (urlparse(master_uri).port if master_uri else None) or free_port()
        self._folder = tempfile.TemporaryDirectory(prefix="ros_session_")
        self.folder = Path(self._folder.name)
        self.env = {
            **os.environ,
            "ROS_MASTER_URI": master_uri or f"http://127.0.0.1:{self.port}",
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(self.folder / "ros_home"),
            "ROS_LOG_DIR": str(log_folder or self.folder / "log"),
            "PYTHONUNBUFFERED": "1",
        }
        self.env.pop("ROS_HOSTNAME", None)
        # of two nodes that make it at the same time, rospy's logging leaves one without any log
        Path(self.env["ROS_LOG_DIR"]).mkdir(parents=True, exist_ok=True)
        self._launches: list[Launch] = []

    def start(self, command: Sequence[str], log_path: Path | None = None) -> Launch:
        """Starts a command as a launch of the session.

        Args:
            command: Program and arguments.
            log_path: File for what it prints; None: one in the session's folder.
        """
        started = Launch(command, self.env, log_path or self.folder / f"launch_{len(self._launches)}.txt")
        self._launches.append(started)
        return started

    def alive(self) -> bool:
        """Returns whether every launch still runs."""
        return all(launch.alive() for launch in self._launches)

    def processes(self) -> list[int]:
        """Returns the processes of the session that run now, whoever started them."""
        return processes_with("ROS_HOME", self.env["ROS_HOME"])

    def stop(self) -> None:
        """Stops the launches, the last first, then whatever of them is left. May be called twice."""
        for launch in reversed(self._launches):
            launch.stop()
        # roslaunch starts master and nodes in sessions of their own: they outlive one that had to be killed.
        self.kill()

    def kill(self) -> None:
        """Kills everything at once: for a stack in simulation, which loses nothing by it. May be called twice."""
        kill_processes_with("ROS_HOME", self.env["ROS_HOME"])
        for launch in self._launches:
            launch.process.wait()
        with contextlib.suppress(OSError):
            self._folder.cleanup()
