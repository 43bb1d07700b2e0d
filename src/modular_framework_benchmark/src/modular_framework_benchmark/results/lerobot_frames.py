# SPDX-License-Identifier: BSD-3-Clause
"""Reads the recorded trajectory of an episode as frames for imitation learning: observations and actions.

The trajectory file has a row per sample: `time_s`; `<joint>/position`, `<joint>/velocity`, `<joint>/effort` and
`<joint>/command` for each joint; `<object>/x`, `y`, `z`, `qx`, `qy`, `qz`, `qw` for the pose of each object in the
world.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from numpy.typing import NDArray

from modular_framework_benchmark.results.errors import ExportError

TRAJECTORY_FILE = "trajectory.parquet"
TIME_COLUMN = "time_s"
POSE_PARTS = ("x", "y", "z", "qx", "qy", "qz", "qw")

STATE = "observation.state"
VELOCITY = "observation.velocity"
EFFORT = "observation.effort"
ENVIRONMENT = "observation.environment_state"
ACTION = "action"
_JOINT_FEATURES = {"position": STATE, "velocity": VELOCITY, "effort": EFFORT, "command": ACTION}


@dataclass(frozen=True, slots=True)
class EpisodeFrames:
    """An episode sampled at a constant rate.

    Attributes:
        started_s: Time of the first frame [s since the start of the episode].
        values: Arrays of shape (frames, width), keyed by feature such as `observation.state`.
        names: Names of the columns of each array: joints, or `<object>/x`.
    """

    started_s: float
    values: dict[str, NDArray[np.float32]]
    names: dict[str, tuple[str, ...]]

    @property
    def count(self) -> int:
        """Returns the number of frames."""
        return len(self.values[STATE])


def read_frames(path: Path, frames_per_second: int) -> EpisodeFrames:
    """Returns the frames of a trajectory file, resampled at a constant rate.

    Measured values are interpolated linearly between samples. A command is held until the next command; before the
    first command, the measured position is used.

    Args:
        path: Trajectory file.
        frames_per_second: Frame rate [Hz].

    Raises:
        ExportError: The file is missing, or lacks data for frames; the error names the data.
    """
    columns = _read_columns(path)
    times = columns.pop(TIME_COLUMN)
    if not np.all(np.diff(times) > 0.0) or not np.all(np.isfinite(times)):
        raise ExportError(f"{path}: its times do not increase; allowed: strictly increasing times; record it again")
    count = int(np.floor((times[-1] - times[0]) * frames_per_second + 1e-6)) + 1
    times_s = times[0] + np.arange(count) / frames_per_second
    values: dict[str, list[NDArray[np.float64]]] = {}
    names: dict[str, list[str]] = {}
    for name, samples in columns.items():
        feature, part = _feature_of(name)
        is_known = np.isfinite(samples)
        if not feature or not is_known.any():
            continue
        if feature == ACTION:
            frames = _held_commands(times, samples, columns.get(f"{part}/position"), times_s)
        else:
            frames = np.interp(times_s, times[is_known], samples[is_known])
        values.setdefault(feature, []).append(frames)
        names.setdefault(feature, []).append(part)
    missing = {STATE, ACTION} - set(values)
    if missing:
        raise ExportError(
            f"{path}: has no values for {', '.join(sorted(missing))}; allowed: numeric columns <joint>/position and "
            "<joint>/command, as recorded in the mode task"
        )
    arrays = {name: np.stack(parts, axis=1).astype(np.float32) for name, parts in values.items()}
    return EpisodeFrames(float(times[0]), arrays, {name: tuple(parts) for name, parts in names.items()})


def _read_columns(path: Path) -> dict[str, NDArray[np.float64]]:
    if not path.is_file():
        raise ExportError(f"{path}: there is no such file; the trajectory was not recorded")
    try:
        table = pyarrow.parquet.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise ExportError(f"{path}: not a Parquet file ({error}); record the episode again") from error
    if TIME_COLUMN not in table.column_names or not table.num_rows:
        raise ExportError(f"{path}: has no samples with {TIME_COLUMN}; record the episode again")
    return {name: _numbers(table[name]) for name in table.column_names if pa.types.is_floating(table[name].type)}


def _numbers(column: Any) -> NDArray[np.float64]:
    numbers: NDArray[np.float64] = column.to_numpy().astype(np.float64)  # null becomes NaN
    return numbers


def _feature_of(column: str) -> tuple[str, str]:
    """Returns the feature and the name of a column; ("", "") for a column of no feature."""
    subject, _, part = column.rpartition("/")
    if subject and part in _JOINT_FEATURES:
        return _JOINT_FEATURES[part], subject
    if subject and part in POSE_PARTS:
        return ENVIRONMENT, column
    return "", ""


def _held_commands(
    times: NDArray[np.float64],
    commands: NDArray[np.float64],
    positions: NDArray[np.float64] | None,
    times_s: NDArray[np.float64],
) -> NDArray[np.float64]:
    is_known = np.isfinite(commands)
    first = int(np.argmax(is_known))
    last = np.maximum.accumulate(np.where(is_known, np.arange(len(commands)), 0))
    held = commands[last]
    if positions is not None:
        held[:first] = positions[:first]
    held[:first] = np.where(np.isfinite(held[:first]), held[:first], commands[first])
    return held[np.clip(np.searchsorted(times, times_s + 1e-9, side="right") - 1, 0, len(times) - 1)]
