# SPDX-License-Identifier: BSD-3-Clause
"""An episode of a LeRobot dataset is replayed as a policy, if its joints, units and rate match."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbf_method.errors import InvalidOutputError, MethodStartError
from mbf_method.observation import ActionSpec
from modular_framework_benchmark.results.lerobot_dataset import LeRobotWriter
from modular_framework_benchmark.results.lerobot_frames import ACTION, STATE, EpisodeFrames
from modular_framework_states.policy_gripper import PolicyGripper
from modular_framework_states.policy_replay import RecordedPolicy
from modular_framework_states.policy_settings import RecordedEpisode

JOINTS = ("finger", "elbow", "lift")
UNITS = {"elbow": "rad", "lift": "m", "finger": "rad"}
FRAMES, RATE = 10, 20


def dataset(folder: Path, *, units: dict[str, str] | None = None, factor: float = 1.0) -> Path:
    """Writes two episodes; the elbow reaches 0.9 and 1.8 rad, times a factor."""
    writer = LeRobotWriter(folder, RATE, "arm", UNITS if units is None else units)
    ramp = np.arange(FRAMES)[:, None] / 10.0
    for number in (1, 2):
        values = np.hstack([0.5 * ramp, number * factor * ramp, -0.1 * ramp]).astype(np.float32)
        names = {STATE: JOINTS, ACTION: JOINTS}
        writer.add(EpisodeFrames(0.0, {STATE: values, ACTION: values}, names), {}, "reach", succeeded=True)
    writer.close()
    return folder


def spec(*names: str, rate_hz: float = RATE) -> ActionSpec:
    free = np.full(len(names), np.inf)
    return ActionSpec("positions", names, 4, rate_hz, -free, free, free, free)


def started(folder: Path, number: int = 1, gripper: PolicyGripper | None = None) -> RecordedPolicy:
    policy = RecordedPolicy(RecordedEpisode(folder, number), UNITS, gripper)
    policy.start()
    return policy


def chunk(policy: RecordedPolicy, step: int, actions: ActionSpec) -> np.ndarray:
    return np.asarray(policy.call(SimpleNamespace(step=step, actions=actions)).message["actions"])


def test_an_episode_is_replayed_chunk_by_chunk_and_the_last_action_is_held(tmp_path: Path) -> None:
    policy, actions = started(dataset(tmp_path / "picks")), spec("lift", "elbow")
    assert chunk(policy, 0, actions)[:, 1] == pytest.approx([0.0, 0.2, 0.4, 0.6])
    assert chunk(policy, 4, actions)[:, 0] == pytest.approx([-0.04, -0.05, -0.06, -0.07])
    assert chunk(policy, 8, actions)[:, 1] == pytest.approx([1.6, 1.8, 1.8, 1.8])
    assert chunk(policy, 12, actions).shape == (0, 2)
    assert policy.source.address == "episode 1 of dataset picks"


def test_the_position_of_the_finger_becomes_the_fraction_of_the_gripper(tmp_path: Path) -> None:
    gripper = PolicyGripper({"finger": 0.0}, {"finger": 0.9}, None, 1.0)
    policy = started(dataset(tmp_path / "picks"), 0, gripper)
    assert chunk(policy, 6, spec("elbow", "gripper"))[:, 1] == pytest.approx([1 / 3, 0.35 / 0.9, 0.4 / 0.9, 0.5])


@pytest.mark.parametrize(
    ("written", "actions", "reason"),
    [
        ({}, spec("elbow", "wrist"), "its actions are finger, elbow, lift; the task needs wrist"),
        ({}, spec("elbow", rate_hz=10.0), "it has 20 actions per second, the task 10; set rate"),
        ({"units": {**UNITS, "elbow": "deg"}}, spec("elbow", "lift"), "elbow is in deg; it must be in rad"),
        ({"units": {}, "factor": 57.3}, spec("elbow"), "elbow reaches 103.1 and has no unit; .* in degrees"),
    ],
)
def test_joints_units_and_rate_that_do_not_match_are_named(
    tmp_path: Path, written: dict[str, Any], actions: ActionSpec, reason: str
) -> None:
    policy = started(dataset(tmp_path / "picks", **written))
    with pytest.raises(InvalidOutputError, match=f"episode 1 of dataset picks does not match: {reason}"):
        chunk(policy, 0, actions)


def test_a_dataset_without_units_is_replayed_if_its_angles_can_be_radians(tmp_path: Path) -> None:
    policy = started(dataset(tmp_path / "picks", units={}))
    assert chunk(policy, 0, spec("elbow"))[:, 0] == pytest.approx([0.0, 0.2, 0.4, 0.6])


def test_a_missing_episode_and_a_folder_of_another_format_are_named(tmp_path: Path) -> None:
    folder = dataset(tmp_path / "picks")
    with pytest.raises(MethodStartError, match="has no episode 2; its episodes are 0 to 1"):
        started(folder, 2)
    with pytest.raises(MethodStartError, match="FileNotFoundError.*name the folder of a LeRobot dataset"):
        started(tmp_path)
    info = json.loads((folder / "meta/info.json").read_text())
    (folder / "meta/info.json").write_text(json.dumps({**info, "codebase_version": "v2.1"}))
    with pytest.raises(MethodStartError, match="its format is v2.1; required: v3.0"):
        started(folder)


def test_the_digest_of_the_sources_changes_with_the_actions(tmp_path: Path) -> None:
    first = started(dataset(tmp_path / "first")).sources
    assert len(first) == 64 and started(dataset(tmp_path / "second")).sources == first
    assert started(dataset(tmp_path / "third", factor=1.01)).sources != first
