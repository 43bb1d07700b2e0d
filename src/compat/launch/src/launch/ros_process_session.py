# SPDX-License-Identifier: BSD-3-Clause
"""Runs processes with the master, parameter server and process monitor of roslaunch's Python API."""

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
    """Started process.

    Attributes:
        request: Request of the process.
        process: Process object of roslaunch.
        seen_starts: Number of reported starts.
        seen_ends: Number of reported exits.
    """

    request: ProcessRequest
    process: Any
    seen_starts: int = 0
    seen_ends: int = 0

    @property
    def pid(self) -> int:
        """Returns the process id."""
        return int(self.process.pid)


class RosProcessSession(roslaunch.pmon.ProcessListener):
    """ROS master with parameters, and processes with roslaunch's respawning and timeouts.

    A running master at ROS_MASTER_URI is used; otherwise, a master is started and ends with the session.

    Args:
        on_exit: Function that is called in roslaunch's thread with a process and its exit code.
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
        """Returns the processes that are running or waiting to respawn."""
        with self._lock:
            return list(self._running.values())

    @property
    def ended(self) -> bool:
        """Returns whether roslaunch has stopped all processes, because a required node of an XML file has ended."""
        return self._parent is not None and self._parent.pm is not None and self._parent.pm.is_shutdown

    def connect(self) -> None:
        """Connects to the master, or starts a master; may be called twice.

        Raises:
            LaunchError: No master is running and no master can be started.
        """
        if self._parent is not None:
            return
        roslib.set_interactive(True)  # the launch handles signals, so that its event handlers run first
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
        """Sets parameters after removing others.

        Args:
            values: Values by full name.
            cleared: Full names of parameters to remove, including all parameters below.

        Raises:
            LaunchError: The parameter server rejected a parameter.
        """
        if not values and not cleared:
            return
        master = self._connected_parent().config.master
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
        """Returns a value of the parameter server; None if the parameter is not set."""
        code, _, value = self._connected_parent().config.master.get().getParam(CALLER, name)
        return value if code == 1 else None

    def start(self, request: ProcessRequest) -> RunningProcess:
        """Starts a process.

        Raises:
            LaunchError: The program does not exist or cannot be executed.
        """
        parent = self._connected_parent()
        try:
            process = self._process_of(request)
            running = RunningProcess(request, process)
            with self._lock:
                self._running[process.name] = running
            parent.pm.register(process)
            process.start()  # an immediate exit is reported like any other exit
        except (roslaunch.core.RLException, roslaunch.node_args.NodeParamsException) as error:
            raise LaunchError(f"{request.name}: {error}") from error
        return running

    def stop(self, running: RunningProcess) -> None:
        """Stops a process with SIGINT, and after timeouts with SIGTERM and SIGKILL; the process does not respawn."""
        running.process.respawn = False
        running.process.stop([])

    def close(self) -> None:
        """Stops all processes, and the master if this session started it; may be called twice."""
        if self._parent is not None:
            self._parent.shutdown()

    def process_died(self, process_name: str, exit_code: int | None) -> None:
        """Handles an exit; roslaunch's process monitor calls this repeatedly while a process waits for its respawn."""
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

    def _connected_parent(self) -> roslaunch.parent.ROSLaunchParent:
        if self._parent is None:
            raise LaunchError("call connect() before setting parameters or starting processes")
        return self._parent

    def _process_of(self, request: ProcessRequest) -> Any:
        uri = self._connected_parent().config.master.uri
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
