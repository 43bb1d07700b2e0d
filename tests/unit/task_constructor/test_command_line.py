# SPDX-License-Identifier: BSD-3-Clause
"""The command state_machine_generator: the original's four arguments, and --check."""
from __future__ import annotations

from pathlib import Path

import pytest
from task_folders import GOOD_TASK, TEMPLATES, write_states

from modular_framework_core.task_constructor.pipeline import directories_from, main


@pytest.fixture()
def arguments(tmp_path: Path) -> list[str]:
    (tmp_path / "t.yaml").write_text(GOOD_TASK)
    return [str(tmp_path / "t.yaml"), str(write_states(tmp_path)), str(TEMPLATES), str(tmp_path / "out")]


def test_four_arguments_write_the_module_and_tell_where(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 0
    written = Path(arguments[3]) / "tiny.py"
    assert written.is_file()
    assert capsys.readouterr().out.strip() == str(written)


def test_what_roslaunch_appends_is_ignored(arguments: list[str]) -> None:
    assert main([*arguments, "__name:=generator", "__log:=/dev/null"]) == 0


def test_check_writes_nothing(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*arguments[:3], "--check"]) == 0
    assert "task 'tiny' is in order, 2 states" in capsys.readouterr().out
    assert not Path(arguments[3]).exists()


def test_a_faulty_task_gives_1_its_faults_and_no_file(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path(arguments[0]).write_text(GOOD_TASK.replace("source: plan", "source: paln"))
    assert main(arguments) == 1
    captured = capsys.readouterr()
    assert f"{arguments[0]}:6:15: state 'A': source 'paln' is unknown" in captured.err
    assert not Path(arguments[3]).exists()


@pytest.mark.parametrize("position", [0, 1, 2])
def test_a_path_that_is_not_there_gives_1_and_is_named(
    arguments: list[str], position: int, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments[position] = "/nowhere/gone"
    assert main(arguments) == 1
    assert "/nowhere/gone" in capsys.readouterr().err


def test_several_directories_are_separated_by_colons() -> None:
    assert directories_from("/a:/b:") == [Path("/a"), Path("/b")]
    assert directories_from("") == []


def test_the_frameworks_own_folders_are_taken_when_none_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "t.yaml"
    script.write_text(
        "name: t\nsource: framework_state_machine\noutcomes: [done, gave_up]\nstates:\n"
        "  - A: {source: move, plan_name: p, transitions: {success: done, fail: gave_up}}\n"
    )
    assert main(["--check", str(script)]) == 0, capsys.readouterr().err
