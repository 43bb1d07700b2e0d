# SPDX-License-Identifier: BSD-3-Clause
"""Settings of an episode, the motion that shakes, and parameters that a launch file sets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import roslaunch.config

from modular_framework_benchmark.episodes.episode_video import make_video, make_video_apart
from modular_framework_benchmark.episodes.errors import SceneError
from modular_framework_benchmark.episodes.ros_stack_launch import resolve_launch
from modular_framework_benchmark.episodes.shake_motion import shake_motion
from modular_framework_benchmark.episodes.stack import write_parameters
from modular_framework_benchmark.experiments.modes import stored_settings
from modular_framework_benchmark.experiments.success_criteria import SuccessCriteria
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.predicates.conditions import CONDITIONS, Region
from modular_framework_benchmark.predicates.predicate import All, InOrder, Not
from modular_framework_benchmark.predicates.predicate import Any as AnyOf
from modular_framework_benchmark.predicates.progress import Milestone
from modular_framework_benchmark.records.episode_settings import PlacedObject, SettingsError, as_json, from_json
from modular_framework_urdf.joint_limits import JointLimits

CAN = PlacedObject("can_1", "can", 1.0, 2.0, 3.0)


def test_success_is_about_the_first_object_and_without_criteria_about_the_task_alone() -> None:
    settings = TaskSettings(objects=(CAN,), success=SuccessCriteria(lifted=0.2))
    assert settings.judged_object == "can_1"
    assert settings.success.hold_s == 2.0 and TaskSettings().success.hold_s == 0.0
    assert replace(settings, success=SuccessCriteria(object="cup")).judged_object == "cup"
    assert TaskSettings(objects=(CAN,)).judged_object == ""
    with pytest.raises(SettingsError, match="names no object"):
        _ = replace(settings, objects=()).judged_object


def test_every_condition_is_stored_and_read_again_and_its_parts_are_documented() -> None:
    region = Region(name="goal", x=(0.0, 1.0), y=(0.0, 1.0), z=(0.5, 1.0))
    given: dict[str, dict[str, Any]] = {
        "in_region": {"region": region},
        "cleared": {"region": region, "objects": ("a", "b")},
        "collected": {"region": region, "objects": ("a", "b"), "count": 1},
        "stacked": {"objects": ("a", "b")},
        "on_top_of": {"support": "a"},
        "inside": {"container": "a"},
        "joint_at_least": {"model": "a", "joint": "b", "position": 1.0},
    }
    parts = []
    for name, kind in CONDITIONS.items():
        own = {} if name in ("cleared", "collected", "stacked", "joint_at_least") else {"object": "cube"}
        parts.append(kind(**(own | given.get(name, {})), duration=1.5))  # type: ignore[arg-type]
        assert parts[-1].kind == name and kind.__doc__
    whole = Not(InOrder((All(tuple(parts)), AnyOf((parts[0],)))))
    settings = TaskSettings(
        success=SuccessCriteria(required=whole), progress=(Milestone(name="m", predicate=parts[0]),), regions=(region,)
    )
    assert stored_settings("task", as_json(settings)) == settings
    assert as_json(parts[0]) == {"lifted": {"duration": 1.5, "object": "cube", "height": 0.1}}
    assert from_json(Milestone, as_json(settings.progress[0])) == settings.progress[0]
    old = Milestone(name="m", predicate=parts[list(CONDITIONS).index("on_top_of")])
    content = as_json(old)
    content["predicate"] = {"on": content["predicate"]["on_top_of"]}
    assert from_json(Milestone, content) == old


def test_a_launch_file_has_a_package_or_is_a_path_and_the_task_is_an_argument(tmp_path: Path) -> None:
    (tmp_path / "own.launch").write_text('<launch><arg name="task_constructor_script"/><arg name="speed"/></launch>')
    settings = TaskSettings(launch=str(tmp_path / "own.launch"), task="simulation_pick.yaml", arguments={"speed": "5"})
    found = resolve_launch(settings)
    assert (found.package, found.launch_file) == ("", str(tmp_path / "own.launch"))
    assert found.arguments == {"task_constructor_script": "simulation_pick.yaml", "speed": "5"}
    assert resolve_launch(TaskSettings()).package == "modular_framework_api"
    with pytest.raises(SettingsError, match="'launch' is 'nothing'; allowed: PACKAGE/FILE.launch"):
        resolve_launch(TaskSettings(launch="nothing"))


def test_an_episode_keeps_the_regions_of_the_launch_argument() -> None:
    goal = {"x": [0.1, 0.2], "y": [0.4, 0.5]}
    assert resolve_launch(TaskSettings(arguments={"regions": str({"goal": goal})})).regions == {"goal": goal}
    assert resolve_launch(TaskSettings()).regions == {}


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
    with pytest.raises(SceneError, match="no motion was recorded"):
        make_video(tmp_path)
    assert str(tmp_path) in make_video_apart(tmp_path)


@pytest.mark.parametrize("duration_s", [0.3, 2.0, 10.0])
def test_a_shake_starts_and_ends_at_rest_where_the_joints_are_and_keeps_their_limits(duration_s: float) -> None:
    start, limits = np.array([0.3, -1.0, 2.0]), np.array([3.0, 0.4, 0.01])
    by_joint = {joint: JointLimits(-np.inf, np.inf, limit, np.inf) for joint, limit in zip("abc", limits, strict=True)}
    times, positions, velocities = shake_motion(start, by_joint, "abc", duration_s)
    assert times[0] == 0.0 and times[-1] == pytest.approx(duration_s) and (np.diff(times) > 0).all()
    np.testing.assert_allclose(positions[[0, -1]], [start, start], atol=1e-12)
    assert not velocities[[0, -1]].any()
    assert (np.abs(velocities) <= 0.5 * limits + 1e-9).all()
    assert (np.abs(np.diff(positions, axis=0) / np.diff(times)[:, None]) <= 0.51 * limits + 1e-9).all()
    assert (np.abs(positions - start) <= 0.05 + 1e-12).all()
