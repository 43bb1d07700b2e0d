# SPDX-License-Identifier: BSD-3-Clause
"""Visible scene of a recorded episode: shapes of robot and models, and their poses over time.

An episode records the robot description and the poses. The shapes of other models come from the present files of the
world and of the models; a model whose file cannot be read has the shape of its recorded bounding box.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from modular_framework_benchmark.episodes.errors import SceneError
from modular_framework_benchmark.metrics.measurements import JointSamples
from modular_framework_benchmark.metrics.recording_files import (
    PARAMETERS,
    WORLD_RECORD,
    read_joints,
    read_recording,
)
from modular_framework_benchmark.predicates.world_track import BodyTrack, read_world
from modular_framework_core.files.model_files import model_file
from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.model_extents import PLANE_REACH_M
from modular_framework_simulation.models.model_links import link_poses
from modular_framework_simulation.models.model_search import ros_resources
from modular_framework_simulation.models.model_variants import read_scaled
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_reader import read_world as read_world_file
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.sensors.robot_visuals import read_robot_visuals
from modular_framework_simulation.sensors.scene_text import ScenePoses, VisibleLink, VisibleModel
from modular_framework_simulation.viewer.robot_links import RobotLinks
from modular_framework_urdf.rotations import Vector3
from modular_framework_urdf.urdf_reader import read_urdf

ROBOT_NUMBER = 0
"""Number of the robot among the visible models."""
_MIN_MOVEMENT_M = 1e-3
"""Minimum extent of the positions of a model that moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _SceneBody:
    """A visible model with its recorded states.

    Attributes:
        visible: Visible shapes.
        track: Recorded states; None for a model at the origin of the world.
        links_at: Function of the time since the start of the recording [s] that returns the poses of the links in the
            model frame, keyed by link name.
    """

    visible: VisibleModel
    track: BodyTrack | None
    links_at: Callable[[float], Mapping[str, Pose]]


