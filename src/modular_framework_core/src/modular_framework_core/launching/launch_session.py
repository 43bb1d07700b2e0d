# SPDX-License-Identifier: BSD-3-Clause
"""Runs launches on a separate ROS master, isolated from other masters, and stops all of their processes."""

from __future__ import annotations

import contextlib
import math
import os
import random
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import urlparse

import psutil

STOP_TIMEOUT_S = 15.0
"""Timeout of a stopping launch before it is killed [s]."""

KILL_POLL_S = 0.01
"""Polling period for remaining processes [s]."""
LOADING_S = 0.1
"""Maximum time during which the environment of a new process is empty [s]."""

PORT_RANGE = range(12000, 32000)
"""Ports of masters, below those that Linux assigns by default."""


def free_port() -> int:
    """Returns a free TCP port of the loopback interface.

    The operating system never assigns a port of `PORT_RANGE` to a node, so the port stays free until the master starts.
    """
    for port in random.SystemRandom().sample(PORT_RANGE, len(PORT_RANGE)):
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise OSError(f"all ports from {PORT_RANGE[0]} to {PORT_RANGE[-1]} are in use")


def processes_with(variable: str, value: str, prefix: bool = False) -> list[int]:
    """Returns the IDs of all other processes with an environment variable of a given value, and of their descendants.

    Args:
        variable: Name of the environment variable.
        value: Value of the variable.
        prefix: Whether `value` is a prefix of the variable's value.
    """
    mark, process_ids = f"{variable}={value}".encode(), set()
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # process ended or belongs to another user
            entries = environment_of(folder).split(b"\0")
            marked = any(entry.startswith(mark) for entry in entries) if prefix else mark in entries
            if marked and int(folder.name) != os.getpid():
                process_ids.add(int(folder.name))
    parents = {process.pid: process.info["ppid"] for process in psutil.process_iter(["ppid"])} if process_ids else {}
    while children := {process_id for process_id, parent in parents.items() if parent in process_ids} - process_ids:
        process_ids |= children
    return sorted(process_ids - {os.getpid()})


def environment_of(process: Path) -> bytes:
    """Returns the environment of a process, entries separated by zero bytes.

    Linux shows an empty environment while it loads the program of a new process, so an empty environment is read
    again.

    Args:
        process: Folder of the process in /proc.

    Raises:
        OSError: The process has ended, or belongs to another user.
    """
    end_s = time.monotonic() + LOADING_S
    while not (entries := (process / "environ").read_bytes()) and time.monotonic() < end_s:
        if not (process / "exe").exists():  # a kernel thread, or a process that has ended
            break
        time.sleep(0.001)
    return entries


def kill_processes_with(variable: str, value: str, prefix: bool = False, timeout_s: float = math.inf) -> int:
    """Kills the processes of `processes_with` repeatedly until none remains, including newly started processes.

    Args:
        variable: Name of the environment variable.
        value: Value of the variable.
        prefix: Whether `value` is a prefix of the variable's value.
        timeout_s: Timeout [s].

    Returns:
        The number of killed processes.

    Raises:
        TimeoutError: Some processes remain.
    """
    killed: set[int] = set()
    end_s = time.monotonic() + timeout_s
    while remaining := processes_with(variable, value, prefix):
        if time.monotonic() > end_s:
            raise TimeoutError(
                f"processes {remaining} with {variable}={value} do not end within {timeout_s:g} s; end them by hand"
            )
        for process in remaining:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        killed.update(remaining)
        time.sleep(KILL_POLL_S)
    return len(killed)


class Launch:
    """A running launch in its own process group, stopped by SIGINT.

    Attributes:
        process: Process of the launch.
    """

    def __init__(self, command: Sequence[str], env: Mapping[str, str], log_path: Path) -> None:
        """Starts a command.

        Args:
            command: Program and arguments.
            env: Environment variables.
            log_path: File for the output.
        """
        self._log_path = log_path
        with log_path.open("w") as log_file:
            self.process = subprocess.Popen(
                command, env=dict(env), stdout=log_file, stderr=subprocess.STDOUT, start_new_session=True
            )

    def alive(self) -> bool:
        """Returns whether the launch is running."""
        return self.process.poll() is None

    def log(self) -> str:
        """Returns the output so far."""
        return self._log_path.read_text(errors="replace")

    def wait(self, timeout_s: float) -> int:
        """Waits for the end of the launch and returns its exit code.

        Raises:
            TimeoutError: The launch still runs after `timeout_s` [s]; the message contains the output.
        """
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise TimeoutError(f"the launch still ran after {timeout_s} s; its log:\n{self.log()}") from None

    def stop(self, timeout_s: float = STOP_TIMEOUT_S) -> None:
        """Stops the launch and its process group. May be called twice.

        Args:
            timeout_s: Timeout before the launch is killed [s].
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
    """A ROS master and its launches.

    Attributes:
        port: TCP port of the master.
        folder: Folder of the session's files, deleted with the session.
        env: Environment variables for processes of the session.
    """

    def __init__(self, master_uri: str | None = None, log_folder: Path | None = None) -> None:
        """Chooses a port and creates the folder; starts no process.

        Args:
            master_uri: URI of a running master; None if a launch of the session starts a master.
            log_folder: Folder for the nodes' logs; None for the session's folder.
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
        # if two nodes create the folder at the same time, rospy's logging leaves one node without a log
        Path(self.env["ROS_LOG_DIR"]).mkdir(parents=True, exist_ok=True)
        self._launches: list[Launch] = []

    def start(self, command: Sequence[str], log_path: Path | None = None) -> Launch:
        """Starts a command as a launch of the session.

        Args:
            command: Program and arguments.
            log_path: File for the output; None for a file in the session's folder.
        """
        launch = Launch(command, self.env, log_path or self.folder / f"launch_{len(self._launches)}.txt")
        self._launches.append(launch)
        return launch

    def alive(self) -> bool:
        """Returns whether all launches are running."""
        return all(launch.alive() for launch in self._launches)

    def processes(self) -> list[int]:
        """Returns the IDs of all running processes of the session."""
        return processes_with("ROS_HOME", self.env["ROS_HOME"])

    def stop(self) -> None:
        """Stops the launches in reverse order and then kills remaining processes. May be called twice."""
        for launch in reversed(self._launches):
            launch.stop()
        # roslaunch starts master and nodes in separate sessions, which survive a killed roslaunch
        self.kill()

    def kill(self) -> None:
        """Kills all processes at once, which is safe for a simulated stack. May be called twice."""
        kill_processes_with("ROS_HOME", self.env["ROS_HOME"])
        for launch in self._launches:
            launch.process.wait()
        with contextlib.suppress(OSError):
            self._folder.cleanup()
