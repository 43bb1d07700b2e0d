# SPDX-License-Identifier: BSD-3-Clause
"""A ROS master of its own and the launches that run on it, for tests beside each other and beside a user's master."""

from __future__ import annotations

import contextlib
import functools
import os
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlparse
from xmlrpc.client import ServerProxy

import rosgraph
import roslib.packages
import rospkg

STOP_TIMEOUT_S = 15.0


def free_port() -> int:
    """Answers a TCP port of the loopback interface that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def until(condition: Callable[[], Any], what: str, timeout_s: float = 30.0) -> None:
    """Waits until a condition holds: long enough for a busy computer, and not for ever.

    Raises:
        AssertionError: it did not hold within `timeout_s` [s]; names what was waited for.
    """
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"not within {timeout_s:g} s: {what}")
        time.sleep(0.01)


def processes_with(variable: str, value: str) -> list[int]:
    """Answers the other processes that were started with a variable of the environment at a value."""
    mark, found = f"{variable}={value}".encode(), []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # ended meanwhile, or another user's
            if mark in (folder / "environ").read_bytes().split(b"\0") and int(folder.name) != os.getpid():
                found.append(int(folder.name))
    return found


@functools.cache
def executable(package: str, name: str) -> str:
    """Answers what rosrun would run, searched once: rosrun takes as long for that as some nodes live."""
    return str(roslib.packages.find_node(package, name)[0])


class Launch:
    """One running roslaunch on a given master; stopped as a user would stop it, with SIGINT."""

    def __init__(self, command: list[str], env: Mapping[str, str], log_path: Path) -> None:
        self._log_path = log_path
        with log_path.open("w") as log_file:
            self.process = subprocess.Popen(
                command, env=dict(env), stdout=log_file, stderr=subprocess.STDOUT, start_new_session=True
            )

    def alive(self) -> bool:
        return self.process.poll() is None

    def log(self) -> str:
        """Everything the launch has printed so far."""
        return self._log_path.read_text(errors="replace")

    def wait(self, timeout_s: float) -> int:
        """Waits for the launch to end by itself and answers its exit code."""
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"the launch still ran after {timeout_s} s; its log:\n{self.log()}") from None

    def stop(self) -> None:
        """Stops the launch and everything it started. May be called twice."""
        with contextlib.suppress(ProcessLookupError):
            if self.alive():
                self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait(STOP_TIMEOUT_S)


def _launch_arguments(args: Mapping[str, object]) -> list[str]:
    return [f"{name}:={value}" for name, value in args.items()]


class RosSession:
    """A master and the launches on it: the master that rostest brought, or one of the session's own.

    Attributes:
        port: TCP port of the master.
        env: environment for processes that belong to this session.
    """

    def __init__(self, master_uri: str | None = None) -> None:
        self.port = (urlparse(master_uri).port if master_uri else None) or free_port()
        self._folder = tempfile.TemporaryDirectory(prefix="ros_session_")
        self.folder = Path(self._folder.name)
        self.env = {
            **os.environ,
            "ROS_MASTER_URI": master_uri or f"http://127.0.0.1:{self.port}",
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(self.folder / "ros_home"),
            "ROS_LOG_DIR": str(self.folder / "log"),
            "PYTHONUNBUFFERED": "1",
        }
        self.env.pop("ROS_HOSTNAME", None)
        self._launches: list[Launch] = []
        self._master: Launch | None = None
        self._suite_logs = Path(rospkg.get_log_dir()) if master_uri else None

    def start_master(self, timeout_s: float = 20.0) -> None:
        """Starts roscore on the session's port.

        Raises:
            AssertionError: it did not answer in time.
        """
        command = ["roscore", "-p", str(self.port)]
        self._master = Launch(command, self.env, self.folder / "roscore.txt")
        self._wait_until(self._master_answers, timeout_s, f"a ROS master on port {self.port}")

    def launch(self, launch_xml: str | Path, **args: object) -> Launch:
        """Starts roslaunch on a file, or on the text of one, with arguments `name:=value`."""
        number = len(self._launches)
        path = Path(launch_xml) if isinstance(launch_xml, Path) else self.folder / f"launch_{number}.launch"
        if isinstance(launch_xml, str):
            path.write_text(launch_xml)
        return self._start(["roslaunch", "--wait", str(path), *_launch_arguments(args)])

    def launch_package(self, package: str, launch_file: str, **args: object) -> Launch:
        """Starts roslaunch as a user would, master included: `roslaunch PACKAGE FILE name:=value ...`."""
        command = ["roslaunch", "-p", str(self.port), package, launch_file, *_launch_arguments(args)]
        return self._start(command)

    def launch_python(self, package: str, launch_file: str, **args: object) -> Launch:
        """Starts a Python launch file as a user would, master included: `launch_py PACKAGE FILE name:=value ...`."""
        return self._start(["rosrun", "launch", "launch_py", package, launch_file, *_launch_arguments(args)])

    def run_framework(self, package: str = "modular_framework_api", **args: object) -> Launch:
        """Starts the framework with a package's robot so that it ends with the task, as `run_framework PACKAGE ...`."""
        return self._start(["rosrun", "modular_framework_api", "run_framework", package, *_launch_arguments(args)])

    def _start(self, command: list[str]) -> Launch:
        started = Launch(command, self.env, self.folder / f"launch_{len(self._launches)}.txt")
        self._launches.append(started)
        return started

    def wait_for_service(self, name: str, timeout_s: float = 30.0) -> None:
        """Waits until a service is advertised; fails with the launches' logs."""
        master = rosgraph.Master("/test_session", master_uri=self.env["ROS_MASTER_URI"])

        def advertised() -> bool:
            with contextlib.suppress(rosgraph.MasterException, OSError):
                return bool(master.lookupService("/" + name.lstrip("/")))
            return False

        self._wait_until(advertised, timeout_s, f"service {name}")

    def alive(self) -> bool:
        """Whether every launch of this session still runs."""
        return all(launch.alive() for launch in self._launches)

    def answers(self, node: str) -> bool:
        """Whether a node answers at its own interface, whoever started it."""
        with contextlib.suppress(rosgraph.MasterException, OSError):
            uri = rosgraph.Master("/test_session", master_uri=self.env["ROS_MASTER_URI"]).lookupNode(node)
            return bool(ServerProxy(uri).getPid("/test_session")[0] == 1)
        return False

    def log(self) -> str:
        """What all launches have printed so far, and what the nodes of the suite's .test file have logged."""
        logs = self._suite_logs / self._run_id() if self._suite_logs else self.folder / "none"
        return "".join(launch.log() for launch in self._launches) + "".join(
            path.read_text(errors="replace") for path in sorted(logs.glob("*.log"))
        )

    def _run_id(self) -> str:
        return str(rosgraph.Master("/test_session", master_uri=self.env["ROS_MASTER_URI"]).getParam("/run_id"))

    def stop(self) -> None:
        """Stops launches, then the master, then whatever of them is left. May be called twice."""
        for launch in reversed(self._launches):
            launch.stop()
        if self._master is not None:
            self._master.stop()
        # roslaunch starts master and nodes in sessions of their own: they outlive one that had to be killed.
        for process in self.processes():
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        with contextlib.suppress(OSError):
            self._folder.cleanup()

    def processes(self) -> list[int]:
        """The processes that run with this session's environment, whoever started them."""
        return processes_with("ROS_HOME", self.env["ROS_HOME"])

    def _master_answers(self) -> bool:
        return rosgraph.is_master_online(self.env["ROS_MASTER_URI"])

    def _wait_until(self, condition: Callable[[], Any], timeout_s: float, what: str) -> None:
        try:
            until(condition, what, timeout_s)
        except AssertionError as error:
            raise AssertionError(f"{error}; log:\n{self.log()}") from None
