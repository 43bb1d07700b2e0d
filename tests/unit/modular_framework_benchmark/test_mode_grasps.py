# SPDX-License-Identifier: BSD-3-Clause
"""The mode that runs grasp generation alone: what is found, what of it is reachable, and what is refused."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from experiment_texts import FakeResources

from modular_framework_benchmark.commands.mode_runners import known_metrics, runner_factory
from modular_framework_benchmark.experiments.design import plan_episodes
from modular_framework_benchmark.experiments.experiment import Experiment
from modular_framework_benchmark.experiments.experiment_file import read_experiment
from modular_framework_benchmark.experiments.grasps_mode import GraspSettings
from modular_framework_benchmark.experiments.modes import MODES
from modular_framework_benchmark.experiments.reading import ExperimentFault
from modular_framework_benchmark.modes.ros_grasp_runner import GraspEpisodeRunner
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.episode_settings import PlacedObject

TOP_DOWN, ANTIPODAL = (
    "top_down_grasps.ros_top_down_node:TopDownMethod",
    "antipodal_grasps.ros_antipodal_node:AntipodalMethod",
)
ROOT = Path(__file__).parents[3]
EXTERNAL = "external_grasps.ros_external_node:ExternalMethod"
METRICS = ("success", "generation_time", "candidates", "reachable_share", "best_rank")
GRASPS = """
experiment: grasps
mode: grasps
robot: some_moveit_config
group: arm
gripper_joint: finger
method: $method
objects:
  - {model: cube, x: [0.4, 0.5], y: 0.0, rests_at: 0.0}
  - {model: can, name: beside, x: 0.2, y: 0.3, rests_at: 0.0}
factors:
  method: [a.b:First, a.b:Second]
compare: method
trials: 3
metrics: [success, candidates, best_rank]
time_limit: 60
"""


@pytest.fixture(scope="module")
def runner() -> GraspEpisodeRunner:
    return GraspEpisodeRunner()


def at(name: str, file: Path, ahead: float, aside: float, above: float) -> PlacedObject:
    """Returns an object; the base of the robot is at z = 0.86 m, and it looks along y."""
    return PlacedObject(name, str(file), aside, ahead, 0.86 + above, yaw=0.3)


def generate(runner: GraspEpisodeRunner, folder: Path, objects: list[PlacedObject], **changes: Any) -> EpisodeRecord:
    settings = GraspSettings(
        robot="panda_hand_moveit_config", group="panda_manipulator", gripper_joint="panda_finger_joint1",
        method=TOP_DOWN, objects=tuple(objects), target=objects[0].name, max_checks=6, metrics=METRICS,
    )  # fmt: skip
    return runner.run(EpisodeSpec(0, {}, 0, 1, replace(settings, **changes)), folder)


def model(folder: Path, name: str, shape: str) -> Path:
    file = folder / name / "model.sdf"
    file.parent.mkdir()
    file.write_text(
        f'<sdf version="1.5"><model name="{name}"><link name="link"><collision name="c"><geometry>{shape}</geometry>'
        "</collision></link></model></sdf>"
    )
    return file


@pytest.fixture
def cube(tmp_path: Path) -> Path:
    return model(tmp_path, "cube", "<box><size>0.04 0.04 0.06</size></box>")


@pytest.mark.parametrize("method", [TOP_DOWN, ANTIPODAL])
def test_either_method_finds_reachable_grasps_of_a_cube_in_front_of_the_robot(
    runner: GraspEpisodeRunner, tmp_path: Path, cube: Path, method: str
) -> None:
    record = generate(runner, tmp_path, [at("cube", cube, 0.45, 0.0, 0.1)], method=method)
    assert record.status is EpisodeStatus.SUCCEEDED, record.cause
    assert record.metrics["candidates"] >= 2
    assert 0.0 < record.metrics["reachable_share"] <= 1.0
    assert record.metrics["best_rank"] >= 1
    assert 0.0 < record.metrics["generation_time"] <= record.wall_s


def test_grasps_of_an_object_far_away_are_found_but_out_of_reach(
    runner: GraspEpisodeRunner, tmp_path: Path, cube: Path
) -> None:
    record = generate(runner, tmp_path, [at("cube", cube, 3.0, 0.0, 0.1)])
    assert (record.status, record.outcome) == (EpisodeStatus.FAILED, "out_of_reach")
    assert record.metrics["candidates"] >= 2
    assert record.metrics["reachable_share"] == 0.0
    assert record.metrics["best_rank"] is None and record.metrics["generation_time"] is None


def test_an_object_that_is_in_the_way_makes_grasps_unreachable(
    runner: GraspEpisodeRunner, tmp_path: Path, cube: Path
) -> None:
    lid = model(tmp_path, "lid", "<box><size>0.3 0.3 0.02</size></box>")
    objects = [at("cube", cube, 0.45, 0.0, 0.1), at("lid", lid, 0.45, 0.0, 0.17)]
    record = generate(runner, tmp_path, objects)
    assert (record.status, record.outcome) == (EpisodeStatus.FAILED, "out_of_reach")


def test_an_object_wider_than_the_hand_opens_cannot_be_grasped(runner: GraspEpisodeRunner, tmp_path: Path) -> None:
    crate = model(tmp_path, "crate", "<box><size>0.12 0.12 0.05</size></box>")
    record = generate(runner, tmp_path, [at("crate", crate, 0.5, 0.0, 0.03)])
    assert (record.status, record.outcome) == (EpisodeStatus.FAILED, "no_grasp")
    assert record.cause == "no part of it can be grasped from above"
    assert record.metrics["candidates"] == 0


def test_a_seed_repeats_what_is_found(runner: GraspEpisodeRunner, tmp_path: Path, cube: Path) -> None:
    metrics = ("candidates", "reachable_share", "best_rank")
    scene = [at("cube", cube, 0.45, 0.1, 0.1)]
    one, again = (generate(runner, tmp_path, scene, method=ANTIPODAL, metrics=metrics) for _ in range(2))
    assert one.metrics == again.metrics


@pytest.mark.parametrize(
    ("settings", "cause"),
    [
        ({"method": "top_down_grasps"}, "MODULE:CLASS of a grasp method"),
        ({"method": "no_such_package:Method"}, "cannot be imported (No module named 'no_such_package')"),
        ({"method_parameters": {"yaw_stp": 0.1}}, "the method has no 'yaw_stp'; allowed: approach_distance"),
        ({"method_parameters": {"yaw_step": 9.0}}, "'yaw_step' is 9.0; allowed: a number, at least 0.02"),
        ({"gripper_joint": "no_joint"}, "gripper_joint 'no_joint':"),
        ({"group": "legs"}, "legs"),
    ],
)
def test_settings_that_cannot_be_used_break_the_episode_and_say_what_is_allowed(
    runner: GraspEpisodeRunner, tmp_path: Path, cube: Path, settings: dict[str, Any], cause: str
) -> None:
    record = generate(runner, tmp_path, [at("cube", cube, 0.45, 0.0, 0.1)], **settings)
    assert record.status is EpisodeStatus.BROKEN
    assert cause in record.cause


SLOW_METHOD = """
import sys
import time

