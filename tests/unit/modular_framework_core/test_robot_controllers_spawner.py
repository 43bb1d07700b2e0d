# SPDX-License-Identifier: BSD-3-Clause
"""What is read from a controller file and what is left to do for its controllers."""

from __future__ import annotations

from pathlib import Path

import pytest

from modular_framework_core.launching.robot_controllers_spawner import (
    ControllerFileError,
    SpawnPlan,
    plan_spawn,
    read_controller_file,
    with_joint_states,
)


def write(folder: Path, text: str) -> Path:
    path = folder / "controllers.yaml"
    path.write_text(text)
    return path


def test_keys_with_a_type_are_controllers_and_everything_is_kept_as_parameters(tmp_path: Path) -> None:
    path = write(tmp_path, "arm: {type: a/B, joints: [x]}\njoint_limits: {x: {max_velocity: 1.0}}\nhand: {type: c/D}\n")
    read = read_controller_file(path)
    assert read.controllers == ("arm", "hand")
    assert read.parameters["joint_limits"] == {"x": {"max_velocity": 1.0}}


def test_a_joint_state_controller_is_added_only_where_there_is_none(tmp_path: Path) -> None:
    arm = read_controller_file(write(tmp_path, "arm: {type: a/B, joints: [x]}\n"))
    added = with_joint_states(arm, ["a/B"])
    assert added.controllers == ("joint_state_controller", "arm")
    assert added.parameters["joint_state_controller"]["type"] == "joint_state_controller/JointStateController"
    assert with_joint_states(arm, ["joint_state_controller/JointStateController"]) is arm
    own = read_controller_file(write(tmp_path, "state: {type: mine/JointStateController}\n"))
    assert with_joint_states(own, []) is own


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("- arm\n", "expected a mapping"),
        ("", "expected a mapping"),
        ("arm: {type: [", "not valid YAML"),
        ("arm: {type: NoSlash}\n", "'arm/type' is 'NoSlash'"),
        ("arm: {joints: [x]}\n", "has a 'type'; add a controller"),
        ("1: {type: a/B}\n", "key 1 is not a name"),
        ("arm: !!python/object/apply:os.getcwd []\n", "not valid YAML"),
    ],
)
def test_a_file_that_cannot_be_used_is_explained(tmp_path: Path, text: str, words: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ControllerFileError) as caught:
        read_controller_file(path)
    assert words in str(caught.value) and str(path) in str(caught.value)


def test_a_missing_file_names_those_there_are(tmp_path: Path) -> None:
    write(tmp_path, "arm: {type: a/B}\n")
    with pytest.raises(ControllerFileError, match="beside it: controllers.yaml"):
        read_controller_file(tmp_path / "controller.yaml")


def test_only_what_is_missing_is_done() -> None:
    states = {"a": "running", "b": "stopped", "d": "running"}
    assert plan_spawn(["a", "b", "c"], states) == SpawnPlan(load=("c",), start=("b", "c"))
    assert plan_spawn(["a"], states) == SpawnPlan(load=(), start=())
