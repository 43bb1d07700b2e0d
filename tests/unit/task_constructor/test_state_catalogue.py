# SPDX-License-Identifier: BSD-3-Clause
"""States are found in folders and read without being run."""

from __future__ import annotations

from pathlib import Path

import pytest

from modular_framework_core.task_constructor.explanation import explain, option_meanings
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue, StateSourceError, class_name_of


def catalogue(folder: Path, **files: str) -> StateCatalogue:
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)
    return StateCatalogue([folder])


@pytest.mark.parametrize(("file", "name"), [("plan", "Plan"), ("wait_for_signal", "WaitForSignal")])
def test_the_class_name_is_the_camel_case_of_the_file_name(file: str, name: str) -> None:
    assert class_name_of(file) == name


def test_reading_a_state_does_not_run_its_file(tmp_path: Path) -> None:
    text = "open('/nowhere/at/all')\nclass Plan:\n    def __init__(self, a, b=1): pass\n"
    source = catalogue(tmp_path, plan=text).get("plan")
    assert list(source.options) == ["a", "b"]
    assert [option.required for option in source.options.values()] == [True, False]


def test_defaults_that_are_literals_are_known_and_others_are_not(tmp_path: Path) -> None:
    text = "class Plan:\n    def __init__(self, *, outcomes=('a', 'b'), io_keys=KEYS, output_keys=None): pass\n"
    source = catalogue(tmp_path, plan=text).get("plan")
    assert source.default_names("outcomes") == ("a", "b")
    assert source.default_names("io_keys") is None
    assert source.default_names("output_keys") == ()
    assert source.default_names("input_keys") == ()


def test_a_state_without_constructor_has_that_of_its_base(tmp_path: Path) -> None:
    source = catalogue(tmp_path, plan="class Plan(FrameworkState):\n    pass\n").get("plan")
    assert source.default_names("outcomes") == ("success", "fail")
    text = "class Base:\n    def __init__(self, a=1): pass\nclass Plan(Base):\n    pass\n"
    assert list(catalogue(tmp_path, plan=text).get("plan").options) == ["a"]


def test_a_state_has_the_constructor_of_a_base_in_another_module_of_its_package(tmp_path: Path) -> None:
    package = tmp_path / "my_states"
    (package / "states").mkdir(parents=True)
    for folder in (package, package / "states"):
        (folder / "__init__.py").touch()
    (package / "kinds.py").write_text("from typing import Literal\nKind = Literal['door', 'drawer']\n")
    (package / "doors.py").write_text(
        "from my_states.kinds import Kind\n"
        "class DoorState(FrameworkState):\n"
        '    """Base.\n\n    Args:\n        kind: What is moved.\n        **keys: Of any state.\n    """\n'
        "    DEFAULT_IO_KEYS = ('arm',)\n"
        "    def __init__(self, kind: Kind, **keys: Unpack[StateKeys]):\n        super().__init__(**keys)\n"
    )
    text = 'from my_states.doors import DoorState\nclass Open(DoorState):\n    """Opens it."""\n'
    source = catalogue(package / "states", open=text).get("open")
    assert list(source.options) == ["kind", "outcomes", "input_keys", "output_keys", "io_keys"]
    assert source.options["kind"].type.describe() == "one of 'door', 'drawer'"
    assert source.is_framework_state and not source.takes_any_option
    assert (source.default_names("outcomes"), source.default_names("io_keys")) == (("success", "fail"), ("arm",))
    assert "Opens it." in explain(source) and "Base." not in explain(source)
    assert option_meanings(source.doc)["kind"] == "What is moved."


def test_options_that_a_state_adds_to_those_of_its_imported_base_are_its_own(tmp_path: Path) -> None:
    (tmp_path / "doors.py").write_text(
        "class Doors(FrameworkState):\n    def __init__(self, kind, **keys: Unpack[StateKeys]): pass\n"
    )
    text = (
        "from doors import Doors as Base\n"
        "class Open(Base):\n    def __init__(self, width, **keys: Unpack[StateKeys]):\n"
        "        super().__init__('door', **keys)\n"
    )
    source = catalogue(tmp_path, open=text).get("open")
    assert list(source.options) == ["width", "outcomes", "input_keys", "output_keys", "io_keys"]
    assert not source.takes_any_option


