# SPDX-License-Identifier: BSD-3-Clause
"""Runs processes with roslaunch's Python API: its master, its parameter server and its process monitor."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import rosgraph
import roslaunch
import roslaunch.core
import roslaunch.node_args
import roslaunch.nodeprocess
import roslaunch.parent
import roslaunch.pmon
import roslaunch.rlutil
import roslib

from launch.core.errors import LaunchError
from launch.core.process_request import ProcessRequest

CALLER = "/launch_py"


@dataclass(eq=False)
class RunningProcess:
    """A process that was started.

    Attributes:
        request: What it was started from.
        process: roslaunch's process.
        seen_starts: How many of its starts were reported.
        seen_ends: How many of its ends were reported.
    """

    request: ProcessRequest
    process: Any
    seen_starts: int = 0
    seen_ends: int = 0

    @property
    def pid(self) -> int:
        """Its process id."""
        return int(self.process.pid)


class RosProcessSession(roslaunch.pmon.ProcessListener):
    """A master, its parameters, and processes with the restarts and timeouts of roslaunch.

    A master that runs already at ROS_MASTER_URI is used, otherwise one is started and ends with the session.

    Args:
        on_exit: Called, in roslaunch's thread, with a process and its exit code.
    """

    def __init__(self, on_exit: Callable[[RunningProcess, int], None]) -> None:
        self._on_exit = on_exit
        self._parent: roslaunch.parent.ROSLaunchParent | None = None
        self._running: dict[str, RunningProcess] = {}
        self._counter = itertools.count(1)
        self._lock = threading.Lock()
        self._run_id = ""
        self.required_death: tuple[str, int] | None = None

    @property
    def running(self) -> list[RunningProcess]:
        """Processes that run, or wait for their restart."""
        with self._lock:
            return list(self._running.values())

    @property
    def ended(self) -> bool:
        """Whether roslaunch itself has ended everything, because a required node of an XML launch file ended."""
        return self._parent is not None and self._parent.pm is not None and self._parent.pm.is_shutdown

    def connect(self) -> None:
        """Connects to the master, or starts one; may be called twice.

        Raises:
            LaunchError: There is none and none can be started.
        """
        if self._parent is not None:
            return
        roslib.set_interactive(True)  # signals are for the launch, which lets its event handlers run first
        try:
            self._run_id = roslaunch.rlutil.get_or_generate_uuid(None, False)
            roslaunch.configure_logging(self._run_id)
            port = rosgraph.network.parse_http_host_and_port(rosgraph.get_master_uri())[1]
            parent = roslaunch.parent.ROSLaunchParent(
                self._run_id, [], port=port, process_listeners=[self], show_summary=False
            )
            self._parent = parent
            parent.start(auto_terminate=False)
        except roslaunch.core.RLException as error:
            raise LaunchError(f"no ROS master at {rosgraph.get_master_uri()}: {error}") from error

    def set_parameters(self, values: Mapping[str, Any], cleared: list[str]) -> None:
        """Sets parameters, after removing some with all below them.

        Args:
            values: Values by full name.
            cleared: Full names.

        Raises:
            LaunchError: The parameter server refused one.
        """
        if not values and not cleared:
            return
        master = self._connected().config.master
        calls = master.get_multi()
        present = [name for name in cleared if master.get().hasParam(CALLER, name)[2]]
        for name in present:
            calls.deleteParam(CALLER, name)
        for name, value in values.items():
            calls.setParam(CALLER, name, value)
        for name, (code, message, _) in zip([*present, *values], calls(), strict=True):
            if code != 1:
                raise LaunchError(f"parameter {name} was not set: {message}")

    def parameter(self, name: str) -> Any:
        """Returns a value of the parameter server; None when there is none."""
        code, _, value = self._connected().config.master.get().getParam(CALLER, name)
        return value if code == 1 else None

    def start(self, request: ProcessRequest) -> RunningProcess:
        """Starts a process.

        Raises:
            LaunchError: Its program is not there or cannot be run.
        """
        parent = self._connected()
        try:
            process = self._process_of(request)
            running = RunningProcess(request, process)
            with self._lock:
                self._running[process.name] = running
            parent.pm.register(process)
            process.start()  # one that has ended meanwhile is reported as any other
        except (roslaunch.core.RLException, roslaunch.node_args.NodeParamsException) as error:
            raise LaunchError(f"{request.name}: {error}") from error
        return running

    def stop(self, running: RunningProcess) -> None:
        """Ends one process: SIGINT, after its timeouts SIGTERM and SIGKILL; it does not start again."""
        running.process.respawn = False
        running.process.stop([])

    def close(self) -> None:
        """Ends all processes, and the master if it was started here; may be called twice."""
        if self._parent is not None:
            self._parent.shutdown()

    def process_died(self, process_name: str, exit_code: int | None) -> None:
        """Called by roslaunch's process monitor; again and again for a process that waits for its restart."""
        with self._lock:
            running = self._running.get(process_name)
        if running is None or running.seen_ends >= running.process.spawn_count:
            return
        running.seen_ends = running.process.spawn_count
        retries = running.request.respawn_max_retries
        if 0 <= retries < running.process.spawn_count:
            running.process.respawn = False
        if running.process.required:
            self.required_death = (running.request.name, exit_code or 0)
        self._on_exit(running, exit_code or 0)
        if not running.process.respawn:
            with self._lock:
                self._running.pop(process_name, None)

    def _connected(self) -> roslaunch.parent.ROSLaunchParent:
        if self._parent is None:
            raise LaunchError("connect() comes before parameters and processes")
        return self._parent

    def _process_of(self, request: ProcessRequest) -> Any:
        uri = self._connected().config.master.uri
        if request.roslaunch_node is not None:
            node = request.roslaunch_node
            node.machine = roslaunch.core.local_machine()
            return roslaunch.nodeprocess.create_node_process(self._run_id, node, uri)
        command = ["env", "-C", request.cwd, *request.command] if request.cwd else list(request.command)
        return roslaunch.nodeprocess.LocalProcess(
            self._run_id,
            "",
            f"{request.name}-{next(self._counter)}",
            command,
            {**request.environment, rosgraph.ROS_MASTER_URI: uri},
            not request.on_screen,
            respawn=request.respawn,
            respawn_delay=request.respawn_delay_s,
            required=False,
            cwd="cwd",
            is_node=request.is_node,
            sigint_timeout=request.sigterm_timeout_s,
            sigterm_timeout=request.sigkill_timeout_s,
        )
