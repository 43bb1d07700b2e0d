# SPDX-License-Identifier: BSD-3-Clause
"""Settings of an episode, the motion that shakes, and parameters that a launch file sets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import roslaunch.config

from modular_framework_benchmark.episodes.episode_video import make_video, make_video_apart
from modular_framework_benchmark.episodes.errors import SettingsError, VideoError
from modular_framework_benchmark.episodes.shake_motion import shake_motion
from modular_framework_benchmark.episodes.stack import write_parameters
from modular_framework_benchmark.episodes.task_settings import SuccessCriteria, read_settings
from modular_framework_benchmark.records.episode import EpisodeSpec


def spec(**settings: Any) -> EpisodeSpec:
    return EpisodeSpec(0, {}, 0, 1, settings)


def test_settings_have_defaults_and_success_is_about_the_first_object() -> None:
    found = read_settings(spec(objects=[{"model": "can", "x": 1, "y": 2, "z": 3}], success={"lifted": 0.2}))
    assert (found.package, found.launch_file) == ("modular_framework_api", "start_framework.launch")
    assert found.objects[0].position == (1.0, 2.0, 3.0) and found.objects[0].rpy == (0.0, 0.0, 0.0)
    assert found.success == SuccessCriteria("object_0", 0.2, 2.0)
    assert read_settings(spec()).success.object == ""


def test_a_task_is_an_argument_and_truths_are_written_as_roslaunch_reads_them() -> None:
    found = read_settings(spec(task="mine.yaml", arguments={"simulation": True, "start_timeout": 5}))
    assert found.arguments == {"task_constructor_script": "mine.yaml", "simulation": "true", "start_timeout": "5"}


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"launch": "nothing"}, "'launch' is 'nothing'; allowed: PACKAGE/FILE.launch"),
        ({"objects": [{"model": "can", "x": 0}]}, "number 0: y, z is missing"),
        ({"objects": [{"model": "can", "x": 0, "y": "a", "z": 0}]}, "could not convert"),
        ({"success": {"lifted": 0.1}}, "names no object"),
    ],
)
def test_wrong_settings_are_named(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        read_settings(spec(**settings))


def test_parameters_of_an_episode_replace_those_of_the_launch_file_and_keep_their_types(tmp_path: Path) -> None:
    (tmp_path / "own.launch").write_text(
        "<launch><rosparam>planner_name: A\narm: {speed: 1.0, name: x}</rosparam>"
        '<param name="number" value="1"/></launch>'
    )
    values = {"/planner_name": "1e3", "/arm/speed": 0.25, "/number": [1, 2.5], "/new": {"deep": True}}
    write_parameters(tmp_path / "later.launch", values)
    files = [(str(tmp_path / name), []) for name in ("own.launch", "later.launch")]
    loaded = roslaunch.config.load_config_default(files, None, verbose=False, assign_machines=False).params
    found = {name: loaded[name].value for name in ("/planner_name", "/arm/speed", "/number", "/new/deep", "/arm/name")}
    assert found == {"/new/deep": True, "/arm/name": "x"} | {name: values[name] for name in values if name != "/new"}


def test_a_video_of_what_was_not_recorded_is_refused_with_the_folder(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match="no motion was recorded"):
        make_video(tmp_path)
    assert str(tmp_path) in make_video_apart(tmp_path)


@pytest.mark.parametrize("duration_s", [0.3, 2.0, 10.0])
def test_a_shake_starts_and_ends_at_rest_where_the_joints_are_and_keeps_their_limits(duration_s: float) -> None:
    start, limits = np.array([0.3, -1.0, 2.0]), np.array([3.0, 0.4, 0.01])
    times, positions, velocities = shake_motion(start, limits, duration_s)
    assert times[0] == 0.0 and times[-1] == pytest.approx(duration_s) and (np.diff(times) > 0).all()
    np.testing.assert_allclose(positions[[0, -1]], [start, start], atol=1e-12)
    assert not velocities[[0, -1]].any()
    assert (np.abs(velocities) <= 0.5 * limits + 1e-9).all()
    assert (np.abs(np.diff(positions, axis=0) / np.diff(times)[:, None]) <= 0.51 * limits + 1e-9).all()
    assert (np.abs(positions - start) <= 0.05 + 1e-12).all()
