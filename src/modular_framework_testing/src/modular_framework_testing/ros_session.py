# SPDX-License-Identifier: BSD-3-Clause
"""A separate ROS master and its launches, so that tests run in parallel and beside a user's master."""

from __future__ import annotations

import contextlib
import functools
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar
from xmlrpc.client import ServerProxy

import rosgraph
import roslib.packages
import rospkg

from modular_framework_core.launching.launch_session import Launch, LaunchSession, free_port

__all__ = ["Launch", "RosSession", "executable", "free_port", "hears", "until"]


def until(condition: Callable[[], Any], what: str, timeout_s: float = 30.0) -> None:
    """Waits until a condition holds.

    Args:
        condition: Condition, called every 10 ms.
        what: Description of the condition for the error.
        timeout_s: Timeout [s].

    Raises:
        AssertionError: The condition does not hold within the timeout; the message contains `what`.
    """
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"not within {timeout_s:g} s: {what}")
        time.sleep(0.01)


def hears(subscriber: Any, node: str) -> bool:
    """Returns whether a rospy subscriber of this process receives the next message of a node.

    rospy's `get_num_connections()` of a subscriber counts connections before they are established.
    """
    return any(link.callerid_pub == node for link in subscriber.impl.connections)


@functools.cache
def executable(package: str, name: str) -> str:
    """Returns the path of the program that `rosrun` would run. Faster than `rosrun`, because the search is cached."""
    return str(roslib.packages.find_node(package, name)[0])


def _launch_arguments(args: Mapping[str, object]) -> list[str]:
    return [f"{name}:={value}" for name, value in args.items()]


class RosSession(LaunchSession):
    """A ROS master and its launches.

    Attributes:
        started: All sessions of this process that were not stopped.
        master_timeout_s: Time for a master to start [s].
    """

    started: ClassVar[list[RosSession]] = []
    master_timeout_s = 20.0

    def __init__(self, master_uri: str | None = None) -> None:
        """Chooses a port; starts no process.

        Args:
            master_uri: URI of a running master, for example of rostest; None if the session starts its own master.
        """
        super().__init__(master_uri)
        self.started.append(self)
        self._suite_logs = Path(rospkg.get_log_dir()) if master_uri else None

    def start_master(self) -> None:
        """Starts roscore on the session's port.

        Raises:
            AssertionError: The master does not respond within its time.
        """
        self.start(["roscore", "-p", str(self.port)])
        self._wait_for_master()

    def launch(self, launch_xml: str | Path, **args: object) -> Launch:
        """Starts roslaunch on the running master, or on a master that another launch is starting.

        Args:
            launch_xml: Path of a launch file, or its text.
            **args: Arguments `name:=value`.

        Raises:
            AssertionError: No master responds within its time; roslaunch would wait forever.
        """
        self._wait_for_master()
        number = len(self._launches)
        path = Path(launch_xml) if isinstance(launch_xml, Path) else self.folder / f"launch_{number}.launch"
        if isinstance(launch_xml, str):
            path.write_text(launch_xml)
        return self.start(["roslaunch", "--wait", str(path), *_launch_arguments(args)])

    def launch_package(self, package: str, launch_file: str, **args: object) -> Launch:
        """Runs `roslaunch PACKAGE FILE name:=value ...`, which starts a master if none runs."""
        command = ["roslaunch", "-p", str(self.port), package, launch_file, *_launch_arguments(args)]
        return self.start(command)

    def launch_python(self, package: str, launch_file: str, **args: object) -> Launch:
        """Runs `launch_py PACKAGE FILE name:=value ...` on a Python launch file; starts a master if none runs."""
        return self.start(["rosrun", "launch", "launch_py", package, launch_file, *_launch_arguments(args)])

    def run_framework(self, package: str = "modular_framework_api", **args: object) -> Launch:
        """Runs `run_framework PACKAGE name:=value ...`: the framework with a package's robot until the task ends."""
        return self.start(["rosrun", "modular_framework_api", "run_framework", package, *_launch_arguments(args)])

    def wait_for_service(self, name: str, timeout_s: float = 30.0) -> None:
        """Waits until a service is advertised.

        Raises:
            AssertionError: Nobody advertises the service within the timeout; the message contains the log.
        """
        master = rosgraph.Master("/test_session", master_uri=self.env["ROS_MASTER_URI"])

        def is_advertised() -> bool:
            with contextlib.suppress(rosgraph.MasterException, OSError):
                return bool(master.lookupService("/" + name.lstrip("/")))
            return False

        self._wait_until(is_advertised, timeout_s, f"service {name}")

    def answers(self, node: str) -> bool:
        """Returns whether a node responds at its own interface."""
        with contextlib.suppress(rosgraph.MasterException, OSError):
            uri = rosgraph.Master("/test_session", master_uri=self.env["ROS_MASTER_URI"]).lookupNode(node)
            return bool(ServerProxy(uri).getPid("/test_session")[0] == 1)
        return False

    def stop(self) -> None:
        """Stops the launches and their remaining processes. May be called twice."""
        with contextlib.suppress(ValueError):
            self.started.remove(self)
        super().stop()

    def log(self) -> str:
        """Returns the output of all launches so far, and the logs of the nodes of a rostest file."""
        logs = self._suite_logs / self._run_id() if self._suite_logs else self.folder / "none"
        return self.printed_output() + "".join(path.read_text(errors="replace") for path in sorted(logs.glob("*.log")))

    def printed_output(self) -> str:
        """Returns the output of all launches so far."""
        return "".join(launch.log() for launch in self._launches)

    def _run_id(self) -> str:
        return str(rosgraph.Master("/test_session", master_uri=self.env["ROS_MASTER_URI"]).getParam("/run_id"))

    def _wait_for_master(self) -> None:
        what = f"a ROS master on port {self.port}, started by start_master or by another launch"
        self._wait_until(self._master_answers, self.master_timeout_s, what)

    def _master_answers(self) -> bool:
        return rosgraph.is_master_online(self.env["ROS_MASTER_URI"])

    def _wait_until(self, condition: Callable[[], Any], timeout_s: float, what: str) -> None:
        try:
            until(condition, what, timeout_s)
        except AssertionError as error:
            raise AssertionError(f"{error}; log:\n{self.log()}") from None
