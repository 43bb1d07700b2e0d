# SPDX-License-Identifier: BSD-3-Clause
"""Renders a video of an episode from its recording after the episode has ended, so that the episode takes no longer.

    python3 -m modular_framework_benchmark.episodes.episode_video EPISODE_FOLDER

The renderer of the simulated cameras draws the recorded scene, without a physics engine or a browser.
"""

from __future__ import annotations

import contextlib
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import av
import numpy as np
import PIL.Image
import rospkg
from numpy.typing import NDArray

from modular_framework_benchmark.episodes.errors import SceneError
from modular_framework_benchmark.episodes.recorded_scene import RecordedScene
from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.models.mesh_files import default_cache_folder
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.visual_meshes import VisualMeshes
from modular_framework_simulation.physics.pybullet_engine import silenced_output
from modular_framework_simulation.sensors.cameras import OPTICAL_IN_BODY, Pinhole
from modular_framework_simulation.sensors.drawing_choice import AUTO, resolved_drawing
from modular_framework_simulation.sensors.renderer import Renderer
from modular_framework_simulation.sensors.visible_scene import SceneUpdate

VIDEO = "video.mp4"
FRAMES_PER_S = 10
TIMEOUT_S = 600.0
CODEC, PIXELS = "libx264", "yuv420p"
CAMERA = Pinhole(width=480, height=360, horizontal_fov=math.radians(64.0))
CAMERA_DISTANCE_M, CAMERA_YAW_RAD, CAMERA_PITCH_RAD = 1.6, math.radians(-140.0), math.radians(25.0)
"""Distance from the moving objects, or from the origin of the world; direction in the x-y plane; angle downwards."""
CAMERA_ABOVE_M = 0.15

Image = NDArray[np.uint8]


class SceneCamera:
    """Camera that looks at a recorded scene.

    Args:
        scene: Recorded scene.

    Raises:
        SimulationError: The renderer does not work on this machine.
    """

    def __init__(self, scene: RecordedScene) -> None:
        self._scene = scene
        drawing = resolved_drawing(AUTO)
        with silenced_output():
            self._renderer = Renderer(drawing, VisualMeshes(default_cache_folder()), _report)
        self._drawn: set[int] = set()
        x, y, z = scene.centre
        rotation = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, CAMERA_PITCH_RAD, CAMERA_YAW_RAD))
        target = Pose((x, y, z + CAMERA_ABOVE_M), rotation.quaternion)
        self._optical_in_world = target @ Pose((-CAMERA_DISTANCE_M, 0.0, 0.0)) @ OPTICAL_IN_BODY

    def image(self, time_s: float) -> Image:
        """Returns the image at a time, shape (height, width, 3).

        Args:
            time_s: Time since the start of the recording [s].
        """
        poses = self._scene.poses(time_s)
        present = {model.number: model for model in self._scene.models(poses)}
        added = {
            number: tuple(link.visuals for link in model.links)
            for number, model in present.items()
            if number not in self._drawn
        }
        removed = tuple(self._drawn - set(present))
        self._renderer.apply(SceneUpdate(poses.time_ns, added, removed, dict(poses.poses), {}))
        self._drawn = set(present)
        with silenced_output():
            return self._renderer.image(CAMERA, self._optical_in_world).rgb

    def close(self) -> None:
        """Closes the renderer; may be called twice."""
        with silenced_output():
            self._renderer.close()


def _report(fault: str) -> None:
    print(fault, file=sys.stderr)


def make_video(folder: Path) -> Path:
    """Renders the video of a recorded episode; the first frame is the start of the recording.

    Args:
        folder: Folder of the episode's files.

    Returns:
        Path of `video.mp4` in the folder.

    Raises:
        SceneError: The recording is incomplete, or the library lacks the encoder.
        SimulationError: The scene cannot be drawn.
    """
    scene, path = RecordedScene(folder), folder / VIDEO
    write_video(scene, path, 0.0, scene.end_s)
    return path


def write_video(scene: RecordedScene, path: Path, start_s: float, end_s: float) -> None:
    """Writes a video of a part of a recorded scene, in simulated time.

    Args:
        scene: Recorded scene.
        path: MP4 file.
        start_s: Time of the first frame [s since the start of the recording].
        end_s: End of the video [s since the start of the recording].

    Raises:
        SceneError: The library lacks the encoder.
        SimulationError: The scene cannot be drawn.
        OSError: The file cannot be written.
    """
    if CODEC not in av.codecs_available:
        raise SceneError(
            f"{path}: PyAV {av.__version__} lacks the encoder {CODEC}; install PyAV from requirements.txt, whose wheel "
            "contains FFmpeg, or write a .png file"
        )
    with contextlib.closing(SceneCamera(scene)) as camera, av.open(str(path), "w", format="mp4") as container:
        stream: Any = container.add_stream(CODEC, rate=FRAMES_PER_S)
        stream.width, stream.height, stream.pix_fmt = CAMERA.width, CAMERA.height, PIXELS
        for number in range(math.floor((end_s - start_s) * FRAMES_PER_S) + 1):
            image = camera.image(start_s + number / FRAMES_PER_S)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())


def write_picture(scene: RecordedScene, path: Path, time_s: float) -> None:
    """Writes a picture of a recorded scene.

    Args:
        scene: Recorded scene.
        path: PNG file.
        time_s: Time since the start of the recording [s].

    Raises:
        SimulationError: The scene cannot be drawn.
        OSError: The file cannot be written.
    """
    with contextlib.closing(SceneCamera(scene)) as camera:
        PIL.Image.fromarray(camera.image(time_s)).save(path, format="png")


def make_video_apart(folder: Path) -> str:
    """Renders the video in a separate process, because PyBullet is global to a process.

    Args:
        folder: Folder of the episode's files.

    Returns:
        The reason for a missing video; "" if there is a video.
    """
    command = [sys.executable, "-m", __name__, str(folder)]
    try:
        process = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        return f"the video was not finished within {TIMEOUT_S:g} s"
    if process.returncode == 0:
        return ""
    return (process.stderr.strip().splitlines() or [f"exit code {process.returncode}"])[-1]


def main(arguments: list[str]) -> int:
    """Renders the video of the episode in the given folder."""
    try:
        print(make_video(Path(arguments[0])))
    except (SceneError, SimulationError, OSError, rospkg.ResourceNotFound) as error:
        print(f"no video: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