class RecordedScene:
    """Visible scene of a recorded episode.

    Args:
        folder: Folder of the episode's files.

    Attributes:
        omissions: Parts that the scene lacks or simplifies, as phrases.

    Raises:
        SceneError: The recording is incomplete.
    """

    def __init__(self, folder: Path) -> None:
        recording, joints = read_recording(folder), read_joints(folder)
        files = (folder / PARAMETERS, folder / WORLD_RECORD)
        if not recording or joints is None or not len(joints.times_s) or not all(file.is_file() for file in files):
            raise SceneError(f"{folder}: no motion was recorded; allowed: an episode whose task began")
        parameters, record = (json.loads(file.read_text(encoding="utf-8")) for file in files)
        self._joints = replace(joints, positions=pd.DataFrame(joints.positions).ffill().bfill().to_numpy())
        self._world = read_world(record, float(recording["origin_s"]), -math.inf, math.inf)
        self.omissions: list[str] = []
        resources = ros_resources(str(parameters.get("gazebo_model_path", "")))
        models = self._read_models(parameters, recording, resources)
        bodies = [*self._robot_bodies(str(parameters.get("robot_description", "")), resources)]
        bodies += self._model_bodies(models, first_number=ROBOT_NUMBER + 1)
        self._bodies = tuple(bodies)
        if not self._world.bodies:
            self.omissions.append("the models of the world")

    @property
    def end_s(self) -> float:
        """Returns the time of the last joint sample [s since the start of the recording]."""
        return float(self._joints.times_s[-1])

    @property
    def centre(self) -> Vector3:
        """Returns the mean initial position of the moving models in the world frame [m]; the origin without any."""
        tracks = [track for name, track in self._world.bodies.items() if name not in self._world.robots]
        known = [track.positions[~np.isnan(track.positions[:, 0])] for track in tracks]
        starts = [rows[0] for rows in known if len(rows) and np.ptp(rows, axis=0).max() > _MIN_MOVEMENT_M]
        x, y, z = np.mean(starts, axis=0).tolist() if starts else (0.0, 0.0, 0.0)
        return x, y, z

    def poses(self, time_s: float) -> ScenePoses:
        """Returns the poses of the visible links at a time; models that do not exist at that time are left out.

        Args:
            time_s: Time since the start of the recording [s].
        """
        poses: dict[int, tuple[Pose, ...]] = {}
        row = _latest(self._world.times_s, time_s)
        for body in self._bodies:
            model_in_world = Pose() if body.track is None else _pose_at(body.track, row)
            if model_in_world is not None:
                links = body.links_at(time_s)
                poses[body.visible.number] = tuple(model_in_world @ links[link.name] for link in body.visible.links)
        return ScenePoses(round(time_s * 1e9), False, poses)

    def robot_links(self, time_s: float) -> tuple[Pose, ...]:
        """Returns the poses of the visible links of the robot in the world frame; empty without a robot.

        Args:
            time_s: Time since the start of the recording [s].
        """
        return self.poses(time_s).poses.get(ROBOT_NUMBER, ())

    def models(self, poses: ScenePoses) -> tuple[VisibleModel, ...]:
        """Returns the models that exist at the time of some poses."""
        return tuple(body.visible for body in self._bodies if body.visible.number in poses.poses)

    def _read_models(
        self, parameters: Mapping[str, Any], recording: Mapping[str, Any], resources: Resources
    ) -> dict[str, specs.Model]:
        """Returns the descriptions of the models of the world and of the spawned models, keyed by name."""
        models: dict[str, specs.Model] = {}
        world_file = str(parameters.get("gazebo", {}).get("world_file", ""))
        try:
            spec = read_world_file(Path(world_file), resources) if world_file else None
            models |= {model.name: model for model in (spec.models if spec is not None else ())}
        except (SimulationError, OSError) as error:
            self.omissions.append(f"the world file ({error})")
        folders = str(parameters.get("gazebo_model_path", ""))
        for name, model in recording.get("spawned", {}).items():
            file = model_file(model, folders)
            try:
                text = read_scaled(file, recording.get("scales", {}).get(name))
                models[name] = replace(read_model_text(text, str(file), resources), name=name)
            except (SimulationError, OSError) as error:
                self.omissions.append(f"the model file of {name} ({error})")
        return models

    def _robot_bodies(self, description: str, resources: Resources) -> Iterator[_SceneBody]:
        if not description:
            self.omissions.append("the robot")
            return
        faults: list[str] = []
        try:
            robot = RobotLinks(read_urdf(description))
            visuals = read_robot_visuals(description, resources.find_package, faults.append)
        except (SimulationError, ValueError) as error:
            self.omissions.append(f"the robot ({error})")
            return
        if faults:
            more = f" and {len(faults) - 1} more" if len(faults) > 1 else ""
            self.omissions.append(f"shapes of the robot ({faults[0]}{more})")
        name = next(iter(sorted(self._world.robots)), "robot")
        yield _SceneBody(
            visible=VisibleModel(
                ROBOT_NUMBER, name, tuple(VisibleLink(link, shapes) for link, shapes in visuals.items())
            ),
            track=self._world.bodies.get(name),
            links_at=lambda time_s: robot.poses(_positions(self._joints, time_s)),
        )

    def _model_bodies(self, models: Mapping[str, specs.Model], first_number: int) -> Iterator[_SceneBody]:
        boxes = []
        tracks = {name: track for name, track in self._world.bodies.items() if name not in self._world.robots}
        for number, (name, track) in enumerate(tracks.items(), first_number):
            model = models.get(name)
            if model is None:
                model = _box_model(name, track.box)
                boxes.append(name)
            initial = link_poses(model, {})
            drawn = tuple(VisibleLink(link.name, link.visuals) for link in model.links if link.visuals)
            if loose := [link.name for link in drawn if link.name not in initial]:
                self.omissions.append(f"the links {', '.join(loose)} of {name}")
            visible = VisibleModel(number, name, tuple(link for link in drawn if link.name in initial))
            yield _SceneBody(visible=visible, track=track, links_at=self._links_of(model, track, initial))
        if boxes:
            self.omissions.append(f"the shape of {', '.join(boxes)} except for bounding boxes")

    def _links_of(
        self, model: specs.Model, track: BodyTrack, initial: Mapping[str, Pose]
    ) -> Callable[[float], Mapping[str, Pose]]:
        def links_at(time_s: float) -> Mapping[str, Pose]:
            row = _latest(self._world.times_s, time_s)
            positions = {joint: float(values[row]) for joint, values in track.joints.items()}
            return link_poses(model, {joint: value for joint, value in positions.items() if math.isfinite(value)})

        return links_at if track.joints else lambda _: initial


def _box_model(name: str, box: NDArray[np.float64]) -> specs.Model:
    """Returns a model with a box as its shape; without a shape if the box is a point or infinite.

    Args:
        name: Name of the model.
        box: Smallest and largest corner in the model frame, shape (2, 3) [m].
    """
    (x, y, z), (width, depth, height) = box.mean(axis=0).tolist(), np.ptp(box, axis=0).tolist()
    shape = specs.Visual("box", Pose((x, y, z)), specs.Box((width, depth, height)), specs.GREY)
    visuals = (shape,) if 0.0 < max(width, depth, height) < PLANE_REACH_M else ()
    return specs.Model(name, Pose(), True, (specs.Link("box", Pose(), None, (), visuals),), (), "record")


def _latest(times_s: NDArray[np.float64], time_s: float) -> int:
    """Returns the index of the latest sample at a time; the first sample before its time."""
    return max(int(np.searchsorted(times_s, time_s, side="right")) - 1, 0)


def _pose_at(track: BodyTrack, row: int) -> Pose | None:
    """Returns the pose of a model in the world frame; None while the model does not exist."""
    x, y, z = track.positions[row].tolist()
    qx, qy, qz, qw = track.quaternions[row].tolist()
    return None if math.isnan(x) else Pose((x, y, z), (qx, qy, qz, qw))


def _positions(joints: JointSamples, time_s: float) -> dict[str, float]:
    """Returns the finite joint positions at a time, keyed by joint name [rad or m]."""
    row = joints.positions[_latest(joints.times_s, time_s)].tolist()
    return {joint: value for joint, value in zip(joints.joints, row, strict=True) if math.isfinite(value)}
