# SPDX-License-Identifier: BSD-3-Clause
"""What holds for every state of the framework, and for the one to begin with: found, documented, typed, explained."""

from __future__ import annotations

import ast
import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

from mbf_method.create_method import create_method
from modular_framework_core.state_api.constructor_keys import STATE_KEYS
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_checks import declared_types
from modular_framework_core.state_api.option_types import AnyOf, Anything, ListOf, MappingOf, OptionType, ScalarType
from modular_framework_core.task_constructor.explanation import explain, option_meanings
from modular_framework_core.task_constructor.loading import load_state_class
from modular_framework_core.task_constructor.pipeline import main as check_task
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue

ROOT = Path(__file__).parents[3]
STATES = ROOT / "src" / "modular_framework_states" / "src" / "modular_framework_states" / "states"
EXAMPLES = ROOT / "docs" / "examples"
TEMPLATES = ROOT / "src/modular_framework_core/templates"
CATALOGUE = StateCatalogue([STATES, EXAMPLES])
METHODS = ("my_grasp_method", "my_planner", "my_planner_table", "my_policy")  # examples that are no states
NAMES = [name for name in CATALOGUE.names() if not name.startswith("test_") and name not in METHODS]
EXPECTED = {
    "wait_for_signal",
    "select",
    "plan",
    "plan_place",
    "move",
    "grasp",
    "generate_grasps",
    "next_in_region",
    "next_in_tower",
    "allow_manipulator_collisions",
    "execute_trajectory",
    "cartesian_move",
    "gripper",
    "call_service",
    "call_action",
    "wait",
    "wait_for_message",
    "counter",
    "reinitialise_managers",
    "store",
    "load",
    "spawn_object",
    "delete_object",
    "set_planner",
    "log_metric",
    "release",
    "run_policy",
}


def test_all_promised_states_are_there() -> None:
    assert set(NAMES) == EXPECTED | {"my_state"}


@pytest.mark.parametrize("name", NAMES)
def test_it_is_one_class_in_a_file_that_bears_its_name(name: str) -> None:
    source = CATALOGUE.get(name)
    tree = ast.parse(source.file.read_text())
    assert [node.name for node in tree.body if isinstance(node, ast.ClassDef)] == [source.class_name]


@pytest.mark.parametrize("name", NAMES)
def test_it_has_the_keys_of_every_state_and_two_outcomes(name: str) -> None:
    source = CATALOGUE.get(name)
    assert list(source.options)[-4:] == list(STATE_KEYS)
    assert source.default_names("outcomes") == ("success", "fail")
    assert all(source.default_names(key) is not None for key in STATE_KEYS)


@pytest.mark.parametrize("name", NAMES)
def test_every_option_has_a_type_and_a_meaning(name: str) -> None:
    source = CATALOGUE.get(name)
    meanings = option_meanings(source.doc)
    for option in source.options.values():
        assert meanings.get(option.name), f"{name}: {option.name} is not in the docstring"
        assert not isinstance(option.type, Anything), f"{name}: {option.name} has no type a task can be checked against"
    assert set(meanings) == set(source.options)
    assert all(f"  {name}: " in explain(source) for name in source.options if name not in STATE_KEYS)


def parts(kind: OptionType) -> list[OptionType]:
    """Return a type and all it consists of."""
    inner = (
        kind.types
        if isinstance(kind, AnyOf)
        else (kind.item,)
        if isinstance(kind, ListOf)
        else ((kind.value,) if isinstance(kind, MappingOf) else ())
    )
    return [kind, *(part for item in inner for part in parts(item))]


@pytest.mark.parametrize("name", NAMES)
def test_every_number_says_its_limits(name: str) -> None:
    unlimited = [
        option.name
        for option in CATALOGUE.get(name).options.values()
        for part in parts(option.type)
        if isinstance(part, ScalarType) and part.kind in ("float", "int") and part.limits is None
    ]
    assert unlimited == []


@pytest.mark.parametrize("name", NAMES)
def test_the_state_itself_holds_to_what_a_task_is_checked_by(name: str) -> None:
    source = CATALOGUE.get(name)
    state = load_state_class(str(source.file), source.class_name)
    declared = {option: kind for option, kind in declared_types(state.__init__).items() if option != "return"}
    assert declared == {option.name: option.type for option in source.options.values()}


@pytest.mark.parametrize("name", sorted(EXPECTED))
def test_it_is_a_framework_state_that_does_nothing_while_it_is_imported(name: str) -> None:
    module = importlib.import_module(f"modular_framework_states.states.{name}")
    state = getattr(module, CATALOGUE.get(name).class_name)
    assert issubclass(state, FrameworkState)
    assert "execute" in vars(state)
    source = inspect.getsource(state.execute)
    ends = "self.fail(" in source and "self.succeed()" in source
    assert (
        ends
        or "_run" in source
        or "run_to_end(self," in source
        or "self._end(" in source
        or ("end_by_response(self," in source)
        or name in {"wait"}
    )


def test_the_state_to_begin_with_passes_its_own_test() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", str(EXAMPLES / "test_my_state.py")],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_the_task_of_a_created_policy_is_in_order_and_its_options_are_checked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    task = create_method("mine", "policy", tmp_path) / "task.yaml"
    arguments = [str(task), str(STATES), str(TEMPLATES), "--check"]
    assert check_task(arguments) == 0, capsys.readouterr().err
    task.write_text(task.read_text().replace("rate: 20 ", "rate: 0 ").replace("actions: positions", "actions: poses"))
    assert check_task(arguments) == 1
    found = capsys.readouterr().err
    assert "a number above 0" in found
    assert "'positions', 'velocities', 'deltas'" in found
