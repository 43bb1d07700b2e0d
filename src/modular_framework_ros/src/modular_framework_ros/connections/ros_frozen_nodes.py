# SPDX-License-Identifier: BSD-3-Clause
"""Detects nodes whose process was stopped by SIGSTOP, which otherwise block every caller until a timeout.

The process state is read from the operating system, so that neither load nor a long computation looks like a stop.
"""

from __future__ import annotations

import functools
import threading
import time

import psutil
import rosgraph

LOOK_PERIOD_S, NODES_PERIOD_S = 0.5, 5.0
"""Period of the process checks, and of the requests for the master's node list [s]."""
FROZEN_AFTER_S = 2.5
WATCHED_AFTER_S = 1.0
"""Duration of a wait before it checks for frozen nodes [s]; most waits end earlier and need no watch."""


def frozen_nodes() -> str:
    """Describes the nodes on this computer that have been stopped for some seconds; empty if there are none.

    Processes of a terminal are excluded, since their user may stop them by Ctrl-Z. The first call only starts the
    watch.
    """
    return _watch().description


@functools.cache
def _watch() -> _Watch:
    return _Watch()


class _Watch:
    """Checks the nodes periodically, in a separate thread since the master may not respond."""

    def __init__(self) -> None:
        self.description = ""
        self._processes: dict[str, psutil.Process | None] = {}
        threading.Thread(target=self._run, daemon=True, name="watch for frozen nodes").start()

    def _run(self) -> None:
        since: dict[str, float] = {}
        list_due_s = 0.0
        while True:
            now_s = time.monotonic()
            if now_s >= list_due_s:
                self._list_nodes()
                list_due_s = now_s + NODES_PERIOD_S
            since = {name: since.get(name, now_s) for name, process in self._processes.items() if _is_stopped(process)}
            self.description = "; ".join(
                f"node '{name}' is frozen: its process {process.pid} was stopped (SIGSTOP); kill -CONT resumes it"
                for name, process in self._processes.items()
                if process is not None and now_s - since.get(name, now_s) >= FROZEN_AFTER_S
            )
            time.sleep(LOOK_PERIOD_S)

    def _list_nodes(self) -> None:
        master = rosgraph.Master("/frozen_nodes")
        try:
            names = {name for kind in master.getSystemState() for _, nodes in kind for name in nodes}
            new = {name: master.lookupNode(name) for name in names if name not in self._processes}
        except (rosgraph.MasterException, OSError):
            return
        running = {
            name: process
            for name, process in self._processes.items()
            if name in names and (not process or process.is_running())
        }
        self._processes = running | (_processes_of(new) if new else {})


def _processes_of(uris: dict[str, str]) -> dict[str, psutil.Process | None]:
    """Returns the process that listens at each address; None on another computer or for another user."""
    sockets = [item for item in psutil.net_connections("tcp") if item.status == psutil.CONN_LISTEN and item.pid]
    owners = {item.laddr.port: item.pid for item in sockets}
    addresses = {name: rosgraph.network.parse_http_host_and_port(uri) for name, uri in uris.items()}
    local = {
        name: owners.get(port) for name, (host, port) in addresses.items() if rosgraph.network.is_local_address(host)
    }
    return {name: psutil.Process(pid) if (pid := local.get(name)) else None for name in uris}


def _is_stopped(process: psutil.Process | None) -> bool:
    try:
        return process is not None and process.status() == psutil.STATUS_STOPPED and process.terminal() is None
    except psutil.Error:
        return False
