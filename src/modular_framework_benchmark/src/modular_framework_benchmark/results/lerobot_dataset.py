# SPDX-License-Identifier: BSD-3-Clause
"""Writes a dataset in the layout of LeRobotDataset v3.0 for imitation learning.

Layout: `meta/info.json` (features, rate, path patterns), `meta/stats.json`, `meta/tasks.parquet`, `meta/episodes/` (a
row per episode: length, tasks, locations of frames and videos), `data/` (a row per frame, many episodes per file) and
`videos/`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet
from numpy.typing import NDArray

from modular_framework_benchmark.results.errors import ExportError
from modular_framework_benchmark.results.lerobot_frames import ACTION, STATE, EpisodeFrames
from modular_framework_benchmark.results.lerobot_statistics import (
    FeatureStatistics,
    as_lists,
    feature_statistics,
    image_statistics,
    joined_statistics,
)
from modular_framework_benchmark.results.lerobot_videos import (
    CODEC,
    FILES_PER_CHUNK,
    MAX_FILE_MB,
    VIDEO_PATH,
    CameraVideos,
)

FORMAT_VERSION = "v3.0"
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
MAX_DATA_FILE_MB = 100
IMAGES = "observation.images."
NO_UNITS: Mapping[str, str] = MappingProxyType({})
_SCALARS: dict[str, Any] = {
    "next.done": pa.bool_(),
    "next.success": pa.bool_(),
    "timestamp": pa.float32(),
    "frame_index": pa.int64(),
    "episode_index": pa.int64(),
    "index": pa.int64(),
    "task_index": pa.int64(),
}


class LeRobotWriter:
    """Writes episodes one after another; `close` writes the metadata."""

    def __init__(
        self, root: Path, frames_per_second: int, robot_type: str, units: Mapping[str, str] = NO_UNITS
    ) -> None:
        """Stores the arguments; the first episode determines the features.

        Args:
            root: Folder of the dataset.
            frames_per_second: Frame rate [Hz].
            robot_type: Robot name in the metadata.
            units: Unit of each joint, rad or m; joints without a unit have none in the metadata.
        """
        self._root = root
        self._rate = frames_per_second
        self._robot_type = robot_type
        self._units = units
        self._names: dict[str, tuple[str, ...]] = {}
        self._cameras: dict[str, CameraVideos] = {}
        self._tasks: dict[str, int] = {}
        self._episodes: list[dict[str, Any]] = []
        self._statistics: dict[str, list[FeatureStatistics]] = {}
        self._frames = 0
        self._file = -1
        self._path = root
        self._data: Any = None

    @property
    def episodes(self) -> int:
        """Returns the number of episodes written."""
        return len(self._episodes)

    @property
    def frames(self) -> int:
        """Returns the number of frames written."""
        return self._frames

    def add(self, frames: EpisodeFrames, videos: dict[str, Path], task: str, *, succeeded: bool) -> None:
        """Appends an episode.

        Args:
            frames: Observations and actions.
            videos: Video files, keyed by camera.
            task: Description of the task.
            succeeded: Whether the episode succeeded.

        Raises:
            ExportError: The first episode has other features, or a video is unreadable.
        """
        self._check_features(frames, videos)
        row: dict[str, Any] = {"episode_index": self.episodes, "tasks": [task], "length": frames.count}
        statistics: dict[str, FeatureStatistics] = {}
        for camera, path in videos.items():
            key = f"{IMAGES}{camera}"
            location = self._cameras[key].add(path, frames.started_s, frames.count)
            statistics[key] = image_statistics(location.samples)
            row |= {f"videos/{key}/chunk_index": location.chunk, f"videos/{key}/file_index": location.file}
            row |= {f"videos/{key}/from_timestamp": location.from_s, f"videos/{key}/to_timestamp": location.to_s}
        scalars = self._scalars(frames.count, self._tasks.setdefault(task, len(self._tasks)), succeeded)
        statistics |= {name: feature_statistics(values) for name, values in (frames.values | scalars).items()}
        self._write_data(frames, scalars)
        row |= {"data/chunk_index": self._file // FILES_PER_CHUNK, "data/file_index": self._file % FILES_PER_CHUNK}
        row |= {"dataset_from_index": self._frames, "dataset_to_index": self._frames + frames.count}
        row |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        for feature, values in statistics.items():
            self._statistics.setdefault(feature, []).append(values)
            row |= {f"stats/{feature}/{name}": value.tolist() for name, value in values.items()}
        self._episodes.append(row)
        self._frames += frames.count

    def close(self) -> None:
        """Closes the files and writes the metadata."""
        for camera in self._cameras.values():
            camera.close()
        if self._data is not None:
            self._data.close()
            self._data = None
        if not self._episodes:
            return
        path = self._root / EPISODES_PATH.format(chunk_index=0, file_index=0)
        path.parent.mkdir(parents=True, exist_ok=True)
        pyarrow.parquet.write_table(pa.Table.from_pylist(self._episodes), path)
        tasks = pd.DataFrame({"task_index": list(self._tasks.values())}, index=pd.Index(self._tasks, name="task"))
        tasks.to_parquet(self._root / "meta" / "tasks.parquet")
        joined = {feature: joined_statistics(parts) for feature, parts in self._statistics.items()}
        self._write_json("stats.json", as_lists(joined))
        self._write_json("info.json", self._info())

    def _check_features(self, frames: EpisodeFrames, videos: dict[str, Path]) -> None:
        if not self._names:
            self._names = frames.names
            keys = [f"{IMAGES}{camera}" for camera in videos]
            self._cameras = {key: CameraVideos(self._root, key, self._rate) for key in keys}
        cameras = {f"{IMAGES}{camera}" for camera in videos}
        if frames.names != self._names or cameras != set(self._cameras):
            raise ExportError(
                f"it has {_features_text(frames.names, cameras)}; allowed, as in the first episode: "
                f"{_features_text(self._names, set(self._cameras))}; export the episodes of each robot "
                "and camera separately"
            )

    def _scalars(self, count: int, task: int, succeeded: bool) -> dict[str, NDArray[Any]]:
        indices = np.arange(count)
        last = indices == count - 1
        return {
            "next.done": last,
            "next.success": last & succeeded,
            "timestamp": (indices / self._rate).astype(np.float32),
            "frame_index": indices,
            "episode_index": np.full(count, self.episodes),
            "index": self._frames + indices,
            "task_index": np.full(count, task),
        }

    def _write_data(self, frames: EpisodeFrames, scalars: dict[str, NDArray[Any]]) -> None:
        """Appends the frames as a row group, so that an episode can be read alone."""
        columns = {
            name: pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])
            if values.shape[1] > 1
            else pa.array(values[:, 0])
            for name, values in frames.values.items()
        }
        columns |= {name: pa.array(scalars[name], type=kind) for name, kind in _SCALARS.items()}
        table = pa.table(columns)
        if self._data is None or self._path.stat().st_size >= MAX_DATA_FILE_MB * 2**20:
            if self._data is not None:
                self._data.close()
            self._file += 1
            location = {"chunk_index": self._file // FILES_PER_CHUNK, "file_index": self._file % FILES_PER_CHUNK}
            self._path = self._root / DATA_PATH.format(**location)
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._data = pyarrow.parquet.ParquetWriter(self._path, table.schema)
        self._data.write_table(table)

    def _info(self) -> dict[str, Any]:
        return {
            "codebase_version": FORMAT_VERSION,
            "robot_type": self._robot_type,
            "total_episodes": self.episodes,
            "total_frames": self.frames,
            "total_tasks": len(self._tasks),
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": MAX_DATA_FILE_MB,
            "video_files_size_in_mb": MAX_FILE_MB,
            "fps": self._rate,
            "splits": {"train": f"0:{self.episodes}"},
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH if self._cameras else None,
            "features": self._features(),
        }

    def _features(self) -> dict[str, Any]:
        features: dict[str, Any] = {
            name: {"dtype": "float32", "shape": [len(parts)], "names": list(parts), **self._units_of(name)}
            for name, parts in self._names.items()
        }
        for key, camera in self._cameras.items():
            height, width = camera.shape or (0, 0)
            features[key] = {
                "dtype": "video",
                "shape": [height, width, 3],
                "names": ["height", "width", "channels"],
                "info": {
                    "video.height": height,
                    "video.width": width,
                    "video.codec": "h264" if CODEC == "libx264" else CODEC,
                    "video.pix_fmt": camera.pixels,
                    "video.fps": self._rate,
                    "video.channels": 3,
                    "has_audio": False,
                    "is_depth_map": False,
                },
            }
        scalars = {name: {"dtype": str(kind), "shape": [1], "names": None} for name, kind in _SCALARS.items()}
        scalars["timestamp"]["dtype"] = "float32"  # pyarrow prints float32 as float
        return features | scalars

    def _units_of(self, feature: str) -> dict[str, Any]:
        """Returns the units of positions and commands; empty for other features, and if a unit is unknown."""
        names = self._names[feature]
        if feature not in (STATE, ACTION) or not self._units.keys() >= set(names):
            return {}
        return {"info": {"units": [self._units[name] for name in names]}}

    def _write_json(self, name: str, content: object) -> None:
        (self._root / "meta" / name).write_text(json.dumps(content, indent=2), encoding="utf-8")


def _features_text(names: dict[str, tuple[str, ...]], cameras: set[str]) -> str:
    texts = [f"{feature} of {', '.join(parts)}" for feature, parts in sorted(names.items())]
    return "; ".join([*texts, f"cameras {', '.join(sorted(cameras)) or 'none'}"])
