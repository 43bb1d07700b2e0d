# SPDX-License-Identifier: BSD-3-Clause
"""Reads the finished episodes of an experiment from a result database, and compares two of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modular_framework_benchmark.metrics.recording_files import TASK_RECORDS
from modular_framework_benchmark.records.results import FAILURE_CLASS, ExperimentResults
from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.reports.report_source import open_experiment
from modular_framework_benchmark.results.errors import ResultsError
from modular_framework_benchmark.statistics.observations import other_factors
from modular_framework_ui.recorded_task import ReplayError

_PROGRESS, _TASK_TIME = "progress", "task_time"
_UNKNOWN = "–"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEpisode:
    """A finished episode of an experiment.

    Attributes:
        number: Number of the episode.
        method: Level of the compared factor.
        levels: Levels of the other factors as text.
        trial: Number of the scene and seed.
        status: Final status in words.
        failure_class: Class of the failure; "" for a success or without classes.
        reason: Cause of the failure; "" for a success.
        progress: Weighted fraction of the reached milestones; None without milestones.
        task_time_s: Simulated duration of the task [s]; None without a value.
        folder: Folder of the files; None without a record of the task.
        partners: Numbers of the episodes of other methods with the same trial and the same other levels.
    """

    number: int
    method: str
    levels: str
    trial: int
    status: str
    failure_class: str
    reason: str
    progress: float | None
    task_time_s: float | None
    folder: Path | None
    partners: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """A row of the comparison of two episodes.

    Attributes:
        name: Name of the compared value.
        first: Value of the first episode as text.
        second: Value of the second episode as text.
        difference: Second minus first value; for texts "equal" or "different"; "–" if a value is missing.
    """

    name: str
    first: str
    second: str
    difference: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedRun:
    """The finished episodes of an experiment.

    Attributes:
        title: Name of the experiment.
        compared: Name of the compared factor.
        planned: Total number of episodes, finished or not.
        episodes: Finished episodes, keyed by number.
    """

    title: str
    compared: str
    planned: int
    episodes: Mapping[int, RunEpisode]

    def replayable(self, number: int) -> RunEpisode:
        """Returns an episode with a record of its task.

        Raises:
            ReplayError: The episode is not finished, or has no record of its task.
        """
        found = self.episodes.get(number)
        if found is None:
            numbers = f"{min(self.episodes)} to {max(self.episodes)}" if self.episodes else "none"
            raise ReplayError(f"{self.title}: episode {number} is not among the finished episodes; allowed: {numbers}")
        if found.folder is None:
            raise ReplayError(
                f"{self.title}: episode {number} has no record of its task; allowed: episodes of mode task whose "
                "files were not pruned"
            )
        return found


def read_run(target: str, experiment: str | None) -> RecordedRun:
    """Returns the finished episodes of an experiment.

    Args:
        target: Path of a SQLite file, or SQLAlchemy URL.
        experiment: Name of the experiment; None for the only experiment of the database.

    Raises:
        ReplayError: The database cannot be read, or lacks the experiment.
    """
    try:
        with open_experiment(target, experiment) as opened:
            return run_of(opened.results, opened.database.folder)
    except (ReportError, ResultsError) as error:
        raise ReplayError(str(error)) from error


def run_of(results: ExperimentResults, database_folder: Path) -> RecordedRun:
    """Returns the episodes of the results of an experiment.

    Args:
        results: Finished episodes.
        database_folder: Base of the folders of the episodes.
    """
    description = results.description
    others = [factor.name for factor in other_factors(results)]
    rows: list[dict[Any, Any]] = results.episodes.to_dict("records")
    methods_of_scenes: dict[tuple[str, ...], dict[int, str]] = {}
    for row in rows:
        methods_of_scenes.setdefault(_scene_of(row, others), {})[int(row["number"])] = str(row[description.compared])
    root = database_folder.resolve()
    episodes = {}
    for row in rows:
        number, method = int(row["number"]), str(row[description.compared])
        same_scene = methods_of_scenes[_scene_of(row, others)]
        episodes[number] = RunEpisode(
            number=number,
            method=method,
            levels=", ".join(f"{name} {row[name]}" for name in others),
            trial=int(row["trial"]),
            status=str(row["status"]).replace("_", " "),
            failure_class=str(row.get(FAILURE_CLASS) or ""),
            reason=str(row["cause"] or ""),
            progress=_number(row.get(_PROGRESS)),
            task_time_s=_number(row.get(_TASK_TIME)),
            folder=_folder(root, str(row["folder"] or "")),
            partners=tuple(other for other, its_method in same_scene.items() if its_method != method),
        )
    return RecordedRun(
        title=description.name, compared=description.compared, planned=results.planned, episodes=episodes
    )


def differences(first: RunEpisode, second: RunEpisode) -> tuple[Difference, ...]:
    """Returns the comparison of two episodes, a row per value."""
    return (
        _text_row("outcome", first.status, second.status),
        _number_row("progress", _times_100(first.progress), _times_100(second.progress), "%"),
        _number_row("task time, simulated", first.task_time_s, second.task_time_s, "s"),
        _text_row("failure class", first.failure_class, second.failure_class),
        _text_row("reason", first.reason, second.reason),
    )


def _text_row(name: str, first: str, second: str) -> Difference:
    return Difference(
        name=name,
        first=first or _UNKNOWN,
        second=second or _UNKNOWN,
        difference="equal" if first == second else "different",
    )


def _number_row(name: str, first: float | None, second: float | None, unit: str) -> Difference:
    texts = [_UNKNOWN if value is None else f"{value:.1f} {unit}" for value in (first, second)]
    difference = _UNKNOWN if first is None or second is None else f"{second - first:+.1f} {unit}"
    return Difference(name=name, first=texts[0], second=texts[1], difference=difference)


def _times_100(fraction: float | None) -> float | None:
    return None if fraction is None else 100.0 * fraction


def _scene_of(row: Mapping[Any, Any], others: list[str]) -> tuple[str, ...]:
    """Returns what the episodes of a pair share: trial, and levels of the factors other than the compared factor."""
    return (str(row["trial"]), *(str(row[name]) for name in others))


def _number(value: Any) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _folder(root: Path, name: str) -> Path | None:
    """Returns the folder of an episode; None without a record of a task, or outside of the folder of the database."""
    path = (root / name).resolve()
    return path if name and path.is_relative_to(root) and (path / TASK_RECORDS).is_dir() else None
