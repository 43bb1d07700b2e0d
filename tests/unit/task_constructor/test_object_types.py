# SPDX-License-Identifier: BSD-3-Clause
"""Types of objects that a task spawns are checked before the task runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from modular_framework_core.task_constructor.pipeline import main

TASK = """name: tiny
source: framework_state_machine
%s
outcomes: [done, gave_up]
states:
  - A: {source: spawn_object, object_type: %s, transitions: {success: done, fail: gave_up}}
"""
OWN_TYPE = "external_names: {object_type: [crate]}"


@pytest.mark.parametrize(("header", "object_type"), [("", "cube"), (OWN_TYPE, "crate")])
def test_types_with_a_model_or_declared_ones_are_taken(tmp_path: Path, header: str, object_type: str) -> None:
    (tmp_path / "tiny.yaml").write_text(TASK % (header, object_type))
    assert main([str(tmp_path / "tiny.yaml"), "--check"]) == 0


def test_a_type_without_a_model_is_refused_with_the_nearest_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "tiny.yaml"
    script.write_text(TASK % ("", "cubee"))
    assert main([str(script), "--check"]) == 1
    message = capsys.readouterr().err
    assert f"{script}:6:" in message and "the object type 'cubee' is unknown; allowed: ball, " in message
    assert message.rstrip().endswith("did you mean 'cube'?")


def test_a_model_in_a_folder_of_the_environment_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = tmp_path / "lab" / "brick_of_lab" / "model.sdf"
    model.parent.mkdir(parents=True)
    model.touch()
    (tmp_path / "tiny.yaml").write_text(TASK % ("", "brick_of_lab"))
    assert main([str(tmp_path / "tiny.yaml"), "--check"]) == 1
    monkeypatch.setenv("GAZEBO_MODEL_PATH", f"/nowhere:{tmp_path / 'lab'}")
    assert main([str(tmp_path / "tiny.yaml"), "--check"]) == 0


def test_a_package_without_models_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "tiny.yaml").write_text(TASK % ("", "cube"))
    for package in ("no_such_package", "modular_framework_core"):
        assert main([str(tmp_path / "tiny.yaml"), "--check", "--description", package]) == 1
        assert f"package '{package}' is not found, or has no folder models" in capsys.readouterr().err
