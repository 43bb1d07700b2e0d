# SPDX-License-Identifier: BSD-3-Clause
"""The suites that tests/run starts leave out no module of tests/rostest, and one that tests nothing is a failure."""

from __future__ import annotations

import importlib.util
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROSTEST = Path(__file__).parents[2] / "rostest"
PACKAGES = sorted(folder for folder in ROSTEST.iterdir() if list(folder.glob("test_*.py")))


@pytest.mark.parametrize("package", PACKAGES, ids=lambda folder: folder.name)
def test_every_module_is_run_by_one_test_file(package: Path) -> None:
    named = [
        module
        for suite in package.glob("*.test")
        for test in ElementTree.parse(suite).getroot().iter("test")
        for module in test.get("args", "").split()
        if module.endswith(".py")
    ]
    assert sorted(named) == sorted(path.name for path in package.glob("test_*.py"))


def test_there_are_suites() -> None:
    assert len(PACKAGES) >= 10


@pytest.fixture(scope="module")
def runner() -> Iterator[ModuleType]:
    """The script tests/run as a module."""
    loader = SourceFileLoader("tests_run", str(ROSTEST.parent / "run"))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, loader.name, module)
        patch.syspath_prepend(ROSTEST.parent)
        patch.setattr(sys, "dont_write_bytecode", True)
        loader.exec_module(module)
        yield module


def test_every_suite_is_run_once_in_its_lane(runner: ModuleType) -> None:
    assert sorted(runner.LANES) == sorted(lane for phase in runner.PHASES for lane in phase)
    folders = [suite.path for suite in runner.suites_of("unit")]
    assert not [folder for folder in folders if set(folder.parents) & set(folders)]  # pytest runs a folder's folders
    lanes = {suite.name: suite.lane for kind in runner.KINDS for suite in runner.suites_of(kind)}
    assert lanes["rostest/modular_framework_drivers/ur_arm_fault_times"] == "alone"
    assert lanes["unit/modular_framework_drivers/ur"] == lanes["system/test_hardware_pick"] == "emulated hardware"
    assert lanes["system/test_simulated_pick"] == "whole launches"
    assert lanes["lint/ruff"] == "checkers" and lanes["unit/smach"] == "others"


def test_a_launch_runs_beside_fewer_others_and_what_measures_time_alone(
    runner: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    running: list[str] = []
    beside: list[list[str]] = []

    def run_suite(suite: Any) -> tuple[str, Any]:
        running.append(suite.lane)
        time.sleep(0.02)
        beside.append(sorted(running))
        running.remove(suite.lane)
        return suite.name, runner.Count(passed=1)

    monkeypatch.setattr(runner, "run_suite", run_suite)
    names = [f"unit/{number}" for number in range(10 * runner.PROCESSORS)] + [
        "system/a",
        "system/b",
        "system/test_stop",
    ]
    names += ["unit/modular_framework_drivers/a", "rostest/modular_framework_control/control_loop_node"]
    suites = [runner.Suite(name, Path(name)) for name in names]
    counts = [count for lanes in runner.PHASES for count in runner.run_phase(lanes, suites).items()]
    assert sorted(name for name, _ in counts) == sorted(names)
    assert beside.count(["alone"]) == 2 and beside.count(["emulated hardware"]) == 1
    launches = [group for group in beside if "whole launches" in group]
    assert launches and all(group.count("whole launches") == 1 for group in launches)
    assert max(len(group) for group in launches) == 1 + 2 * (runner.PROCESSORS + 3) // 5
    assert ["others"] * (runner.PROCESSORS + 3) in beside


def report(results: Path, tests: int, failures: int = 0, skipped: int = 0) -> Path:
    """A folder with the results of pytest."""
    (results / "rosunit-pytest.xml").write_text(
        f'<testsuites><testsuite tests="{tests}" failures="{failures}" errors="0" skipped="{skipped}"/></testsuites>'
    )
    return results


@pytest.mark.parametrize(
    ("tests", "failures", "skipped", "code", "log", "count"),
    [
        (3, 1, 1, 1, "1 failed, 1 passed, 1 skipped in 0.1s", "1 passed, 1 failed, 1 skipped"),
        (3, 0, 0, 2, "interrupted", "3 passed, 1 failed, 0 skipped"),
        (0, 0, 0, 0, "no tests ran in 0.1s", "0 passed, 1 failed, 0 skipped"),
        (0, 0, 0, 5, "no tests ran in 0.1s", "0 passed, 1 failed, 0 skipped"),
        (2, 0, 2, 0, "2 skipped in 0.1s", "0 passed, 0 failed, 2 skipped"),
        (0, 0, 0, 5, "\n4 deselected in 0.1s\n", "0 passed, 0 failed, 0 skipped"),
    ],
)
def test_a_suite_without_tests_and_one_that_ends_badly_are_failures(
    runner: ModuleType, tmp_path: Path, tests: int, failures: int, skipped: int, code: int, log: str, count: str
) -> None:
    results = report(tmp_path, tests, failures, skipped)
    assert str(runner.count_of(code, results, log)) == count


def test_options_for_pytest_come_after_those_of_the_environment(
    runner: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTEST_ADDOPTS", "--color=yes -x")
    assert runner.pytest_options(["-k", "one or two"]) == "--color=yes -x -k 'one or two'"
    monkeypatch.delenv("PYTEST_ADDOPTS")
    assert runner.pytest_options(["-x"]) == "-x"
