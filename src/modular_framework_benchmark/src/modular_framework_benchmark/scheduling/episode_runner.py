# SPDX-License-Identifier: BSD-3-Clause
"""Interface between modes and workers: a runner runs one episode after another."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus


class EpisodeRunner(Protocol):
    """Runs episodes in the main thread of a worker process."""

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        """Runs an episode within its time limit.

        Args:
            spec: Specification of the episode.
            folder: Existing empty folder for the episode's files.

        Returns:
            Record of the episode; a launch that dies gives status BROKEN instead of an exception.
        """

    def close(self) -> None:
        """Ends processes that are kept between episodes; repeated calls are allowed."""


RunnerFactory = Callable[[], EpisodeRunner]
"""Factory of a worker's runner. It must be picklable: a class, or a function of a module."""


def unrun_record(
    spec: EpisodeSpec, status: EpisodeStatus, cause: str, *, begun: float, wall_s: float, worker: str = ""
) -> EpisodeRecord:
    """Returns the record of an episode without a record from its runner.

    Args:
        spec: Specification of the episode.
        status: Final status.
        cause: Cause of the failure.
        begun: Start time [s since 1970].
        wall_s: Real duration [s].
        worker: Name of the worker.
    """
    metrics = dict.fromkeys(spec.settings.metric_names)
    return EpisodeRecord(
        spec,
        status,
        outcome="",
        cause=cause,
        begun=begun,
        wall_s=wall_s,
        simulated_s=None,
        metrics=metrics,
        worker=worker,
    )
