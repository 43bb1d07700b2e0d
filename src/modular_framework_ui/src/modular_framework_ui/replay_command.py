# SPDX-License-Identifier: BSD-3-Clause
"""Serves the page of a recorded episode; needs no ROS master."""

from __future__ import annotations

import argparse
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from modular_framework_core.task_constructor import machine_graph
from modular_framework_core.task_constructor.machine_graph import GraphError
from modular_framework_simulation.viewer.web_server import AddressError, free_port
from modular_framework_ui.page_server import PageServer
from modular_framework_ui.recorded_episode import read_episode
from modular_framework_ui.recorded_task import ReplayError
from modular_framework_ui.replay import replayed_model

_HOST, _FIRST_PORT = "127.0.0.1", 8090


def main(arguments: Sequence[str], web_folder: Path) -> int:
    """Serves the page until the process is interrupted.

    Args:
        arguments: Command-line arguments.
        web_folder: Folder with the files of the page.

    Returns:
        Exit code 2: the record cannot be replayed, or the page cannot be served.
    """
    parser = argparse.ArgumentParser(prog="page", description="Shows a running task or a record in a browser.")
    parser.add_argument(
        "--replay", required=True, type=Path, metavar="RECORD", help="folder of an episode, or record by run_task"
    )
    parser.add_argument("--port", type=int, default=_FIRST_PORT, help="port; if in use, the next free port")
    chosen = parser.parse_args(arguments)
    try:
        server = replay_server(chosen.replay, web_folder, chosen.port)
        server.start()
    except (ReplayError, AddressError, GraphError, OSError) as error:
        print(f"page: {error}", file=sys.stderr)
        return 2
    print(f"page: open {server.address} in a browser; Ctrl-C ends the replay", flush=True)
    threading.Event().wait()
    return 0


def replay_server(record: Path, web_folder: Path, port: int) -> PageServer:
    """Returns a server of the page of a record.

    Args:
        record: Folder of an episode, or file that `run_task` wrote.
        web_folder: Folder with the files of the page.
        port: Port; if in use, one of the next ports.

    Raises:
        ReplayError: The record cannot be read.
        GraphError: The state machine cannot be drawn.
        AddressError: No port is free.
    """
    model = replayed_model(read_episode(record))
    frame = model.frame()
    if frame is not None:
        model.note_drawing(machine_graph.render(machine_graph.draw(frame).source, "svg").decode())
    return PageServer(web_folder, model.changes_since, _HOST, free_port(_HOST, port))
