# SPDX-License-Identifier: BSD-3-Clause
"""Modules are loaded by path, and the machine in them is found."""

from __future__ import annotations

from pathlib import Path

import pytest

import smach
from modular_framework_core.task_constructor import loading

MACHINE = "import smach\nclass A(smach.StateMachine):\n    def __init__(self):\n        super().__init__(['done'])\n"


def module(folder: Path, text: str) -> object:
    file = folder / "m.py"
    file.write_text(text)
    return loading.load_module(file)


def test_a_module_is_loaded_once(tmp_path: Path) -> None:
    assert module(tmp_path, "x = []") is loading.load_module(tmp_path / "m.py")


def test_loading_leaves_nothing_beside_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.dont_write_bytecode", False)
    module(tmp_path, "x = 1")
    assert [file.name for file in tmp_path.iterdir()] == ["m.py"]


def test_the_function_create_state_machine_comes_first(tmp_path: Path) -> None:
    found = module(tmp_path, MACHINE + "def create_state_machine():\n    return 'made'\n")
    assert loading.machine_factory(found)() == "made"  # type: ignore[arg-type]


def test_without_it_the_last_container_class_is_taken(tmp_path: Path) -> None:
    found = module(tmp_path, MACHINE + "class B(A):\n    pass\n")
    made = loading.machine_factory(found)()  # type: ignore[arg-type]
    assert isinstance(made, smach.StateMachine) and type(made).__name__ == "B"


@pytest.mark.parametrize(
    ("text", "message"),
    [("x = 1", "defines neither"), ("1 / 0", "raised ZeroDivisionError"), ("class (:", "raised SyntaxError")],
)
def test_what_cannot_be_run_is_reported(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(loading.LoadingError, match=message):
        loading.machine_factory(module(tmp_path, text))  # type: ignore[arg-type]


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(loading.LoadingError, match="gone.py"):
        loading.load_module(tmp_path / "gone.py")


def test_a_missing_state_class_is_named(tmp_path: Path) -> None:
    (tmp_path / "s.py").write_text("")
    with pytest.raises(loading.LoadingError, match="does not define the class S"):
        loading.load_state_class(str(tmp_path / "s.py"), "S")
