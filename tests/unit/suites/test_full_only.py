# SPDX-License-Identifier: BSD-3-Clause
"""The short run leaves out exactly what tests/full_only.toml lists, and `full` leaves out nothing."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

TESTS = Path(__file__).parents[2]
sys.path.insert(0, str(TESTS))
from full_only import LEAVE_OUT, FullOnly, read_full_only, split_items  # noqa: E402

CASE = TESTS / "system" / "test_demo_launch.py"
SIMULATED = "test_a_script_moves_arm_and_gripper_of_the_demonstration[python simulated]"


@pytest.mark.parametrize("entry", read_full_only(), ids=lambda entry: entry.path.name)
def test_each_entry_names_tests_of_a_file_and_what_shows_the_same(entry: FullOnly) -> None:
    assert entry.path.is_file() and entry.reason
    text = entry.path.read_text()
    suites = re.findall(r"^from ([\w.]+_conformance) import", text, re.MULTILINE)  # base classes with tests
    text += "".join(Path(str(getattr(find_spec(suite), "origin", ""))).read_text() for suite in suites)
    for name in entry.tests:
        assert re.search(rf"^ *def {name.partition('[')[0]}\(", text, re.MULTILINE), name


@pytest.mark.parametrize(("short", "number"), [(True, 2), (False, 4)])
def test_a_listed_test_is_not_collected_in_the_short_run_only(short: bool, number: int) -> None:
    env = {name: value for name, value in os.environ.items() if name != LEAVE_OUT} | ({LEAVE_OUT: "1"} if short else {})
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", str(CASE)]
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=120, check=False)
    collected = [line.partition("::")[2] for line in done.stdout.splitlines() if "::" in line]
    assert done.returncode == 0 and len(collected) == number, done.stdout
    assert (SIMULATED in collected) is not short


def test_a_name_that_its_module_lacks_is_refused_and_one_without_parameters_takes_every_case() -> None:
    items: list[Any] = [SimpleNamespace(path=CASE, name=name) for name in ("test_a[1]", "test_a[2]", "test_b")]
    items.append(SimpleNamespace(path=TESTS / "other.py", name="test_a[1]"))
    run, left_out = split_items(items, [FullOnly(CASE, ("test_a",), "")])
    assert (run, left_out) == (items[2:], items[:2])
    assert split_items(items, [FullOnly(CASE, ("test_a[2]",), "")])[1] == items[1:2]
    assert split_items(items[3:], [FullOnly(CASE, ("test_a[3]",), "")])[1] == []
    with pytest.raises(ValueError, match=r"test_demo_launch.py has no test \['test_a\[3\]'\]"):
        split_items(items, [FullOnly(CASE, ("test_a[3]",), "")])


@pytest.mark.parametrize(
    ("given", "number"), [([], 1), (["all"], 1), (["full"], 2), (["unit"], 2), (["unit/flaky"], 1)]
)
def test_a_listed_suite_runs_with_full_and_by_its_name(
    runner: ModuleType, scripted: Path, monkeypatch: pytest.MonkeyPatch, given: list[str], number: int
) -> None:
    started: list[str] = []

    def run_suite(suite: Any) -> Any:
        started.append(f"{suite.name} {LEAVE_OUT in os.environ}")
        return runner.SuiteRun(suite.name, runner.Count(passed=1), (), suite.log)

    monkeypatch.setenv(LEAVE_OUT, "")  # restored after the test
    monkeypatch.setattr(runner, "run_suite", run_suite)
    monkeypatch.setattr(runner, "read_full_only", lambda: (FullOnly(scripted / "flaky.py", (), ""),))
    assert runner.main(given) == 0
    assert len(started) == number
    assert all(name.endswith(str(given in ([], ["all"]))) for name in started)
    assert any("flaky" in name for name in started) is (given not in ([], ["all"]))
