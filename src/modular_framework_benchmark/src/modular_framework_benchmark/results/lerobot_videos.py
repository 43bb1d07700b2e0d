# SPDX-License-Identifier: BSD-3-Clause
"""Writes the videos of episodes into the video files of a LeRobot dataset: many episodes a file, one file a camera."""

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
LARGEST_FILE_MB = 200
FILES_A_CHUNK = 1000
CODEC = "libx264"
PIXELS = "yuv420p"
PIXELS_OF_ODD_SIZES = "yuv444p"
_SAMPLED_IMAGES = 20


@dataclass(frozen=True, slots=True)
class VideoPlace:
    """Where the frames of an episode are.

    Attributes:
        chunk: Index of the folder.
        file: Index of the file in it.
        from_s: Start in the file [s].
        to_s: End in the file [s].
        samples: Some of the frames, of shape (images, height, width, 3).
    """

    chunk: int
    file: int
    from_s: float
    to_s: float
    samples: NDArray[np.uint8]


def find_videos(folder: Path) -> dict[str, Path]:
    """Returns the videos of an episode by camera: `video.mp4` is that of `scene`, `video_NAME.mp4` that of NAME."""
    return {path.stem.removeprefix("video").lstrip("_") or "scene": path for path in sorted(folder.glob(VIDEO_PATTERN))}


class CameraVideos:
    """Writes the videos of one camera; `close` finishes the file."""

    def __init__(self, root: Path, key: str, frames_per_second: int) -> None:
        """Stores the arguments: folder of the dataset, feature of the camera, and rate."""
        self._root = root
        self._key = key
        self._rate = frames_per_second
        self._index = -1
        self._frames = 0
        self._container: Any = None
        self._stream: Any = None
        self._path = root
        self.shape: tuple[int, int] | None = None
        self.pixels = PIXELS

    def add(self, source: Path, started_s: float, count: int) -> VideoPlace:
        """Appends the frames of an episode, at the rate of the dataset.

        Args:
            source: The episode's video, whose first frame is the beginning of the episode.
            started_s: Time of the first frame of the dataset's episode [s since the episode began].
            count: Number of frames.

        Raises:
            ExportError: The video cannot be read, has no frames, or another size than those before.
        """
        if self._container is None or self._path.stat().st_size >= LARGEST_FILE_MB * 2**20:
            self._open_next()
        begin = self._frames
        every = max(1, count // _SAMPLED_IMAGES)
        samples = []
        for place, image in enumerate(frames_at(source, started_s + np.arange(count) / self._rate)):
            self._encode(image, source)
            if place % every == 0:
                samples.append(image)
        return VideoPlace(
            self._index // FILES_A_CHUNK,
            self._index % FILES_A_CHUNK,
            begin / self._rate,
            self._frames / self._rate,
            np.stack(samples),
        )

    def close(self) -> None:
        """Finishes the file; may be called twice."""
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
            video_key=self._key, chunk_index=self._index // FILES_A_CHUNK, file_index=self._index % FILES_A_CHUNK
        )
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._container = av.open(str(self._path), "w")

    def _encode(self, image: NDArray[np.uint8], source: Path) -> None:
        shape = (image.shape[0], image.shape[1])
        if self.shape is None:
            self.shape = shape
        if shape != self.shape:
            raise ExportError(
                f"{source}: its size is {shape}, allowed is {self.shape}, that of the first; export it apart"
            )
        if self._stream is None:
            self._stream = self._container.add_stream(CODEC, rate=self._rate)
            self._stream.height, self._stream.width = shape
            self.pixels = PIXELS if not (shape[0] % 2 or shape[1] % 2) else PIXELS_OF_ODD_SIZES
            self._stream.pix_fmt = self.pixels
            self._stream.gop_size = 2  # learners seek single frames
        frame = av.VideoFrame.from_ndarray(image, format="rgb24")
        frame.pts = self._frames
        frame.time_base = Fraction(1, self._rate)
        self._frames += 1
        for packet in self._stream.encode(frame):
            self._container.mux(packet)


def frames_at(source: Path, moments: NDArray[np.float64]) -> Iterator[NDArray[np.uint8]]:
    """Reads the frames that a video shows at given moments; before its first frame that, after its last the last.

    Args:
        source: The video.
        moments: Times in it, increasing [s], of shape (n,).

    Yields:
        Images of shape (height, width, 3).

    Raises:
        ExportError: It cannot be read, or has no frames.
    """
    try:
        with av.open(str(source)) as container:
            decoded = container.decode(video=0)
            shown = next(decoded, None)
            if shown is None:
                raise ExportError(f"{source}: has no frames; record the episode again")
            coming = next(decoded, None)
            for moment in moments:
                while coming is not None and float(coming.time or 0.0) <= moment + 1e-6:
                    shown, coming = coming, next(decoded, None)
                yield np.asarray(shown.to_ndarray(format="rgb24"), dtype=np.uint8)
    except (FFmpegError, IndexError) as error:
        raise ExportError(f"{source}: no video that can be read ({error}); record the episode again") from error
