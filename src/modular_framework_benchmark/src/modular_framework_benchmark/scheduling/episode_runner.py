# SPDX-License-Identifier: BSD-3-Clause
"""What a mode provides to the workers: something that runs one episode after the other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus


class EpisodeRunner(Protocol):
    """Runs episodes in one worker process, in its main thread."""

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        """Runs an episode, within its time limit.

        Args:
            spec: What to run.
            folder: Where its files go; is there, and empty.

        Returns:
            What it gave; a launch that dies is a record with status BROKEN, not an exception.
        """

    def close(self) -> None:
        """Ends what it keeps running between episodes; may be called twice."""


RunnerFactory = Callable[[], EpisodeRunner]
"""Makes the runner of a worker. It is pickled: a class, or a function of a module."""


def unrun_record(
    spec: EpisodeSpec, status: EpisodeStatus, cause: str, begun: float, wall_s: float, worker: str = ""
) -> EpisodeRecord:
    """Returns the record of an episode whose runner gave none.

    Args:
        spec: The episode.
        status: How it ended.
        cause: Why.
        begun: When it started [s since 1970].
        wall_s: How long it took [s].
        worker: Who ran it.
    """
    names = [str(one if isinstance(one, str) else one["name"]) for one in spec.settings.get("metrics", ())]
    return EpisodeRecord(
        spec, status, "", cause, begun, wall_s, None, metrics={name: None for name in names}, worker=worker
    )
