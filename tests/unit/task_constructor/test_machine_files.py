# SPDX-License-Identifier: BSD-3-Clause
"""A machine in a file of its own: several tasks share it, with params of their own."""

from __future__ import annotations

import re
from pathlib import Path

import jsonschema
import pytest
import yaml
from task_folders import TEMPLATES, World

from modular_framework_core.task_constructor import generator
from modular_framework_core.task_constructor.json_schema import task_schema
from modular_framework_core.task_constructor.machine_files import machine_files
from modular_framework_core.task_constructor.task_spec import MachineSpec

MACHINE = """\
source: state_machine
outcomes: [there, lost]
params: {place: home, speed: 0.1}
states:
  - A: {source: plan, target: params.place, speed: params.speed, transitions: {success: there, fail: lost}}
"""
TASK = """\
name: tiny
source: state_machine
outcomes: [done, gave_up]
params: {place: hall}
states:
  - First:
      source: machines/go.yaml
      transitions: {there: Second, lost: gave_up}
  - Second:
      source: machines/go.yaml
      params: {place: work}
      transitions: {there: done, lost: gave_up}
"""


@pytest.fixture()
def task(tmp_path: Path) -> Path:
    """A task whose two machines are in the same file."""
    (tmp_path / "machines").mkdir()
    (tmp_path / "machines" / "go.yaml").write_text(MACHINE)
    (tmp_path / "tiny.yaml").write_text(TASK)
    return tmp_path / "tiny.yaml"


def test_a_machine_of_a_file_is_built_with_the_params_of_each_place(world: World, task: Path) -> None:
    built = world.build(TASK, str(task))
    assert [state.options for state in built.root.leaf_states()] == [
        {"target": "home", "speed": 0.1},
        {"target": "work", "speed": 0.1},
    ]
    first = built.root.states[0]
    assert isinstance(first, MachineSpec) and first.outcomes == ("there", "lost")
    assert first.transitions == {"there": "Second", "lost": "gave_up"}
    compile(generator.generate(built, [TEMPLATES]), "tiny.py", "exec")


def test_a_changed_file_gives_another_module_and_counts_as_a_file_of_the_task(world: World, task: Path) -> None:
    file = task.parent / "machines" / "go.yaml"
    before = generator.digest_line(world.build(TASK, str(task)), [TEMPLATES])
    assert machine_files(task) == (file,)
    file.write_text(MACHINE.replace("0.1", "0.2"))
    assert generator.digest_line(world.build(TASK, str(task)), [TEMPLATES]) != before


def test_a_fault_is_where_it_was_written(world: World, task: Path) -> None:
    (task.parent / "machines" / "go.yaml").write_text(MACHINE.replace("source: plan", "source: pln"))
    (fault, *others) = world.faults(TASK, str(task))
    assert "machines/go.yaml:5:" in fault and "did you mean 'plan'" in fault
    (task.parent / "machines" / "go.yaml").write_text(
        MACHINE.replace("params.place,", "params.place, kind: params.kind,")
    )
    wrong = TASK.replace("{place: work}", "{place: work, kind: pse}").replace("{place: hall}", "{kind: pose}")
    (fault,) = world.faults(wrong, str(task))
    assert "tiny.yaml:11:35: " in fault and "'pse'" in fault


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("machines/go.yaml", "machines/goo.yaml", "tiny.yaml:7:15: the machine cannot be read: .*go.yaml"),
        (
            "      params: {place",
            "      states: []\n      params: {place",
            "'Second' \\(machine of go.yaml\\): key 'states'",
        ),
        ("there: done", "their: done", "tiny.yaml:12:.*'their'"),
    ],
)
def test_a_wrong_reference_is_refused(world: World, task: Path, old: str, new: str, fault: str) -> None:
    found = world.faults(TASK.replace(old, new), str(task))
    assert any(re.search(fault, one) for one in found), found


def test_a_machine_that_contains_itself_is_refused(world: World, task: Path) -> None:
    file = task.parent / "machines" / "go.yaml"
    file.write_text(MACHINE.replace("{source: plan, target: params.place, speed: params.speed,", "{source: go.yaml,"))
    found = world.faults(TASK, str(task))
    assert found and all("the machine of go.yaml contains itself" in one for one in found)
    assert machine_files(task) == (file,)


def test_editors_accept_a_machine_of_a_file(world: World) -> None:
    validator = jsonschema.Draft7Validator(task_schema(world.states, world.templates))
    assert validator.is_valid(yaml.safe_load(TASK))
    assert not validator.is_valid(yaml.safe_load(TASK.replace("params: {place: work}", "outcomes: [there, lost]")))