sys.path.append({package!r})

while time.process_time() < 2.0:
    pass

from my_grasp_method import narrow_grasps
from mbf_method import grasp_method

queries = []


@grasp_method
def slow_grasps(request):
    end_s = time.process_time() + (0.1 if queries else 2.0)  # slow at first, as with lazy imports
    queries.append(request)
    while time.process_time() < end_s:
        pass
    return narrow_grasps(request)


slow_grasps.serve()
"""


def test_the_process_of_a_method_is_kept_and_warm_and_its_processor_time_is_measured(
    tmp_path: Path, cube: Path
) -> None:
    runner = GraspEpisodeRunner()
    example = ROOT / "docs/examples/my_grasp_method.py"
    (tmp_path / "my_grasp_method.py").write_text(example.read_text())
    (tmp_path / "slow_grasps.py").write_text(SLOW_METHOD.format(package=str(ROOT / "src/mbf_method/src")))
    command = [sys.executable, str(tmp_path / "slow_grasps.py")]

    def processes() -> list[psutil.Process]:
        return [each for each in psutil.Process().children(recursive=True) if each.cmdline() == command]

    records, kept = [], []
    for _ in range(2):
        external = {"method": EXTERNAL, "method_parameters": {"command": command}}
        objects = [at("cube", cube, 0.45, 0.0, 0.1)]
        records.append(generate(runner, tmp_path, objects, metrics=("method_processor_time",), **external))
        kept += processes()
    runner.close()
    assert [record.status for record in records] == [EpisodeStatus.SUCCEEDED] * 2, records[0].cause
    assert len(kept) == 2 and kept[0] == kept[1] and not processes()
    for record in records:
        assert 0.08 <= record.metrics["method_processor_time"] < 2.0  # the kernel counts a running thread a tick late
    (name,) = set(records[0].snapshot["methods"]) - {"external_grasps"}
    assert name.endswith(f"{tmp_path.name}/slow_grasps.py")
    assert len(records[0].snapshot["methods"][name]["sources"]) == 64


def test_the_processor_time_of_a_method_within_the_process_is_measured(
    runner: GraspEpisodeRunner, tmp_path: Path, cube: Path
) -> None:
    record = generate(runner, tmp_path, [at("cube", cube, 0.45, 0.0, 0.1)], metrics=("method_processor_time",))
    assert 0.0 < record.metrics["method_processor_time"] < 10.0


def read(text: str, folder: Path) -> Experiment:
    return read_experiment(text, folder / "grasps.yaml", FakeResources(folder / "models"), known_metrics())


def test_the_methods_of_an_experiment_meet_the_same_scenes(tmp_path: Path) -> None:
    episodes = plan_episodes(read(GRASPS, tmp_path))
    assert len(episodes) == 6
    by_trial = [[spec.settings_of(GraspSettings) for spec in episodes if spec.trial == trial] for trial in range(3)]
    for first, second in by_trial:
        assert first.objects == second.objects and first.method != second.method
        assert first.target == "cube_1" and first.max_checks == 40
        assert Path(first.objects[0].model).is_file()
    assert len({settings[0].objects[0].x for settings in by_trial}) == 3
    assert np.isclose(by_trial[0][0].objects[0].z, 0.031)


def test_an_unknown_target_and_a_missing_robot_are_faults_of_the_file(tmp_path: Path) -> None:
    with pytest.raises(ExperimentFault, match="besides"):
        read(GRASPS.replace("method: $method", "method: $method\ntarget: besides"), tmp_path)
    with pytest.raises(ExperimentFault, match="mode grasps needs the key 'robot'"):
        read(GRASPS.replace("robot: some_moveit_config\n", ""), tmp_path)


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_that_an_experiment_may_have_has_a_runner(mode: str) -> None:
    assert callable(runner_factory(mode))
    assert known_metrics()[mode]
