# SPDX-License-Identifier: BSD-3-Clause
"""The suites that tests/run starts leave out no module of tests/rostest, and one that tests nothing is a failure."""

from __future__ import annotations

import os
import signal
import threading
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import ModuleType
from typing import Any

import psutil
import pytest

from modular_framework_testing.ros_session import until

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


def test_every_suite_is_run_once_in_its_lane(runner: ModuleType) -> None:
    assert sorted(runner.LANES) == sorted(lane for phase in runner.PHASES for lane in phase)
    folders = [suite.path for suite in runner.suites_of("unit")]
    assert not [folder for folder in folders if set(folder.parents) & set(folders)]  # pytest runs a folder's folders
    lanes = {suite.name: suite.lane for kind in runner.KINDS for suite in runner.suites_of(kind)}
    assert lanes["rostest/modular_framework_drivers/ur_arm_fault_times"] == "alone"
    assert lanes["unit/modular_framework_drivers/ur"] == lanes["system/test_hardware_pick"] == "emulated hardware"
    assert lanes["unit/modular_framework_testing/emulators"] == "emulated hardware"
    assert lanes["system/test_simulated_pick"] == "whole launches"
    assert lanes["lint/ruff"] == "checkers" and lanes["unit/smach"] == "others"


def test_a_launch_runs_beside_fewer_others_and_what_measures_time_alone(
    runner: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    running: list[str] = []
    beside: list[list[str]] = []

    def run_suite(suite: Any) -> Any:
        running.append(suite.lane)
        time.sleep(0.02)
        beside.append(sorted(running))
        running.remove(suite.lane)
        return runner.SuiteRun(suite.name, runner.Count(passed=1), (), suite.log)

    monkeypatch.setattr(runner, "run_suite", run_suite)
    names = [f"unit/{number}" for number in range(10 * runner.PROCESSORS)] + [
        "system/a",
        "system/b",
        "system/test_stop",
    ]
    names += ["unit/modular_framework_drivers/a", "rostest/modular_framework_control/control_loop_node"]
    suites = [runner.Suite(name, Path(name)) for name in names]
    runs = [run for lanes in runner.PHASES for run in runner.run_phase(lanes, suites)]
    assert sorted(run.name for run in runs) == sorted(names)
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
        (0, 0, 0, 5, "\n4 deselected, 1 warning in 0.1s\n", "0 passed, 0 failed, 0 skipped"),
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


def test_repeated_suites_end_with_their_failures_counted_by_test(
    runner: ModuleType, scripted: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert runner.main(["--repeat", "3", "unit"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "5 passed, 1 failed, 0 skipped"
    assert lines[-5:-2] == [
        "unit/steady: 3 of 3 runs passed",
        "unit/flaky: 2 of 3 runs passed",
        "    1 x test_it (flaky.2.log)",
    ] or lines[-5:-2] == [
        "unit/flaky: 2 of 3 runs passed",
        "    1 x test_it (flaky.2.log)",
        "unit/steady: 3 of 3 runs passed",
    ]
    assert lines[-2].startswith("---- 2 suites, 6 runs: ")
    logs = scripted / "logs" / "unit"
    assert "the second run" in (logs / "flaky.2.log").read_text()
    assert sorted(path.name for path in logs.iterdir()) == [
        f"{name}.{number}.log" for name in ("flaky", "steady") for number in (1, 2, 3)
    ]


def test_a_run_without_repetition_keeps_one_log_per_suite(
    runner: ModuleType, scripted: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert runner.main(["unit/steady", "-k", "test_it"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "1 passed, 0 failed, 0 skipped"
    assert [path.name for path in (scripted / "logs" / "unit").iterdir()] == ["steady.log"]


def test_sigterm_ends_the_suites_that_run_and_what_they_started(runner: ModuleType, scripted: Path) -> None:
    started = scripted / "started"
    (scripted / "steady.py").write_text(
        "import subprocess, sys, time\n"
        "def test_it():\n"
        "    child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'], start_new_session=True)\n"
        f"    open({str(started)!r}, 'w').write(f'{{child.pid}} ')\n"
        "    while True: time.sleep(0.1)\n"  # Python handles a signal just before a long sleep after this sleep
    )

    children: list[psutil.Process] = []

    def terminate() -> None:
        until(lambda: started.exists() and started.read_text().endswith(" "), "the suite has started its program")
        children.append(psutil.Process(int(started.read_text())))
        os.kill(os.getpid(), signal.SIGTERM)

    thread = threading.Thread(target=terminate)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            runner.main(["unit/steady"])
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
    thread.join()
    assert psutil.wait_procs(children, 30.0) == (children, [])


@pytest.mark.parametrize("count", ["0", "-1", "many", "2.5"])
def test_a_repetition_that_is_no_count_is_refused(
    runner: ModuleType, capsys: pytest.CaptureFixture[str], count: str
) -> None:
    with pytest.raises(SystemExit) as end:
        runner.main([f"--repeat={count}", "unit"])
    assert end.value.code == 2
    assert f"got '{count}'; allowed: a whole number from 1" in capsys.readouterr().err


def test_options_behind_the_suite_are_for_pytest(runner: ModuleType) -> None:
    read = runner.read_arguments(["--repeat", "2", "unit/smach", "-k", "preempt", "--repeat", "x"])
    assert (read.repeat, read.suite, read.pytest_arguments) == (2, "unit/smach", ["-k", "preempt", "--repeat", "x"])
    assert vars(runner.read_arguments([])) == {"repeat": None, "suite": "all", "pytest_arguments": []}


def test_a_suite_that_ends_without_a_failed_test_is_listed_as_such(runner: ModuleType) -> None:
    run = runner.SuiteRun("system/a", runner.Count(passed=3, failed=1), (), Path("a.1.log"))
    assert runner.repetition_table([run]) == [
        "system/a: 0 of 1 runs passed",
        "    1 x no test: the suite ended badly (a.1.log)",
    ]
