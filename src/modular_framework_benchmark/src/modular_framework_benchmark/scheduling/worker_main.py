# SPDX-License-Identifier: BSD-3-Clause
"""Program of a worker process: `python -m modular_framework_benchmark.scheduling.worker_main CONNECTION LIFELINE`.

The process creates its runner and then runs the episodes that arrive through the connection. When its parent process
has ended, it kills its descendants and itself.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shutil
import sys
import threading
import time
import traceback
from multiprocessing.connection import Connection
from pathlib import Path

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.scheduling.earlier_tries import EARLIER_TRIES, begin_try
from modular_framework_benchmark.scheduling.episode_runner import EpisodeRunner, RunnerFactory, unrun_record
from modular_framework_benchmark.scheduling.marked_processes import MARK, end_marked_processes

EXIT_NO_RUNNER = 3


def main(arguments: list[str]) -> int:
    """Runs episodes until the parent requests the end."""
    connection = Connection(int(arguments[0]))
    threading.Thread(target=_end_with_parent, args=(int(arguments[1]),), daemon=True).start()
    try:
        # Appended, because catkin packages prepend their sources, which lack generated messages.
        sys.path += [path for path in connection.recv() if path not in sys.path]
        make_runner: RunnerFactory = connection.recv()
        runner = make_runner()
        import modular_framework_benchmark.experiments.modes  # noqa: F401  # episodes need it, and its import takes time
    except EOFError:
        return 0
    except Exception:  # any error of the mode's code is reported to the parent
        connection.send(traceback.format_exc())
        return EXIT_NO_RUNNER
    connection.send(None)
    try:
        _serve(connection, runner, make_runner)
    except (EOFError, BrokenPipeError):
        _end_with_children()
    return 0


def _serve(connection: Connection, runner: EpisodeRunner, make_runner: RunnerFactory) -> None:
    while (request := connection.recv()) is not None:
        spec, folder = request
        record, usable = run_episode(runner, spec, folder)
        connection.send(record)
        if not usable:
            runner = make_runner()
    runner.close()


def run_episode(runner: EpisodeRunner, spec: EpisodeSpec, folder: Path) -> tuple[EpisodeRecord, bool]:
    """Runs an episode in an empty folder.

    Args:
        runner: Runner of the worker.
        spec: Specification of the episode.
        folder: Folder of the episode's files.

    Returns:
        The record, and whether the runner is reusable, which it is not after an exception.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    earlier = begin_try(folder)
    print(f"---- episode {spec.number}: {spec.key}", flush=True)
    begun, start = time.time(), time.monotonic()
    try:
        record = runner.run(spec, folder)
        if earlier:
            record = dataclasses.replace(record, snapshot={**record.snapshot, EARLIER_TRIES: earlier})
        return record, True
    except Exception as error:  # errors in mode or user code must not stop other episodes
        traceback.print_exc()
        with contextlib.suppress(Exception):
            runner.close()
        cause = f"the runner raised {type(error).__name__}: {error}"
        return unrun_record(spec, EpisodeStatus.BROKEN, cause, begun=begun, wall_s=time.monotonic() - start), False


def _end_with_parent(lifeline: int) -> None:
    """Waits until the other end of a pipe is closed by the parent or by its death."""
    while os.read(lifeline, 1):
        pass
    _end_with_children()


def _end_with_children() -> None:
    with contextlib.suppress(TimeoutError):
        end_marked_processes(os.environ[MARK])
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
