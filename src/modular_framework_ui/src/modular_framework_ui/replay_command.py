# SPDX-License-Identifier: BSD-3-Clause
"""Serves the page of a record or of an experiment, or writes a clip of an episode; needs no ROS master."""

from __future__ import annotations

import argparse
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import urlencode

from modular_framework_simulation.viewer.web_server import AddressError, free_port
from modular_framework_ui.page_server import PageServer
from modular_framework_ui.page_source import PageSource
from modular_framework_ui.recorded_episode import RecordedEpisode, read_episode
from modular_framework_ui.recorded_run import read_run
from modular_framework_ui.recorded_task import ReplayError
from modular_framework_ui.replayed_episode import EpisodeSource, ReplayedEpisode
from modular_framework_ui.replayed_run import ReplayedRun

HOST, _FIRST_PORT = "127.0.0.1", 8090
_TASK_SUFFIX = ".json"
"""Suffix of a record by `run_task`."""


def main(arguments: Sequence[str], web_folder: Path) -> int:
    """Serves the page until the process is interrupted, or writes a clip.

    Args:
        arguments: Command-line arguments.
        web_folder: Folder with the files of the page.

    Returns:
        Exit code: 0 after a clip, 2 if the record cannot be replayed, the page served or the clip written.
    """
    chosen = _parser().parse_args(arguments)
    query = _query(chosen)
    try:
        if chosen.clip is not None:
            from modular_framework_ui.clip import write_clip  # its renderer is imported only for a clip

            write_clip(recorded_episode(chosen.replay, chosen.experiment, chosen.episode), chosen.clip, chosen.moment)
            print(f"page: {chosen.clip} is written")
            return 0
        if chosen.moment is not None:
            raise ReplayError("--moment is the time of a picture; add --clip FILE.png")
        source = replay_source(chosen.replay, chosen.experiment, query)
        server = PageServer(web_folder, source, HOST, free_port(HOST, chosen.port))
        server.start()
    except (ReplayError, AddressError, OSError) as error:
        print(f"page: {error}", file=sys.stderr)
        return 2
    address = f"{server.address}?{urlencode(query, safe=',')}" if query else server.address
    print(f"page: open {address} in a browser; Ctrl-C ends the replay", flush=True)
    threading.Event().wait()
    return 0


def replay_source(record: str, experiment: str | None = None, query: Mapping[str, str] | None = None) -> PageSource:
    """Returns the contents of the page of a record.

    Args:
        record: Folder of an episode, file that `run_task` wrote, or result database.
        experiment: Name of the experiment of a database; None for its only experiment.
        query: Query of the address to open, which is checked.

    Raises:
        ReplayError: The record cannot be read, or the query does not fit the record.
    """
    if _is_single(record):
        if query or experiment:
            raise ReplayError(f"{record}: is a single episode; allowed with the other options: a result database")
        return EpisodeSource(ReplayedEpisode(read_episode(Path(record)), HOST))
    source = ReplayedRun(read_run(record, experiment), HOST)
    source.table(query or {})
    return source


def recorded_episode(record: str, experiment: str | None, number: int | None) -> RecordedEpisode:
    """Returns the record of an episode.

    Args:
        record: Folder of an episode, file that `run_task` wrote, or result database.
        experiment: Name of the experiment of a database; None for its only experiment.
        number: Number of the episode in a database; None for a single record.

    Raises:
        ReplayError: The record cannot be read, or the number does not fit the record.
    """
    if _is_single(record):
        if number is not None or experiment is not None:
            raise ReplayError(f"{record}: is a single episode; allowed with the other options: a result database")
        return read_episode(Path(record))
    if number is None:
        raise ReplayError(f"{record}: a clip shows an episode of the database; add --episode N")
    folder = read_run(record, experiment).replayable(number).folder
    assert folder is not None
    return read_episode(folder)


def _is_single(record: str) -> bool:
    """Returns whether a record is that of a single episode or task."""
    return Path(record).is_dir() or record.endswith(_TASK_SUFFIX)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="page", description="Shows a running task or a record in a browser.")
    parser.add_argument(
        "--replay", required=True, metavar="RECORD", help="folder of an episode, record by run_task, or result database"
    )
    parser.add_argument("--port", type=int, default=_FIRST_PORT, help="port; if in use, the next free port")
    parser.add_argument("--experiment", metavar="NAME", help="experiment of the database; default: its only experiment")
    parser.add_argument("--clip", type=Path, metavar="FILE", help="write a video (.mp4) or picture (.png) of the world")
    parser.add_argument("--moment", type=float, metavar="S", help="time of the picture in the task; default: its end")
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--episode", type=int, metavar="N", help="open this episode of the database")
    shown.add_argument("--pair", type=int, nargs=2, metavar="N", help="open these episodes side by side")
    shown.add_argument("--failure-class", metavar="CLASS", help="list only the episodes of this failure class")
    return parser


def _query(chosen: argparse.Namespace) -> dict[str, str]:
    """Returns the query of the address to open."""
    if chosen.episode is not None:
        return {"episode": str(chosen.episode)}
    if chosen.pair is not None:
        return {"pair": ",".join(map(str, chosen.pair))}
    return {} if chosen.failure_class is None else {"failure_class": chosen.failure_class}
