# SPDX-License-Identifier: BSD-3-Clause
"""Several objects of a model are placed apart, in a given size; what does not fit is refused before anything starts."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import trimesh
from experiment_texts import PICK, faults_of, read

from modular_framework_benchmark.commands.mode_runners import known_metrics, setting_checks
from modular_framework_benchmark.commands.ros_run_command import experiment_path, run_experiment
from modular_framework_benchmark.experiments.design import plan_episodes
from modular_framework_benchmark.experiments.experiment_file import read_experiment
from modular_framework_benchmark.experiments.reading import ExperimentFault
from modular_framework_benchmark.experiments.ros_resource_lookup import RosResourceLookup
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.records.episode_settings import PlacedObject
from modular_framework_description.add_object_command import main as add_object

BLOCKS = (
    "{model: cube, name: block, count: 4, size: $edge, spacing: 0.12, x: [-0.2, 0.2], y: [0.4, 0.6], rests_at: 0.8}"
)
TOWER = (
    PICK.replace(
        "{model: $object, x: [-0.2, 0.2], y: {choice: [0.4, 0.5]}, yaw: {normal: [0, 1]}, rests_at: 0.8}", BLOCKS
    )
    .replace("{lifted: 0.1}", "{stacked: {}}")
    .replace("object: [cube, ball]", "edge: [0.03, 0.09]")
)


def test_the_blocks_of_every_trial_are_in_their_ranges_and_apart(tmp_path: Path) -> None:
    episodes = plan_episodes(read(TOWER, tmp_path))
    assert len(episodes) == 48
    for episode in episodes:
        blocks: tuple[PlacedObject, ...] = episode.settings.objects
        assert [block.name for block in blocks] == ["block_1", "block_2", "block_3", "block_4"]
        assert all(-0.2 <= block.x <= 0.2 and 0.4 <= block.y <= 0.6 for block in blocks)
        for one, other in itertools.combinations(blocks, 2):
            assert math.dist((one.x, one.y), (other.x, other.y)) >= 0.12
        # the model is 0.04 x 0.04 x 0.06 m; the block begins 1 mm above the surface
        edge_m = float(episode.configuration["edge"])
        assert [block.scale for block in blocks] == pytest.approx([edge_m / 0.06] * 4, abs=1e-6)
        assert [block.z for block in blocks] == pytest.approx([0.801 + edge_m / 2] * 4, abs=2e-6)
    assert len({episode.settings.objects[0].x for episode in episodes}) == 24  # equal for both methods alone


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("count: 4", "count: 0", "count must be a whole number from 1 to 50, found the number 0"),
        ("count: 4", "count: 2.5", "count must be a whole number from 1 to 50, found the number 2.5"),
        ("count: 4", "count: 1", "stacked needs at least two objects, the lowest first; add one"),
        ("count: 4", "count: 20", r"'block_\d+' does not fit: no pose in 1000 draws is 0.12 m from the \d+ objects"),
        ("spacing: 0.12", "spacing: 0.08", "could overlap; allowed: at least the diagonal of the model, 0.085 m"),
        ("spacing: 0.12, ", "", "4 objects with a spacing of 0 m could overlap"),
        ("spacing: 0.12", "spacing: -1", "spacing must be a number from 0 to 10, found the number -1"),
        ("size: $edge", "size: 0", "size is 0 to 0 m; allowed: more than 0, up to 2 m"),
        ("size: $edge", "size: [0.04, 3]", "size is 0.04 to 3 m; allowed: more than 0, up to 2 m"),
        ("size: $edge", "size: big", "size must be a number, "),
        ("{stacked: {}}", "{stacked: {objects: [block_1, block_5]}}", "'block_5'.*did you mean 'block_"),
    ],
)  # fmt: skip
def test_a_wrong_number_size_or_name_is_refused(tmp_path: Path, old: str, new: str, fault: str) -> None:
    found = faults_of(TOWER.replace(old, new), tmp_path)
    assert any(re.search(fault, one) for one in found), found


def test_the_figures_of_the_grasp_are_about_the_first_block_that_must_be_lifted(tmp_path: Path) -> None:
    lifted = "progress: [{lifted: {object: block_2}}, {stacked: {}}, {lifted: {object: block_3}, name: last}]\n"
    (first, *_) = plan_episodes(read(TOWER + lifted, tmp_path))
    assert first.settings_of(TaskSettings).judged_object == "block_2"
    (first, *_) = plan_episodes(read(TOWER, tmp_path))
    assert first.settings_of(TaskSettings).judged_object == "block_1"


OWN_OBJECT = """
experiment: own_object
mode: task
task: simulation_pick.yaml
arguments: {world_file: ur5_table.world}
objects: [{model: bracket_of_lab, x: [-0.2, 0.2], y: 0.5, rests_at: 0.84}]
success: {lifted: 0.1}
parameters: {/planner_name: $planner}
factors: {planner: [RRTConnect, RRT]}
compare: planner
trials: 2
"""


def test_an_experiment_takes_an_added_object_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh, file = tmp_path / "bracket_of_lab.stl", tmp_path / "own_object.yaml"
    trimesh.creation.box(extents=(0.04, 0.06, 0.1)).export(mesh)
    assert add_object([str(mesh), "--mass", "0.2", "--directory", str(tmp_path / "lab")]) == 0
    file.write_text(OWN_OBJECT)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GAZEBO_MODEL_PATH", raising=False)
    assert run_experiment([str(file), "--dry-run"]) == 2
    assert "there is no model 'bracket_of_lab'" in capsys.readouterr().err
    monkeypatch.setenv("GAZEBO_MODEL_PATH", str(tmp_path / "lab"))
    assert run_experiment([str(file), "--dry-run"]) == 0, capsys.readouterr().err
    output = capsys.readouterr().out
    assert "own_object: 4 episodes" in output


@cache
def checks() -> Mapping[str, Any]:
    """The checks of the settings; the loaded robots are cached."""
    return setting_checks()


@pytest.mark.parametrize(("robot", "opening"), [("modular_framework_api", 0.142), ("panda_hand_robot", 0.08)])
def test_the_shipped_tower_fits_each_robot_and_a_block_wider_than_its_gripper_is_refused(
    robot: str, opening: float
) -> None:
    file = experiment_path(Path("stack_blocks.yaml"))
    arguments = (file, RosResourceLookup(), known_metrics(), checks())
    launch = f"{robot}/start_framework.launch"
    experiment = read_experiment(file.read_text(), *arguments, launch=launch)
    assert [len(one.objects) for one in experiment.combinations] == [2, 2, 3, 3] * 2
    too_wide = (
        file.read_text().replace("size: [0.04, 0.06]", f"size: [0.04, {opening - 0.005}]").replace("0.14,", "0.2,")
    )
    with pytest.raises(ExperimentFault) as refused:
        read_experiment(too_wide, *arguments, launch=launch)
    text = f"object 'block_2' is {opening - 0.005:.3f} m wide, and the gripper opens to {opening:.3f} m"
    assert text in str(refused.value) and f"allowed: at most {opening - 0.006:.3f} m" in str(refused.value)
