# SPDX-License-Identifier: BSD-3-Clause
"""A recorded scene has the shapes of robot and models at their recorded poses, and names what it lacks."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import av
import numpy as np
import pandas as pd
import pytest

from modular_framework_benchmark.episodes.episode_video import CAMERA, make_video
from modular_framework_benchmark.episodes.errors import SceneError
from modular_framework_benchmark.episodes.recorded_scene import RecordedScene
from modular_framework_simulation.models.sdf_specs import Box
from modular_framework_testing.experiments.recorded_scene_files import LAST_S, REMOVED_S, ROBOT, write_scene

ORIGIN_S = 50.0


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_scene(tmp_path, ORIGIN_S)
    return tmp_path


def places(scene: RecordedScene, time_s: float) -> dict[str, tuple[float, ...]]:
    """Position of each visible link, keyed by model and link."""
    poses = scene.poses(time_s)
    return {
        f"{model.name}/{link.name}": pose.position
        for model in scene.models(poses)
        for link, pose in zip(model.links, poses.poses[model.number], strict=True)
    }


def test_robot_and_models_are_at_their_recorded_poses(folder: Path) -> None:
    scene = RecordedScene(folder)
    found = places(scene, 3.6)  # the latest samples are those at 3.5 s and 3 s
    assert found["lifter/carriage"] == pytest.approx((0.2, 0.0, 3.5))
    assert found["cube_1/body"] == pytest.approx((1.0, 0.0, 3.1))
    assert found["table/top"] == pytest.approx((1.0, 0.0, 0.1))
    assert [pose.position[2] for pose in scene.robot_links(2.0)] == pytest.approx([0.0, 2.0])
    assert scene.centre == pytest.approx((1.0, 0.0, 0.0))
    assert scene.end_s == LAST_S - 0.5


def test_a_model_is_drawn_only_while_it_exists(folder: Path) -> None:
    scene = RecordedScene(folder)
    assert "cube_1/body" in places(scene, REMOVED_S - 0.1)
    assert "cube_1/body" not in places(scene, REMOVED_S + 0.1)


def test_a_model_without_a_file_has_the_shape_of_its_bounding_box(folder: Path) -> None:
    scene = RecordedScene(folder)
    (parcel,) = [model for model in scene.models(scene.poses(0.0)) if model.name == "parcel"]
    (shape,) = parcel.links[0].visuals
    assert isinstance(shape.geometry, Box) and shape.geometry.size == pytest.approx((0.2, 0.4, 0.3))
    assert shape.pose.position == pytest.approx((0.0, 0.0, 0.15))
    assert scene.omissions == ["the shape of parcel except for bounding boxes"]


def test_what_the_scene_lacks_is_named(folder: Path) -> None:
    shutil.rmtree(folder / "models")
    parameters = json.loads((folder / "parameters.json").read_text())
    mesh = '<mesh filename="package://no_such_package/rail.stl"/>'
    broken = ROBOT.replace('<sphere radius="0.1"/>', mesh)
    world = str(folder / "absent.world")
    parameters |= {"robot_description": broken, "gazebo": {"world_file": world}}
    (folder / "parameters.json").write_text(json.dumps(parameters))
    world_fault, cube_fault, robot_fault, boxes = RecordedScene(folder).omissions
    assert "absent.world" in world_fault and "model.sdf" in cube_fault
    assert "link 'carriage' is not drawn" in robot_fault and "no_such_package" in robot_fault
    assert boxes == "the shape of cube_1, parcel, table except for bounding boxes"
    (folder / "parameters.json").write_text("{}")
    assert "the robot" in RecordedScene(folder).omissions


def test_joints_of_different_messages_keep_their_latest_positions(folder: Path) -> None:
    frame = pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "pan/position": [0.5, np.nan, 2.0]})
    frame.to_parquet(folder / "trajectory.parquet")
    assert places(RecordedScene(folder), 1.5)["lifter/carriage"] == pytest.approx((0.2, 0.0, 0.5))


@pytest.mark.parametrize("name", ["parameters.json", "world.json", "trajectory.parquet", "recording.json"])
def test_an_incomplete_recording_is_refused_with_the_folder(folder: Path, name: str) -> None:
    (folder / name).unlink()
    with pytest.raises(SceneError, match=f"{folder}: no motion was recorded; allowed: an episode whose task began"):
        RecordedScene(folder)


def test_a_video_shows_the_motion(folder: Path) -> None:
    with av.open(str(make_video(folder))) as video:
        images = [frame.to_ndarray(format="gray").astype(int) for frame in video.decode(video=0)]
    assert len(images) == 10 * (LAST_S - 0.5) + 1 and images[0].shape == (CAMERA.height, CAMERA.width)
    assert np.abs(images[5] - images[0]).max() > 50  # the cube and the carriage rise
