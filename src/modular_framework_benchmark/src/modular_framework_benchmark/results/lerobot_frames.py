# SPDX-License-Identifier: BSD-3-Clause
"""Reads the recorded trajectory of an episode as frames of a learner: what was observed and what was commanded.

The trajectory file has a row a sample: `time_s`, and `<joint>/position`, `<joint>/velocity`, `<joint>/effort` and
`<joint>/command` for each joint, and `<object>/x`, `y`, `z`, `qx`, `qy`, `qz`, `qw` for the pose of an object in the
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
    """An episode at a constant rate.

    Attributes:
        started_s: Time of the first frame [s since the episode began].
        values: Arrays of shape (frames, width) by the feature's name, such as `observation.state`.
        names: What the columns of each array are: joints, or `<object>/x`.
    """

    started_s: float
    values: dict[str, NDArray[np.float32]]
    names: dict[str, tuple[str, ...]]

    @property
    def count(self) -> int:
        """Returns the number of frames."""
        return len(self.values[STATE])


def read_frames(path: Path, frames_per_second: int) -> EpisodeFrames:
    """Reads a trajectory file at a constant rate.

    Measured values are interpolated linearly between samples; a command holds until the next one, and before the first
    command it is the measured position.

    Args:
        path: The trajectory file.
        frames_per_second: Rate of the frames.

    Raises:
        ExportError: There is no such file, or it lacks what frames need; says what.
    """
    columns = _read_columns(path)
    times = columns.pop(TIME_COLUMN)
    if not np.all(np.diff(times) > 0.0) or not np.all(np.isfinite(times)):
        raise ExportError(
            f"{path}: its times do not increase; allowed: each later than the one before; record it again"
        )
    count = int(np.floor((times[-1] - times[0]) * frames_per_second + 1e-6)) + 1
    moments = times[0] + np.arange(count) / frames_per_second
    values: dict[str, list[NDArray[np.float64]]] = {}
    names: dict[str, list[str]] = {}
    for name, samples in columns.items():
        feature, part = _feature_of(name)
        known = np.isfinite(samples)
        if not feature or not known.any():
            continue
        if feature == ACTION:
            frames = _held(times, samples, columns.get(f"{part}/position"), moments)
        else:
            frames = np.interp(moments, times[known], samples[known])
        values.setdefault(feature, []).append(frames)
        names.setdefault(feature, []).append(part)
    missing = {STATE, ACTION} - set(values)
    if missing:
        raise ExportError(
            f"{path}: has no values for {', '.join(sorted(missing))}; allowed: columns <joint>/position and "
            "<joint>/command with numbers, as episodes of the mode task record them"
        )
    arrays = {name: np.stack(parts, axis=1).astype(np.float32) for name, parts in values.items()}
    return EpisodeFrames(float(times[0]), arrays, {name: tuple(parts) for name, parts in names.items()})


def _read_columns(path: Path) -> dict[str, NDArray[np.float64]]:
    if not path.is_file():
        raise ExportError(f"{path}: there is no such file; the episode was run without recording its trajectory")
    try:
        table = pyarrow.parquet.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise ExportError(f"{path}: no Parquet file ({error}); record the episode again") from error
    if TIME_COLUMN not in table.column_names or not table.num_rows:
        raise ExportError(f"{path}: has no samples with {TIME_COLUMN}; record the episode again")
    return {name: _numbers(table[name]) for name in table.column_names if pa.types.is_floating(table[name].type)}


def _numbers(column: Any) -> NDArray[np.float64]:
    numbers: NDArray[np.float64] = column.to_numpy().astype(np.float64)  # null becomes NaN
    return numbers


def _feature_of(column: str) -> tuple[str, str]:
    """Returns the feature that a column belongs to and its name there; ("", "") for a column of neither kind."""
    subject, _, part = column.rpartition("/")
    if subject and part in _JOINT_FEATURES:
        return _JOINT_FEATURES[part], subject
    if subject and part in POSE_PARTS:
        return ENVIRONMENT, column
    return "", ""


def _held(
    times: NDArray[np.float64],
    commands: NDArray[np.float64],
    positions: NDArray[np.float64] | None,
    moments: NDArray[np.float64],
) -> NDArray[np.float64]:
    known = np.isfinite(commands)
    first = int(np.argmax(known))
    last = np.maximum.accumulate(np.where(known, np.arange(len(commands)), 0))
    held = commands[last]
    if positions is not None:
        held[:first] = positions[:first]
    held[:first] = np.where(np.isfinite(held[:first]), held[:first], commands[first])
    return held[np.clip(np.searchsorted(times, moments + 1e-9, side="right") - 1, 0, len(times) - 1)]
