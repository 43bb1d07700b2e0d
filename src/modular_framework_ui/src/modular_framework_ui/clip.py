# SPDX-License-Identifier: BSD-3-Clause
"""Writes a video or a picture of the recorded world of an episode, without a browser."""

from __future__ import annotations

from pathlib import Path

from modular_framework_benchmark.episodes.episode_video import write_picture, write_video
from modular_framework_benchmark.episodes.errors import SceneError
from modular_framework_simulation.errors import SimulationError
from modular_framework_ui.recorded_episode import RecordedEpisode
from modular_framework_ui.recorded_task import ReplayError

_VIDEO, _PICTURE = ".mp4", ".png"


def write_clip(episode: RecordedEpisode, path: Path, moment_s: float | None = None) -> None:
    """Writes the video of a task in simulated time, or a picture of a moment.

    Args:
        episode: Record of the episode.
        path: File of the clip, which is replaced.
        moment_s: Time of a picture since the start of the task [s]; None for the end of the task.

    Raises:
        ReplayError: The file has another suffix, the episode has no recorded world, or the clip cannot be drawn,
            encoded or written.
    """
    suffix = path.suffix.lower()
    if suffix not in (_VIDEO, _PICTURE):
        raise ReplayError(f"{path}: got suffix '{path.suffix}'; allowed: {_VIDEO} and {_PICTURE}")
    if suffix == _VIDEO and moment_s is not None:
        raise ReplayError(f"{path}: a video shows the whole task; allowed with --moment: {_PICTURE}")
    if episode.scene is None:
        raise ReplayError(f"{episode.title}: the record has no world; allowed: an episode of mode task in simulation")
    end_s = episode.to_recording_time(episode.task.ended_s)
    try:
        if suffix == _VIDEO:
            write_video(episode.scene, path, episode.to_recording_time(0.0), end_s)
        else:
            write_picture(episode.scene, path, end_s if moment_s is None else episode.to_recording_time(moment_s))
    except (SceneError, SimulationError) as error:
        raise ReplayError(str(error)) from error
    except OSError as error:
        raise ReplayError(f"{path}: cannot be written ({error})") from error
