# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of the whole task."""

from __future__ import annotations

from modular_framework_benchmark.metrics.measurements import EpisodeMeasurements
from modular_framework_benchmark.records.episode import EpisodeStatus


def success(episode: EpisodeMeasurements) -> float | None:
    """Whether the episode succeeded, checked in the world: 1 or 0.

    An episode whose launch died has no value, because it says nothing about the method.
    """
    if episode.status is EpisodeStatus.BROKEN:
        return None
    return float(episode.status is EpisodeStatus.SUCCEEDED)


def progress(episode: EpisodeMeasurements) -> float | None:
    """Weight of the milestones reached in order, as a fraction of all weights; None without milestones."""
    return None if episode.progress is None else episode.progress.fraction


def task_time(episode: EpisodeMeasurements) -> float | None:
    """Simulated time from the request for grasps to the end of the task [s]; None for an unsuccessful task.

    Computation takes no simulated time if nodes hold it: see `task_wall_time` and `method_processor_time`.
    """
    return episode.task_s if episode.status is EpisodeStatus.SUCCEEDED else None


def task_wall_time(episode: EpisodeMeasurements) -> float | None:
    """Real time from the request for grasps to the end of the task [s]; None for an unsuccessful task."""
    return episode.task_wall_s if episode.status is EpisodeStatus.SUCCEEDED else None


def failed_states(episode: EpisodeMeasurements) -> float | None:
    """Number of failed state executions, including failures from which the task recovered."""
    states = [span for span in episode.states if span.kind == "state"]
    return float(sum(span.failed for span in states)) if states else None
