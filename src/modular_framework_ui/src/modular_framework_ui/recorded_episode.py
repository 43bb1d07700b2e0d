# SPDX-License-Identifier: BSD-3-Clause
"""Reads the record of an episode: the task, the joints, the milestones and the log, on the clock of the task."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_benchmark.episodes.errors import SceneError
from modular_framework_benchmark.episodes.recorded_scene import RecordedScene
from modular_framework_benchmark.metrics.recording_files import (
    EPISODE,
    TASK_RECORDS,
    TRAJECTORY,
    read_joints,
    read_recording,
    read_tracking,
)
from modular_framework_ui.joint_history import Quantity
from modular_framework_ui.messages import LogLine
from modular_framework_ui.recorded_task import RecordedTask, ReplayError, read_task
from modular_framework_ui.task_state import Mark

_LOG = "log.txt"
_LOG_LINE = re.compile(r"\[ ?(WARN|ERROR|FATAL)\] \[(\d+\.\d+)(?:, \d+\.\d+)?\]: (.*)")
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_SUCCEEDED = "succeeded"


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTrack:
    """Samples of the joints of an episode.

    Attributes:
        joints: Names of the joints.
        times_s: Times since the start of the task, shape (n,) [s].
        values: Values by quantity, shape (n, joints); NaN if unknown.
    """

    joints: tuple[str, ...]
    times_s: NDArray[np.float64]
    values: Mapping[Quantity, NDArray[np.float64]]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedEpisode:
    """Record of an episode, or of a task outside of an experiment.

    Times are in seconds since the start of the task, real or simulated.

    Attributes:
        title: Description of the episode.
        task: Record of the task.
        succeeded: Whether the episode succeeded.
        reason: Reason of a failure; "" without a failure.
        milestones: Milestones; without a time if missed.
        joints: Samples of the joints; None if not recorded.
        log: Warnings and errors of the log.
        omissions: What the record leaves out, as phrases.
        scene: Recorded scene; None if not recorded.
        origin_s: ROS time at the start of the recording [s]; None if not recorded.
    """

    title: str
    task: RecordedTask
    succeeded: bool
    reason: str
    milestones: tuple[Mark, ...] = ()
    joints: JointTrack | None = None
    log: tuple[LogLine, ...] = ()
    omissions: tuple[str, ...] = ()
    scene: RecordedScene | None = None
    origin_s: float | None = None

    def to_recording_time(self, time_s: float) -> float:
        """Converts a time since the start of the task [s] to a time since the start of the recording [s]."""
        return self.task.to_ros_time(time_s) - (self.origin_s or 0.0)


def read_episode(path: Path, *, in_simulated_time: bool = False) -> RecordedEpisode:
    """Returns the record of an episode.

    Args:
        path: Folder of an episode, or file that `run_task` wrote.
        in_simulated_time: Whether times are simulated; otherwise real.

    Raises:
        ReplayError: There is no record of a task, a file of the episode cannot be read, or simulated times are missing.
    """
    try:
        return _read_episode(path, in_simulated_time)
    except ReplayError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ReplayError(
            f"{path}: the files of the episode cannot be read ({type(error).__name__}: {error}); they may be incomplete"
        ) from error


def _read_episode(path: Path, in_simulated_time: bool) -> RecordedEpisode:
    if not path.is_dir():
        task = read_task(path)
        return RecordedEpisode(
            title=f"Record {path.name}",
            task=task,
            succeeded=task.succeeded,
            reason=task.reason,
            omissions=("the world", "the joints", "the log", *_missing_in(task)),
        )
    records = sorted((path / TASK_RECORDS).glob("*.json"))
    if not records:
        raise ReplayError(
            f"{path}: no record of a task in {TASK_RECORDS}; allowed: the folder of an episode in mode task whose "
            "recording was not pruned"
        )
    task = read_task(records[-1])
    log = _read_log(path / _LOG, task.begun)
    if not in_simulated_time:
        return _episode_of(path, task, log)
    simulated_log = tuple(replace(line, time_s=task.to_simulated_time(line.time_s)) for line in log)
    return _episode_of(path, task.in_simulated_time(), simulated_log)


def _episode_of(folder: Path, task: RecordedTask, log: tuple[LogLine, ...]) -> RecordedEpisode:
    summary, origin_s = _read_summary(folder), read_recording(folder).get("origin_s")
    joints = _joints_of(folder, task, origin_s)
    scene = _scene_of(folder, task, origin_s)
    missing = [
        ("the joints", joints is None),
        ("the milestones and the judgement of the episode", not summary),
        ("the log", not (folder / _LOG).is_file()),
    ]
    return RecordedEpisode(
        title=_title(folder, summary),
        task=task,
        succeeded=summary["status"] == _SUCCEEDED if summary else task.succeeded,
        reason=str(summary["cause"]) if summary else task.reason,
        milestones=_milestones(summary, task, origin_s),
        joints=joints,
        log=log,
        omissions=(
            *_missing_in_world(scene),
            *(name for name, is_missing in missing if is_missing),
            *_missing_in(task),
        ),
        scene=scene,
        origin_s=origin_s,
    )


def _scene_of(folder: Path, task: RecordedTask, origin_s: float | None) -> RecordedScene | None:
    """Returns the recorded scene; None if not recorded, or if its times do not fit those of the task."""
    if origin_s is None or not task.has_ros_times:
        return None
    try:
        return RecordedScene(folder)
    except SceneError:
        return None


def _missing_in_world(scene: RecordedScene | None) -> tuple[str, ...]:
    return ("the world",) if scene is None else ("the planning scene", "plans", "camera images", *scene.omissions)


def _missing_in(task: RecordedTask) -> tuple[str, ...]:
    return () if task.machines else ("the state machine",)


def _read_summary(folder: Path) -> dict[str, Any]:
    """Returns the record of the episode as JSON values; empty without the file."""
    path = folder / EPISODE
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else {}


def _title(folder: Path, summary: Mapping[str, Any]) -> str:
    if not summary:
        return f"Episode {folder.name}"
    spec = summary["spec"]
    levels = ", ".join(f"{name} {level}" for name, level in spec["configuration"].items())
    return f"Episode {spec['number']}: {levels}, trial {spec['trial']}"


def _milestones(summary: Mapping[str, Any], task: RecordedTask, origin_s: float | None) -> tuple[Mark, ...]:
    spans = [span for span in summary.get("spans", ()) if span["kind"] == "milestone"]
    return tuple(
        Mark(
            name=str(span["name"]),
            time_s=None
            if span["ended_s"] is None or origin_s is None
            else float(task.from_ros_time(np.array([origin_s + span["ended_s"]]))[0]),
        )
        for span in spans
    )


def _joints_of(folder: Path, task: RecordedTask, origin_s: float | None) -> JointTrack | None:
    """Returns the samples during the task."""
    if origin_s is None or not (folder / TRAJECTORY).is_file():
        return None
    samples = read_joints(folder)
    if samples is None or not samples.joints:
        return None
    errors = np.full(samples.positions.shape, np.nan)
    for tracked in read_tracking(folder):
        for column, joint in enumerate(tracked.joints):
            if joint in samples.joints:
                error = tracked.desired[:, column] - tracked.actual[:, column]
                errors[:, samples.joints.index(joint)] = np.interp(
                    samples.times_s, tracked.times_s, error, left=np.nan, right=np.nan
                )
    times_s = task.from_ros_time(samples.times_s + origin_s)
    kept = (times_s >= 0.0) & (times_s <= task.ended_s)
    values = {
        Quantity.POSITION: samples.positions,
        Quantity.VELOCITY: samples.velocities,
        Quantity.EFFORT: samples.efforts,
        Quantity.ERROR: errors,
    }
    return JointTrack(
        joints=samples.joints, times_s=times_s[kept], values={kind: rows[kept] for kind, rows in values.items()}
    )


def _read_log(path: Path, begun: float) -> tuple[LogLine, ...]:
    """Returns the warnings and errors of a log since the start of the task, without those of a warm-up run.

    Args:
        path: File with the output of the launch.
        begun: Start time of the task [s since 1970].
    """
    if not path.is_file():
        return ()
    found = _LOG_LINE.findall(_COLOURS.sub("", path.read_text(encoding="utf-8", errors="replace")))
    return tuple(
        LogLine(time_s=float(time) - begun, level=level, node="", text=text)
        for level, time, text in found
        if float(time) >= begun
    )
