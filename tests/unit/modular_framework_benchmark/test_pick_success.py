# SPDX-License-Identifier: BSD-3-Clause
"""The shipped experiment of picks, and which of its episodes `benchmarks/pick_success` runs."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import sys
from argparse import Namespace
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from modular_framework_benchmark.experiments.reading import ExperimentFault
from modular_framework_benchmark.records.episode import EpisodeSpec

SCRIPT = Path(__file__).resolve().parents[3] / "benchmarks" / "pick_success"
DEFAULTS: dict[str, Any] = {
    "episodes": 8,
    "seed": 1,
    "first": 0,
    "quick": False,
    "robot": "modular_framework_api",
    "launch": [],
    "timeout": 240.0,
    "object": None,
}


@pytest.fixture(scope="module")
def chosen() -> Callable[..., list[EpisodeSpec]]:
    """Returns the episodes that the script runs with some options."""
    loader = importlib.machinery.SourceFileLoader("pick_success_benchmark", str(SCRIPT))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.path.append(str(SCRIPT.parent))
    loader.exec_module(module)
    return lambda **options: module.chosen_episodes(Namespace(**DEFAULTS | options))[1]


def poses(episodes: list[EpisodeSpec]) -> list[tuple[float, ...]]:
    return [(placed.x, placed.y, placed.yaw) for one in episodes for placed in one.settings.objects]


@pytest.mark.parametrize("rounds", [1, 2])
def test_every_object_is_picked_equally_often_each_time_at_another_pose(
    chosen: Callable[..., list[EpisodeSpec]], rounds: int
) -> None:
    episodes = chosen(episodes=10 * rounds)
    models = Counter(one.settings.objects[0].model for one in episodes)
    assert len(models) == 10 and set(models.values()) == {rounds}
    assert len(set(poses(episodes))) == 10 * rounds


def test_the_seed_decides_the_poses(chosen: Callable[..., list[EpisodeSpec]]) -> None:
    assert poses(chosen()) == poses(chosen())
    assert not set(poses(chosen())) & set(poses(chosen(seed=2)))


def test_episodes_of_one_object_or_from_a_number_on_are_those_of_the_whole_run(
    chosen: Callable[..., list[EpisodeSpec]],
) -> None:
    whole = chosen(episodes=20)
    assert chosen(episodes=20, first=17) == whole[17:]
    cans = chosen(episodes=2, object="can")
    assert [one.configuration["object"] for one in cans] == ["can", "can"]
    assert cans == [one for one in whole if one.configuration["object"] == "can"][:2]
    assert chosen(episodes=20, first=4, quick=True) == whole[4:5]


def test_robot_time_limit_and_launch_arguments_are_those_of_the_options(
    chosen: Callable[..., list[EpisodeSpec]],
) -> None:
    given = {"robot": "panda_hand_robot", "timeout": 60.0, "launch": ["world_file:=no.world", "urdf_args:=a:=1"]}
    (episode,) = chosen(episodes=1, **given)
    assert episode.settings.launch == "panda_hand_robot/start_framework.launch"
    assert episode.settings.time_limit == 60.0
    assert episode.settings.arguments["world_file"] == "no.world"
    assert episode.settings.arguments["urdf_args"] == "a:=1"
    assert episode.settings.arguments["method_launch_file"] == "top_down_grasps/top_down_grasps.launch"


def test_another_task_is_checked_before_anything_starts(chosen: Callable[..., list[EpisodeSpec]]) -> None:
    (episode,) = chosen(episodes=1, launch=["task_constructor_script:=pick_and_hold.yaml"])
    assert Path(episode.settings.task).name == "pick_and_hold.yaml"
    with pytest.raises(ExperimentFault, match="there is no task 'none.yaml'"):
        chosen(episodes=1, launch=["task_constructor_script:=none.yaml"])
