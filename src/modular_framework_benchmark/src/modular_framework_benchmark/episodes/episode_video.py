# SPDX-License-Identifier: BSD-3-Clause
"""Renders a video of an episode from its recording after the episode has ended, so that the episode takes no longer.

    python3 -m modular_framework_benchmark.episodes.episode_video EPISODE_FOLDER

The world is rebuilt from the recorded parameters. Each frame sets joints and objects to their recorded states.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import rospkg
from numpy.typing import NDArray

from modular_framework_benchmark.episodes.errors import VideoError
from modular_framework_benchmark.metrics.measurements import ObjectTrack
from modular_framework_benchmark.metrics.recording_files import PARAMETERS, objects_of, read_joints, read_recording
from modular_framework_core.files.model_files import model_file
from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.models import sdf_specs
from modular_framework_simulation.models.mesh_files import ConvexParts, default_cache_folder
from modular_framework_simulation.models.model_search import ros_resources
from modular_framework_simulation.models.model_variants import read_scaled
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import STANDARD_GRAVITY, read_model_text, read_world
from modular_framework_simulation.physics.body_urdf import model_to_urdf
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.physics.simulated_body import BodyState, Twist
from modular_framework_simulation.robots.robot_description import read_robot

VIDEO = "video.mp4"
FRAMES_PER_S = 10
WIDTH, HEIGHT = 480, 360
TIMEOUT_S = 600.0
CODEC, PIXELS = "libx264", "yuv420p"
FIELD_OF_VIEW_DEG, NEAR_M, FAR_M = 50.0, 0.05, 10.0
CAMERA_M, CAMERA_YAW_DEG, CAMERA_PITCH_DEG = 1.6, 130.0, -25.0
"""The camera looks at the mean position of the objects, or at the robot's root, with this distance and these angles."""
CAMERA_ABOVE_M = 0.15

Image = NDArray[np.uint8]


class RecordedScene:
    """World of a recorded episode with its robot and objects."""

    def __init__(self, folder: Path) -> None:
        """Builds the world.

        Args:
            folder: Folder of the episode's files.

        Raises:
            VideoError: The recording is incomplete.
            SimulationError: The world cannot be rebuilt.
        """
        recording, path = read_recording(folder), folder / PARAMETERS
        joints = read_joints(folder)
        if not recording or not path.is_file() or joints is None or not len(joints.times_s):
            raise VideoError(f"{folder}: no motion was recorded; a video needs an episode whose task began")
        parameters = json.loads(path.read_text())
        self._joints, self._tracks = joints, objects_of(recording)
        self._parts = ConvexParts(default_cache_folder())
        models = str(parameters.get("gazebo_model_path", ""))
        self._resources = ros_resources(models)
        simulation = parameters.get("gazebo", {})
        self._build_world(str(simulation.get("world_file", "")))
        for name, model in recording.get("spawned", {}).items():
            file = model_file(model, models)
            text = read_scaled(file, recording.get("scales", {}).get(name))
            self._spawn(replace(read_model_text(text, str(file), self._resources), name=name))
        description = read_robot(
            str(parameters.get("robot_description", "")), self._resources.find_package, self._parts, with_visuals=True
        )
        name = str(simulation.get("robot_name", "")) or description.name
        self._robot = RobotBody(self._world, description, name, Pose(), {})

    def _build_world(self, file: str) -> None:
        spec = read_world(Path(file), self._resources) if file else None
        self._world = PhysicsWorld(PhysicsSettings(), self._parts, spec.gravity if spec else STANDARD_GRAVITY)
        for model in spec.models if spec else ():
            self._spawn(model)

    def _spawn(self, model: sdf_specs.Model) -> None:
        self._world.spawn(model, model_to_urdf(model, self._parts, True))

    @property
    def end_s(self) -> float:
        """Time of the last sample [s since the start of the recording]."""
        return float(self._joints.times_s[-1])

    def show(self, time_s: float) -> None:
        """Sets joints and objects to their states at a time [s since the start of the recording]."""
        row = _latest(self._joints.times_s, time_s)
        positions = dict(zip(self._joints.joints, self._joints.positions[row].tolist(), strict=True))
        joint_indices = self._robot.body.joint_indices
        self._robot.body.set_joints({name: value for name, value in positions.items() if name in joint_indices})
        present = set(self._world.names())
        for name, track in self._tracks.items():
            if name in present and len(track.times_s):
                self._world.body(name).set_state(BodyState(_pose(track, time_s), Twist()))

    def image(self) -> Image:
        """Returns a rendered image of shape (HEIGHT, WIDTH, 3)."""
        api, client = self._world.engine.api, self._world.engine.client
        view = api.computeViewMatrixFromYawPitchRoll(
            self._camera_target(), CAMERA_M, CAMERA_YAW_DEG, CAMERA_PITCH_DEG, 0.0, 2, physicsClientId=client
        )
        lens = api.computeProjectionMatrixFOV(FIELD_OF_VIEW_DEG, WIDTH / HEIGHT, NEAR_M, FAR_M, physicsClientId=client)
        _, _, pixels, _, _ = api.getCameraImage(
            WIDTH, HEIGHT, view, lens, renderer=api.ER_TINY_RENDERER, physicsClientId=client
        )
        return np.ascontiguousarray(np.asarray(pixels, dtype=np.uint8).reshape(HEIGHT, WIDTH, 4)[:, :, :3])

    def _camera_target(self) -> list[float]:
        positions = [track.positions[0] for track in self._tracks.values() if len(track.times_s) > 1]
        position = np.mean(positions, axis=0) if positions else np.zeros(3)
        return [float(position[0]), float(position[1]), float(position[2]) + CAMERA_ABOVE_M]

    def close(self) -> None:
        """Disconnects the physics engine."""
        self._world.close()


def _latest(times_s: NDArray[np.float64], time_s: float) -> int:
    return max(int(np.searchsorted(times_s, time_s, side="right")) - 1, 0)


def _pose(track: ObjectTrack, time_s: float) -> Pose:
    row = _latest(track.times_s, time_s)
    x, y, z = track.positions[row].tolist()
    qx, qy, qz, qw = track.quaternions[row].tolist()
    return Pose((x, y, z), (qx, qy, qz, qw))


def make_video(folder: Path) -> Path:
    """Renders the video of a recorded episode; the first frame is the start of the recording.

    Args:
        folder: Folder of the episode's files.

    Returns:
        Path of `video.mp4` in the folder.

    Raises:
        VideoError: The recording is incomplete.
        SimulationError: The world cannot be rebuilt.
    """
    scene, path = RecordedScene(folder), folder / VIDEO
    try:
        with av.open(str(path), "w") as container:
            stream: Any = container.add_stream(CODEC, rate=FRAMES_PER_S)
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, PIXELS
            for number in range(math.floor(scene.end_s * FRAMES_PER_S) + 1):
                scene.show(number / FRAMES_PER_S)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(scene.image(), format="rgb24")))
            container.mux(stream.encode())
    finally:
        scene.close()
    return path


def make_video_apart(folder: Path) -> str:
    """Renders the video in a separate process, because the physics engine is global to a process.

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
    except (VideoError, SimulationError, OSError, rospkg.ResourceNotFound) as error:
        print(f"no video: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
