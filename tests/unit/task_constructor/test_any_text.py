# SPDX-License-Identifier: BSD-3-Clause
"""Whatever is in a task file: it is a task, or it is refused with faults; never anything else."""

from __future__ import annotations

import re
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from task_folders import GOOD_TASK, World

from modular_framework_core.files.faults import TaskFault
from modular_framework_core.task_constructor import generator

RICH = (
    GOOD_TASK.replace("states:", "params: {place: home, list: [a, b]}\nstates:")
    + """\
  - C:
      source: concurrent_state_machine
      outcomes: params.list
      userdata: self.userdata
      outcome_map: {a: {D: success}}
      transitions: {a: done, b: gave_up}
      states:
        - D: {source: plan, target: params.place, io_keys: [x]}
"""
)
SIGNS = ("&a ", "*a", "<<: ", "!!int ", "|\n", "? ", "- ", "{", "\x85", "\\", "'")
PIECES = sorted({*re.findall(r"\w+|\W", RICH), *SIGNS})
SETTINGS = settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def check(world: World, text: str) -> None:
    try:
        task = world.build(text)
    except TaskFault as error:
        assert error.faults
        assert all(fault.location.line >= 1 and fault.location.column >= 1 for fault in error.faults)
        return
    compile(generator.generate(task, world.template_folders), "t.py", "exec")


@given(st.text())
@SETTINGS
def test_any_text_is_a_task_or_refused(world: World, text: str) -> None:
    check(world, text)


@given(st.lists(st.tuples(st.integers(0, len(RICH)), st.integers(0, 12), st.sampled_from(PIECES)), max_size=4))
@SETTINGS
def test_any_change_of_a_task_is_a_task_or_refused(world: World, changes: list[tuple[int, int, str]]) -> None:
    text = RICH
    for start, length, piece in changes:
        text = text[:start] + piece + text[start + length :]
    check(world, text)


def test_nothing_is_written_while_tasks_are_checked(world: World, tmp_path: Path) -> None:
    before = sorted(tmp_path.rglob("*"))
    check(world, RICH)
    check(world, RICH.replace("home", "../../x"))
    assert sorted(tmp_path.rglob("*")) == before


def test_deep_nesting_is_refused_without_a_traceback(world: World) -> None:
    check(world, "a: " + "[" * 5000 + "]" * 5000)
    check(world, "name: x\nstates: " + "[{A: {states: " * 300 + "x" + "}}]" * 300)


def test_aliases_that_blow_up_are_refused(world: World) -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    assert any("more than" in fault for fault in world.faults("\n".join(lines)))
