# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of the experiment clear_cluttered_table.yaml."""

from __future__ import annotations

from modular_framework_benchmark.metrics.measurements import EpisodeMeasurements
from modular_framework_benchmark.predicates.conditions import Collected

GRASP_STATE = "ExecuteGrasp"
"""Label of the state of machines/pick.yaml that closes the gripper."""
SECONDS_PER_HOUR = 3600.0


def cleared_objects(episode: EpisodeMeasurements) -> float | None:
    """Returns the number of objects in the bin at the check; None without a record of the world."""
    condition = _collected(episode)
    if condition is None or episode.world is None:
        return None
    return float(condition.collected_objects(episode.world)[:, -1].sum())


def objects_per_hour(episode: EpisodeMeasurements) -> float | None:
    """Returns the cleared objects per hour of simulated time; None if the task did not end."""
    cleared = cleared_objects(episode)
    return None if cleared is None or not episode.task_s else cleared * SECONDS_PER_HOUR / episode.task_s


def grasp_attempts(episode: EpisodeMeasurements) -> float | None:
    """Returns how often the gripper closed to grasp an object; None without a record of the states."""
    states = [span.name.rpartition("/")[2] for span in episode.states]
    return float(states.count(GRASP_STATE)) if states else None


def _collected(episode: EpisodeMeasurements) -> Collected | None:
    """Returns the success criterion about the objects in the bin."""
    required = episode.settings.success.required  # type: ignore[attr-defined]  # settings of the mode `task`
    conditions = () if required is None else required.conditions
    return next((item for item in conditions if isinstance(item, Collected)), None)
