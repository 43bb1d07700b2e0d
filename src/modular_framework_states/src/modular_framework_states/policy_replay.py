# SPDX-License-Identifier: BSD-3-Clause
"""Plays the actions of an episode of a LeRobot dataset (v3.0) in place of a policy."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet

from mbf_method.errors import InvalidOutputError, MethodStartError
from mbf_method.method_client import CallTimes, MethodResult, MethodSource
from mbf_method.observation import ActionSpec
from modular_framework_states.policy_gripper import PolicyGripper
from modular_framework_states.policy_settings import RecordedEpisode

Array = npt.NDArray[np.float64]

ACTION = "action"
FORMAT = "v3."
"""Start of the format versions that can be read."""
MAX_ANGLE_RAD = 2.01 * math.pi
"""Angle above which values without a stated unit are degrees."""


@dataclass(frozen=True, slots=True)
class EpisodeActions:
    """Actions of an episode.

    Attributes:
        names: Names of the columns.
        units: Unit of each column; empty if the dataset states none.
        rate_hz: Number of actions per second.
        values: Actions, shape (n, a).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    rate_hz: float
    values: Array

    @property
    def digest(self) -> str:
        """SHA-256 of the actions and their names."""
        return hashlib.sha256(f"{self.names} {self.units} {self.rate_hz}".encode() + self.values.tobytes()).hexdigest()


def read_actions(episode: RecordedEpisode) -> EpisodeActions:
    """Reads the actions of an episode.

    Raises:
        MethodStartError: The folder is not a dataset of this format, or has no such episode.
    """
    folder = episode.folder
    try:
        info = json.loads((folder / "meta" / "info.json").read_text())
        if not str(info["codebase_version"]).startswith(FORMAT):
            raise MethodStartError(
                f"dataset {folder}: its format is {info['codebase_version']}; required: v3.0; convert it with LeRobot"
            )
        rows = [row for file in sorted(folder.glob("meta/episodes/*/*.parquet")) for row in _rows(file)]
        row = next((row for row in rows if row["episode_index"] == episode.number), None)
        if row is None:
            raise MethodStartError(
                f"dataset {folder} has no episode {episode.number}; its episodes are 0 to {len(rows) - 1}"
            )
        feature = info["features"][ACTION]
        return EpisodeActions(
            tuple(map(str, feature["names"])),
            tuple(map(str, feature.get("info", {}).get("units", ()))),
            float(info["fps"]),
            _actions(folder / _data_path(info, row), episode.number, int(row["length"])),
        )
    except (OSError, LookupError, TypeError, ValueError, pa.ArrowException) as error:
        raise MethodStartError(
            f"dataset {folder} cannot be read: {type(error).__name__}: {error}; name the folder of a LeRobot dataset "
            "of format v3.0, with meta/info.json"
        ) from error


def _rows(file: Path) -> list[dict[str, Any]]:
    columns = ["episode_index", "length", "data/chunk_index", "data/file_index"]
    return list(pyarrow.parquet.read_table(file, columns=columns).to_pylist())


def _data_path(info: Mapping[str, Any], row: Mapping[str, Any]) -> str:
    indices = {"chunk_index": row["data/chunk_index"], "file_index": row["data/file_index"]}
    return str(info["data_path"]).format(**indices)


def _actions(file: Path, number: int, count: int) -> Array:
    filters = [("episode_index", "==", number)]
    table = pyarrow.parquet.read_table(file, columns=[ACTION, "frame_index"], filters=filters)
    values = np.array(table.sort_by("frame_index")[ACTION].to_pylist(), dtype=np.float64)
    if len(values) != count or not count:
        raise ValueError(f"{file} has {len(values)} frames of episode {number}, meta/episodes says {count}")
    return values.reshape(count, -1)


class RecordedPolicy:
    """Plays a recorded episode; has the methods of `MethodClient` that a run of a policy calls.

    Attributes:
        source: Name of the dataset's folder with the number of the episode, as an address.
        sources: SHA-256 of the actions; known after `start`.
        said_name: Always "".
        said_version: Always "".

    Args:
        episode: Recorded episode.
        units: Unit of each joint of the robot, rad or m.
        gripper: Gripper of the last column; None without a gripper.
    """

    def __init__(self, episode: RecordedEpisode, units: Mapping[str, str], gripper: PolicyGripper | None) -> None:
        self._episode, self._units, self._gripper = episode, units, gripper
        self._actions: EpisodeActions | None = None
        self._targets: Array | None = None
        self.source = MethodSource(address=f"episode {episode.number} of dataset {episode.folder.name}")
        self.sources = self.said_name = self.said_version = ""

    def start(self) -> None:
        """Reads the episode.

        Raises:
            MethodStartError: The episode cannot be read.
        """
        self._actions = read_actions(self._episode)
        self.sources = self._actions.digest

    def call(
        self, request: Any, limit_s: float | None = None, is_cancelled: Callable[[], bool] | None = None
    ) -> MethodResult:
        """Returns the next chunk of the episode; the last action is repeated in the last chunk.

        Args:
            request: `Observation` with the number of executed actions.
            limit_s: Without effect.
            is_cancelled: Without effect.

        Raises:
            InvalidOutputError: Names, units or the rate of the dataset do not match the robot and the task.
        """
        if self._targets is None:
            self._targets = self._matching_targets(request.actions)
        horizon = request.actions.horizon
        chunk = self._targets[request.step : request.step + horizon]
        if len(chunk):
            chunk = np.vstack([chunk, np.repeat(chunk[-1:], horizon - len(chunk), axis=0)])
        return MethodResult({"actions": chunk}, CallTimes(0.0, 0.0, 0.0, 0.0))

    def _matching_targets(self, spec: ActionSpec) -> Array:
        """Returns the actions in the columns of the task, shape (n, a)."""
        assert self._actions is not None
        actions = self._actions
        grip = None if self._gripper is None else self._gripper.observed_joint
        required = [*spec.joint_names, *([] if grip is None else [grip])]
        faults = []
        if missing := [name for name in required if name not in actions.names]:
            faults.append(f"its actions are {', '.join(actions.names)}; the task needs {', '.join(missing)}")
        faults += [fault for name in required if name not in missing and (fault := self._unit_fault(actions, name))]
        if not math.isclose(actions.rate_hz, spec.rate_hz):
            faults.append(f"it has {actions.rate_hz:g} actions per second, the task {spec.rate_hz:g}; set rate")
        if faults:
            raise InvalidOutputError(f"{self.source.address} does not match: {'; '.join(faults)}")
        columns = [actions.values[:, actions.names.index(name)] for name in required]
        if self._gripper is not None:
            columns[-1] = np.array([self._gripper.fraction_at(float(position)) for position in columns[-1]])
        return np.column_stack(columns)

    def _unit_fault(self, actions: EpisodeActions, name: str) -> str:
        """Returns why the unit of a column does not match; "" if it matches."""
        index, required = actions.names.index(name), self._units.get(name, "rad")
        if actions.units:
            stated = actions.units[index]
            return "" if stated == required else f"{name} is in {stated}; it must be in {required}"
        greatest = float(np.abs(actions.values[:, index]).max())
        if required == "rad" and greatest > MAX_ANGLE_RAD:
            return f"{name} reaches {greatest:.4g} and has no unit; it must be in rad, and seems to be in degrees"
        return ""
