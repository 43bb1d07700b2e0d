# SPDX-License-Identifier: BSD-3-Clause
"""A ROS master of its own and the launches that run on it, for tests beside each other and beside a user's master."""

from __future__ import annotations

import contextlib
import functools
import time
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import Any, ClassVar
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
import roslib.packages
import rospkg

from modular_framework_core.launching.launch_session import (
    Launch,
    LaunchSession,
    free_port,
    kill_processes_with,
    processes_with,
)

__all__ = [
    "Launch",
    "RosSession",
    "executable",
    "free_port",
    "hears",
    "kill_processes_with",
    "processes_with",
    "pytest_runtest_makereport",
    "until",
]
SHOWN_LINES = 150


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


def hears(subscriber: Any, node: str) -> bool:
    """Whether a subscriber of this process receives the next message that a node publishes.

    rospy's get_num_connections() of a subscriber counts connections before they are made.
    """
    return any(link.callerid_pub == node for link in subscriber.impl.connections)


@functools.cache
def executable(package: str, name: str) -> str:
    """Answers what rosrun would run, searched once: rosrun takes as long for that as some nodes live."""
    return str(roslib.packages.find_node(package, name)[0])


def _launch_arguments(args: Mapping[str, object]) -> list[str]:
    return [f"{name}:={value}" for name, value in args.items()]


class RosSession(LaunchSession):
    """A master and the launches on it: the master that rostest brought, or one of the session's own."""

    started: ClassVar[list[RosSession]] = []

    def __init__(self, master_uri: str | None = None) -> None:
        super().__init__(master_uri)
        self.started.append(self)
        self._suite_logs = Path(rospkg.get_log_dir()) if master_uri else None

    def start_master(self, timeout_s: float = 20.0) -> None:
        """Starts roscore on the session's port.

        Raises:
            AssertionError: it did not answer in time.
        """
        self.start(["roscore", "-p", str(self.port)])
        self._wait_until(self._master_answers, timeout_s, f"a ROS master on port {self.port}")

    def launch(self, launch_xml: str | Path, **args: object) -> Launch:
        """Starts roslaunch on a file, or on the text of one, with arguments `name:=value`."""
        number = len(self._launches)
        path = Path(launch_xml) if isinstance(launch_xml, Path) else self.folder / f"launch_{number}.launch"
        if isinstance(launch_xml, str):
            path.write_text(launch_xml)
        return self.start(["roslaunch", "--wait", str(path), *_launch_arguments(args)])

    def launch_package(self, package: str, launch_file: str, **args: object) -> Launch:
        """Starts roslaunch as a user would, master included: `roslaunch PACKAGE FILE name:=value ...`."""
        command = ["roslaunch", "-p", str(self.port), package, launch_file, *_launch_arguments(args)]
        return self.start(command)

    def launch_python(self, package: str, launch_file: str, **args: object) -> Launch:
        """Starts a Python launch file as a user would, master included: `launch_py PACKAGE FILE name:=value ...`."""
        return self.start(["rosrun", "launch", "launch_py", package, launch_file, *_launch_arguments(args)])

    def run_framework(self, package: str = "modular_framework_api", **args: object) -> Launch:
        """Starts the framework with a package's robot so that it ends with the task, as `run_framework PACKAGE ...`."""
        return self.start(["rosrun", "modular_framework_api", "run_framework", package, *_launch_arguments(args)])

    def wait_for_service(self, name: str, timeout_s: float = 30.0) -> None:
        """Waits until a service is advertised; fails with the launches' logs."""
        master = rosgraph.Master("/test_session", master_uri=self.env["ROS_MASTER_URI"])

        def advertised() -> bool:
            with contextlib.suppress(rosgraph.MasterException, OSError):
                return bool(master.lookupService("/" + name.lstrip("/")))
            return False

        self._wait_until(advertised, timeout_s, f"service {name}")

    def answers(self, node: str) -> bool:
        """Whether a node answers at its own interface, whoever started it."""
        with contextlib.suppress(rosgraph.MasterException, OSError):
            uri = rosgraph.Master("/test_session", master_uri=self.env["ROS_MASTER_URI"]).lookupNode(node)
            return bool(ServerProxy(uri).getPid("/test_session")[0] == 1)
        return False

    def stop(self) -> None:
        """Stops the launches and whatever of them is left. May be called twice."""
        with contextlib.suppress(ValueError):
            self.started.remove(self)
        super().stop()

    def log(self) -> str:
        """What all launches have printed so far, and what the nodes of the suite's .test file have logged."""
        logs = self._suite_logs / self._run_id() if self._suite_logs else self.folder / "none"
        return self.printed() + "".join(path.read_text(errors="replace") for path in sorted(logs.glob("*.log")))

    def printed(self) -> str:
        """What all launches have printed so far."""
        return "".join(launch.log() for launch in self._launches)

    def _run_id(self) -> str:
        return str(rosgraph.Master("/test_session", master_uri=self.env["ROS_MASTER_URI"]).getParam("/run_id"))

    def _master_answers(self) -> bool:
        return rosgraph.is_master_online(self.env["ROS_MASTER_URI"])

    def _wait_until(self, condition: Callable[[], Any], timeout_s: float, what: str) -> None:
        try:
            until(condition, what, timeout_s)
        except AssertionError as error:
            raise AssertionError(f"{error}; log:\n{self.log()}") from None


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Shows with a failed test the last lines that the launches of its sessions have printed."""
    report = yield
    if report.failed:
        for number, session in enumerate(RosSession.started):
            lines = session.printed().splitlines()[-SHOWN_LINES:]
            report.sections.append((f"Printed by the launches of session {number}", "\n".join(lines)))
    return report