@pytest.mark.parametrize("call", ["super().__init__(**keys)", "FrameworkState.__init__(self, **keys)"])
def test_the_keys_of_every_state_are_options_of_one_that_passes_them_on(tmp_path: Path, call: str) -> None:
    text = (
        "class Plan(FrameworkState):\n    DEFAULT_IO_KEYS = ('arm',)\n"
        f"    def __init__(self, a=1, **keys: Unpack[StateKeys]):\n        {call}\n"
    )
    source = catalogue(tmp_path, plan=text).get("plan")
    assert list(source.options) == ["a", "outcomes", "input_keys", "output_keys", "io_keys"]
    assert not source.takes_any_option
    assert source.default_names("outcomes") == ("success", "fail")
    assert (source.default_names("input_keys"), source.default_names("io_keys")) == ((), ("arm",))


def test_keys_that_a_constructor_changes_before_it_passes_them_on_are_not_known(tmp_path: Path) -> None:
    text = (
        "class Plan(FrameworkState):\n    def __init__(self, **keys: Unpack[StateKeys]):\n"
        "        keys['outcomes'] = ['a', 'b']\n        super().__init__(**keys)\n"
    )
    assert catalogue(tmp_path, plan=text).get("plan").default_names("outcomes") is None


def test_default_io_keys_are_those_of_the_class_before_those_of_its_base(tmp_path: Path) -> None:
    text = (
        "class Base(FrameworkState):\n    DEFAULT_IO_KEYS = ('arm',)\n"
        "class Plan(Base):\n    DEFAULT_IO_KEYS = ('hand',)\n"
        "class Move(Base):\n    pass\n"
    )
    found = catalogue(tmp_path, plan=text, move=text)
    assert [found.get(name).default_names("io_keys") for name in ("plan", "move")] == [("hand",), ("arm",)]


CALLS = {
    "smach.State.__init__(self, outcomes=['a', 'b'], input_keys=['x'], output_keys=('y',))": (
        ("a", "b"),
        ("x",),
        ("y",),
    ),
    "smach.State.__init__(self, ['a', 'b'], ['x'])": (("a", "b"), ("x",), ()),
    "super().__init__(outcomes, input_keys=NAMES)": (("success", "fail"), ("named",), ()),
    "super().__init__(list(outcomes), input_keys + ['more'])": (("success", "fail"), None, ()),
    "super().__init__(*arguments)": (None, None, None),
    "super().__init__(outcomes); self.register_input_keys(['z'])": (("success", "fail"), None, ()),
}


@pytest.mark.parametrize("call", CALLS)
def test_what_a_constructor_declares_itself_is_known(tmp_path: Path, call: str) -> None:
    text = (
        f"NAMES = ['named']\nclass Plan(smach.State):\n    def __init__(self, outcomes=('success', 'fail')):\n"
        f"        {call}\n"
    )
    source = catalogue(tmp_path, plan=text).get("plan")
    assert tuple(source.default_names(key) for key in ("outcomes", "input_keys", "output_keys")) == CALLS[call]


def test_a_base_from_elsewhere_leaves_the_options_open(tmp_path: Path) -> None:
    source = catalogue(tmp_path, plan="import x\nclass Plan(x.Y):\n    pass\n").get("plan")
    assert source.takes_any_option
    assert source.default_names("outcomes") is None


def test_files_that_begin_with_an_underscore_are_no_states(tmp_path: Path) -> None:
    assert catalogue(tmp_path, __init__="", _base="", plan="").names() == ["plan"]


def test_the_first_folder_that_has_a_name_wins(tmp_path: Path) -> None:
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "plan.py").write_text(f"class Plan:\n    def __init__(self, {folder}): pass\n")
    (tmp_path / "two" / "move.py").write_text("class Move: pass\n")
    found = StateCatalogue([tmp_path / "one", tmp_path / "two"])
    assert found.names() == ["move", "plan"]
    assert list(found.get("plan").options) == ["one"]


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="states directory .*gone is not a directory"):
        StateCatalogue([tmp_path / "gone"])


def test_a_file_without_the_class_says_which_classes_it_has(tmp_path: Path) -> None:
    with pytest.raises(StateSourceError, match="must define the class Plan .* it defines: no class"):
        catalogue(tmp_path, plan="").get("plan")
