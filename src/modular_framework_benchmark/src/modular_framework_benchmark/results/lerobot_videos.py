# SPDX-License-Identifier: BSD-3-Clause
"""Writes videos into the files of a LeRobot dataset: one sequence of files per camera, many episodes per file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.error import FFmpegError
from numpy.typing import NDArray

from modular_framework_benchmark.results.errors import ExportError

VIDEO_PATTERN = "video*.mp4"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
MAX_FILE_MB = 200
FILES_PER_CHUNK = 1000
CODEC = "libx264"
EVEN_SIZE_PIXELS = "yuv420p"
ODD_SIZE_PIXELS = "yuv444p"
_SAMPLED_IMAGES = 20


@dataclass(frozen=True, slots=True)
class VideoLocation:
    """Location of the frames of an episode.

    Attributes:
        chunk: Index of the folder.
        file: Index of the file in the folder.
        from_s: Start time in the file [s].
        to_s: End time in the file [s].
        samples: Sampled frames, shape (images, height, width, 3).
    """

    chunk: int
    file: int
    from_s: float
    to_s: float
    samples: NDArray[np.uint8]


def find_videos(folder: Path) -> dict[str, Path]:
    """Returns the videos of an episode by camera: `video.mp4` shows `scene`, `video_NAME.mp4` shows NAME."""
    return {path.stem.removeprefix("video").lstrip("_") or "scene": path for path in sorted(folder.glob(VIDEO_PATTERN))}


class CameraVideos:
    """Writes the videos of a camera; `close` finishes the file."""

    def __init__(self, root: Path, key: str, frames_per_second: int) -> None:
        """Stores the arguments.

        Args:
            root: Folder of the dataset.
            key: Feature name of the camera.
            frames_per_second: Frame rate of the dataset [Hz].
        """
        self._root = root
        self._key = key
        self._rate = frames_per_second
        self._index = -1
        self._frames = 0
        self._container: Any = None
        self._stream: Any = None
        self._path = root
        self.shape: tuple[int, int] | None = None
        self.pixels = EVEN_SIZE_PIXELS

    def add(self, source: Path, started_s: float, count: int) -> VideoLocation:
        """Appends the frames of an episode at the rate of the dataset.

        Args:
            source: Video of the episode, which begins at the start of the episode.
            started_s: Time of the first frame to append [s since the start of the episode].
            count: Number of frames.

        Raises:
            ExportError: The video is unreadable, has no frames, or differs in size from the previous videos.
        """
        if self._container is None or self._path.stat().st_size >= MAX_FILE_MB * 2**20:
            self._open_next()
        begin = self._frames
        stride = max(1, count // _SAMPLED_IMAGES)
        samples = []
        for index, image in enumerate(frames_at(source, started_s + np.arange(count) / self._rate)):
            self._encode(image, source)
            if index % stride == 0:
                samples.append(image)
        return VideoLocation(
            self._index // FILES_PER_CHUNK,
            self._index % FILES_PER_CHUNK,
            begin / self._rate,
            self._frames / self._rate,
            np.stack(samples),
        )

    def close(self) -> None:
        """Finishes the file; repeated calls are allowed."""
        if self._container is not None:
            for packet in self._stream.encode() if self._stream is not None else ():
                self._container.mux(packet)
            self._container.close()
        self._container = self._stream = None

    def _open_next(self) -> None:
        self.close()
        self._index += 1
        self._frames = 0
        self._path = self._root / VIDEO_PATH.format(
            video_key=self._key, chunk_index=self._index // FILES_PER_CHUNK, file_index=self._index % FILES_PER_CHUNK
        )
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._container = av.open(str(self._path), "w")

    def _encode(self, image: NDArray[np.uint8], source: Path) -> None:
        shape = (image.shape[0], image.shape[1])
        if self.shape is None:
            self.shape = shape
        if shape != self.shape:
            raise ExportError(
                f"{source}: its size is {shape}; allowed: {self.shape}, the size of the first; export it separately"
            )
        if self._stream is None:
            self._stream = self._container.add_stream(CODEC, rate=self._rate)
            self._stream.height, self._stream.width = shape
            self.pixels = EVEN_SIZE_PIXELS if not (shape[0] % 2 or shape[1] % 2) else ODD_SIZE_PIXELS
            self._stream.pix_fmt = self.pixels
            self._stream.gop_size = 2  # learners seek single frames
        frame = av.VideoFrame.from_ndarray(image, format="rgb24")
        frame.pts = self._frames
        frame.time_base = Fraction(1, self._rate)
        self._frames += 1
        for packet in self._stream.encode(frame):
            self._container.mux(packet)


def frames_at(source: Path, times_s: NDArray[np.float64]) -> Iterator[NDArray[np.uint8]]:
    """Yields the frame that a video shows at each of the given times.

    Args:
        source: Video file.
        times_s: Increasing times in the video [s], shape (n,). Times outside the video give its first or last frame.

    Yields:
        Images of shape (height, width, 3).

    Raises:
        ExportError: The video is unreadable, or has no frames.
    """
    try:
        with av.open(str(source)) as container:
            decoded = container.decode(video=0)
            frame = next(decoded, None)
            if frame is None:
                raise ExportError(f"{source}: has no frames; record the episode again")
            following = next(decoded, None)
            for moment in times_s:
                while following is not None and float(following.time or 0.0) <= moment + 1e-6:
                    frame, following = following, next(decoded, None)
                yield np.asarray(frame.to_ndarray(format="rgb24"), dtype=np.uint8)
    except (FFmpegError, IndexError) as error:
        raise ExportError(f"{source}: not a readable video ({error}); record the episode again") from error
