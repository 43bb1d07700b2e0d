# SPDX-License-Identifier: BSD-3-Clause
"""The episodes of an experiment: paired scenes and seeds, a random order, the same for the same file."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from pathlib import Path

import pytest
from experiment_texts import PICK, read
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_benchmark.experiments.design import digest_of, plan_episodes
from modular_framework_benchmark.experiments.distributions import Choice, Normal, Uniform, generator_of
from modular_framework_benchmark.experiments.modes import stored_settings
from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.episode_settings import as_json


def laid_out(text: str, folder: Path) -> tuple[list[EpisodeSpec], str]:
    experiment = read(text, folder)
    episodes = plan_episodes(experiment)
    return episodes, digest_of(experiment, episodes)


def test_every_combination_has_every_trial_once(tmp_path: Path) -> None:
    episodes, _ = laid_out(PICK, tmp_path)
    assert [one.number for one in episodes] == list(range(48))
    assert len({one.key for one in episodes}) == 48 == 6 * 2 * 2 * 2


def test_the_methods_of_a_pair_have_the_same_scene_and_seed_and_other_pairs_others(tmp_path: Path) -> None:
    pairs = defaultdict(list)
    for one in laid_out(PICK, tmp_path)[0]:
        pairs[one.trial, one.configuration["planner"], one.configuration["object"]].append(one)
    assert len(pairs) == 24
    for first, second in pairs.values():
        assert {first.configuration["method"], second.configuration["method"]} == {"above", "aside"}
        assert first.seed == second.seed and first.settings.objects == second.settings.objects
    assert len({pair[0].seed for pair in pairs.values()}) == 24
    assert len({pair[0].settings.objects[0].x for pair in pairs.values()}) == 24


def test_the_same_file_gives_the_same_episodes_and_digest_in_any_folder(tmp_path: Path) -> None:
    first, digest = laid_out(PICK, tmp_path / "one")
    second, again = laid_out("# a comment\n" + PICK, tmp_path / "two")
    assert digest == again
    assert [(one.key, one.seed, one.settings.objects) for one in first] == [
        (one.key, one.seed, one.settings.objects) for one in second
    ]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("trials: 6", "trials: 7"),
        ("time_limit: 60", "time_limit: 61"),
        ("rests_at: 0.8", "rests_at: 0.81"),
        ("PRM", "RRT"),
    ],
)
def test_the_digest_changes_with_what_decides_the_episodes(old: str, new: str, tmp_path: Path) -> None:
    assert laid_out(PICK, tmp_path)[1] != laid_out(PICK.replace(old, new), tmp_path)[1]
    assert laid_out(PICK, tmp_path)[1] == laid_out(PICK + "workers: 4\n", tmp_path)[1]


def test_the_digest_changes_with_the_task_and_the_users_metric(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def own(episode):\n    return 1.0\n")
    text = PICK.replace("task_time]", "mine.py:own]")
    before = laid_out(text, tmp_path)[1]
    (tmp_path / "mine.py").write_text("def own(episode):\n    return 2.0\n")
    assert laid_out(text, tmp_path)[1] != before


def test_more_trials_leave_the_episodes_of_the_first_ones_as_they_are(tmp_path: Path) -> None:
    few, more = laid_out(PICK, tmp_path)[0], laid_out(PICK.replace("trials: 6", "trials: 9"), tmp_path)[0]
    assert [(one.number, one.key, one.seed, one.settings) for one in few] == [
        (one.number, one.key, one.seed, one.settings) for one in more[:48]
    ]


def test_trials_are_run_one_after_the_other_with_the_methods_in_a_random_order(tmp_path: Path) -> None:
    episodes = laid_out(PICK.replace("trials: 6", "trials: 40"), tmp_path)[0]
    assert [one.trial for one in episodes] == sorted(one.trial for one in episodes)
    first = [one.configuration["method"] for one in episodes[::8]]
    assert 8 < first.count("above") < 32


def test_episodes_that_can_share_a_stack_are_neighbours(tmp_path: Path) -> None:
    for text, length in ((PICK, 2), (PICK + "block: 3\n", 6)):
        episodes = laid_out(text, tmp_path)[0]
        stacks = [(one.configuration["method"], one.configuration["planner"]) for one in episodes]
        for begin in range(0, len(stacks), length):
            assert len(set(stacks[begin : begin + length])) == 1


def test_the_settings_are_the_same_when_they_are_read_from_their_json_values(tmp_path: Path) -> None:
    for one in laid_out(PICK, tmp_path)[0]:
        content = json.loads(json.dumps(as_json(one.settings)))
        assert stored_settings("task", content) == one.settings and as_json(one.settings) == content
        assert content["objects"][0].keys() == {"name", "model", "x", "y", "z", "roll", "pitch", "yaw"}
        assert content["success"] == {"lifted": 0.1}, "what the file does not say is not stored"
        assert stored_settings("task", content | {"of_another_version": 1}) == one.settings


def test_an_object_stands_on_its_surface_however_it_is_turned(tmp_path: Path) -> None:
    lying = PICK.replace("[cube, ball]", "[cube, ball, can]").replace("yaw: {normal: [0, 1]}", f"roll: {math.pi / 2}")
    heights = {one.settings.objects[0].model: one.settings.objects[0].z for one in laid_out(lying, tmp_path)[0]}
    assert heights == pytest.approx({"cube": 0.8 + 0.001 + 0.02, "ball": 0.8 + 0.001 + 0.05, "can": 0.8 + 0.001 + 0.02})
    upright = {one.settings.objects[0].z for one in laid_out(PICK.replace("[cube, ball]", "[can]"), tmp_path)[0]}
    assert upright == {0.851}


@given(low=st.floats(-10, 10), size=st.floats(0, 10), key=st.integers())
def test_a_number_of_a_range_is_inside_it_and_the_same_for_the_same_key(low: float, size: float, key: int) -> None:
    found = Uniform(low, low + size).draw(generator_of(key, "x"))
    assert low - 1e-6 <= found <= low + size + 1e-6
    assert found == Uniform(low, low + size).draw(generator_of(key, "x"))


def test_distributions_have_their_means_and_spreads() -> None:
    normal = [Normal(2.0, 0.5).draw(generator_of(key)) for key in range(4000)]
    mean = sum(normal) / len(normal)
    assert mean == pytest.approx(2.0, abs=0.04)
    assert math.sqrt(sum((one - mean) ** 2 for one in normal) / len(normal)) == pytest.approx(0.5, abs=0.03)
    chosen = [Choice((1.0, 2.0)).draw(generator_of(key)) for key in range(1000)]
    assert set(chosen) == {1.0, 2.0} and 420 < chosen.count(1.0) < 580
