# SPDX-License-Identifier: BSD-3-Clause
"""Exports the recorded episodes of an experiment as a LeRobot dataset."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from modular_framework_benchmark.metrics.recording_files import read_descriptions
from modular_framework_benchmark.records.episode import EpisodeRecord
from modular_framework_benchmark.results.database import ResultDatabase
from modular_framework_benchmark.results.errors import ExportError
from modular_framework_benchmark.results.lerobot_dataset import LeRobotWriter
from modular_framework_benchmark.results.lerobot_frames import TRAJECTORY_FILE, read_frames
from modular_framework_benchmark.results.lerobot_videos import find_videos
from modular_framework_urdf import xml_text

DEFAULT_RATE = 30
UNITS = {"revolute": "rad", "continuous": "rad", "prismatic": "m"}
"""Unit of a position, by type of joint."""


@dataclass(frozen=True, slots=True)
class LeRobotSummary:
    """Summary of an export.

    Attributes:
        episodes: Number of episodes in the dataset.
        frames: Number of frames in the dataset.
        skipped: Reasons of omitted episodes, keyed by episode number.
    """

    episodes: int
    frames: int
    skipped: dict[int, str]


def export_lerobot(
    database: ResultDatabase,
    number: int,
    folder: Path,
    *,
    frames_per_second: int = DEFAULT_RATE,
    chosen: Callable[[EpisodeRecord], bool] = lambda record: True,
) -> LeRobotSummary:
    """Writes the episodes with a recorded trajectory as a LeRobot dataset.

    Args:
        database: Database, whose folder contains the episodes' files.
        number: Identifier of the experiment.
        folder: Folder of the new dataset; missing or empty.
        frames_per_second: Frame rate of the dataset [Hz].
        chosen: Predicate that selects episodes.

    Returns:
        Summary of the dataset with the omitted episodes.

    Raises:
        ExportError: The folder is not empty, the rate is not positive, or no episode can be exported.
    """
    if frames_per_second < 1:
        raise ExportError(f"{frames_per_second} frames a second; allowed: whole numbers from 1")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ExportError(f"{folder}: already exists; remove it, or name another folder")
    skipped: dict[int, str] = {}
    writer: LeRobotWriter | None = None
    try:
        for episode in database.load(number, spans=False).episodes["number"]:
            record = database.record(number, int(episode))
            if not chosen(record):
                continue
            if writer is None:
                writer = LeRobotWriter(
                    folder, frames_per_second, robot_of(database, record), joint_units(database, record)
                )
            try:
                _add_episode(writer, database, record, frames_per_second)
            except ExportError as error:
                skipped[record.spec.number] = str(error)
    except OSError as error:
        raise ExportError(f"{folder}: the export stopped ({error}); free space, or name another folder") from error
    finally:
        if writer is not None:
            writer.close()
    if writer is None or not writer.episodes:
        reason = next(iter(skipped.values()), "no finished episode of the experiment was selected")
        raise ExportError(f"{database.label}: no episode can be exported ({len(skipped)} skipped; first: {reason})")
    return LeRobotSummary(writer.episodes, writer.frames, skipped)


def _add_episode(
    writer: LeRobotWriter, database: ResultDatabase, record: EpisodeRecord, frames_per_second: int
) -> None:
    if not record.folder:
        raise ExportError("its files were not recorded; run it with recording")
    folder = database.folder / record.folder
    frames = read_frames(folder / TRAJECTORY_FILE, frames_per_second)
    writer.add(frames, find_videos(folder), task_of(record), succeeded=record.succeeded)


def robot_of(database: ResultDatabase, record: EpisodeRecord) -> str:
    """Returns the robot name from the recorded description of an episode, or `unknown`."""
    urdf, _ = read_descriptions(database.folder / record.folder)
    return (urdf and xml_text.parse(urdf, "the recorded robot description").get("name")) or "unknown"


def joint_units(database: ResultDatabase, record: EpisodeRecord) -> dict[str, str]:
    """Returns the unit of each joint in the recorded description of an episode, rad or m."""
    urdf, _ = read_descriptions(database.folder / record.folder)
    joints = xml_text.parse(urdf, "the recorded robot description").iter("joint") if urdf else ()
    return {joint.get("name", ""): UNITS[kind] for joint in joints if (kind := joint.get("type", "")) in UNITS}


def task_of(record: EpisodeRecord) -> str:
    """Returns the task of an episode from its snapshot, or the levels of its factors."""
    task = record.snapshot.get("task")
    if isinstance(task, str) and task:
        return task
    return ", ".join(f"{name} {level}" for name, level in sorted(record.spec.configuration.items()))
