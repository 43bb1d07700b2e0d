# SPDX-License-Identifier: BSD-3-Clause
"""The whole command is killed at random moments, and `resume` completes the experiment: every episode exactly once."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from modular_framework_benchmark.commands.ros_run_command import resume, run_experiment
from modular_framework_benchmark.results.database import open_database
from modular_framework_benchmark.scheduling.marked_processes import marked_processes
from modular_framework_benchmark.scheduling.run_lock import RunLock

KILLS = 8
TEXT = """
experiment: plans
mode: planning
robot: {urdf: robot.urdf, srdf: robot.srdf}
problems: problems
planner: $planner
factors: {planner: [RRTConnect, PRM, BKPIECE]}
compare: planner
trials: 40
metrics: [success]
time_limit: 30
workers: 2
"""

ROBOT = """<robot name='r'><link name='base'/><link name='tip'/>
<joint name='pan' type='revolute'><parent link='base'/><child link='tip'/><axis xyz='0 0 1'/>
<limit lower='-1' upper='1' effort='1' velocity='1'/></joint></robot>
"""
REQUEST = """group_name: arm
start_state: {joint_state: {name: [pan], position: [0.0]}}
goal_constraints: [{joint_constraints: [{joint_name: pan, position: 0.5}]}]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "experiment.yaml").write_text(TEXT)
    (tmp_path / "robot.urdf").write_text(ROBOT)
    (tmp_path / "robot.srdf").write_text("<robot name='r'><group name='arm'><joint name='pan'/></group></robot>")
    (tmp_path / "problems").mkdir()
    (tmp_path / "problems" / "scene0001.yaml").write_text("world: {collision_objects: []}")
    (tmp_path / "problems" / "request0001.yaml").write_text(REQUEST)
    return tmp_path


@pytest.fixture
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder, in which commands run that this process calls itself."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("ROS_HOME", str(folder / "ros"))
    return folder


def start(
    folder: Path,
    command: str,
    *arguments: str,
    runner: str = "NodeRunner",
    episode_s: float = 0.05,
    ignored_signals: tuple[int, ...] = (),
) -> subprocess.Popen[str]:
    """Starts a command with a fake runner, as rosrun does."""
    code = f"import sys; from modular_framework_benchmark.commands.ros_run_command import {command} as c; "
    code += "sys.exit(c(sys.argv[1:]))"
    # the tests may run in the background of a script, whose shell has SIGINT ignored
    ignored = "".join(f"signal.signal({int(kind)}, signal.SIG_IGN); " for kind in ignored_signals)
    code = f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler); {ignored}{code}"
    environment = os.environ | {
        "PYTHONPATH": f"{Path(__file__).parent}:{os.environ.get('PYTHONPATH', '')}",
        "FAKE_RUNS": str(folder / "runs"),
        "FAKE_EPISODE_S": str(episode_s),
        "ROS_HOME": str(folder / "ros"),
    }
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments, "--runner", f"fake_runners:{runner}"],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finished(folder: Path) -> int:
    with contextlib.suppress(sqlite3.Error), sqlite3.connect(f"file:{folder}/plans.db?mode=ro", uri=True) as connection:
        return int(connection.execute("SELECT count(*) FROM runs").fetchone()[0])
    return 0


def test_an_experiment_whose_every_episode_broke_compares_nothing(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "experiment.yaml").write_text(TEXT.replace("trials: 40", "trials: 5"))
    assert run_experiment(["experiment.yaml", "--runner", "fake_runners:BrokenRunner"]) == 1
    printed, errors = capsys.readouterr()
    assert "so nothing is compared; the most frequent (15 of 15): the runner raised ValueError" in errors
    assert "report: " in printed and "no difference" not in printed


def test_a_disk_limit_ends_the_command_cleanly_and_it_can_go_on(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    quick = ["--runner", "fake_runners:QuickRunner"]
    assert run_experiment(["experiment.yaml", "--disk-limit", "1e-6", *quick]) == 1
    errors = capsys.readouterr().err
    assert "stopped: the next episode would exceed --disk-limit 1e-06" in errors and "To continue: rosrun" in errors
    assert 0 < finished(here) < 120
    assert resume(["plans.db", *quick]) == 0 and finished(here) == 120
    capsys.readouterr()
    assert resume(["plans.db", *quick, "--disk-limit", "0"]) == 2
    assert "--disk-limit is 0; allowed: more than 0 [GB]" in capsys.readouterr().err


def test_kills_at_random_moments_lose_nothing_and_run_nothing_twice(folder: Path) -> None:
    generator = random.Random(5)
    mark = RunLock(str(folder / "plans.db")).run
    kills = 0
    process = start(folder, "run_experiment", "experiment.yaml")
    while kills < KILLS:
        before = finished(folder)
        end = time.monotonic() + 60
        while finished(folder) <= before and process.poll() is None and time.monotonic() < end:
            time.sleep(0.01)
        time.sleep(generator.uniform(0.0, 0.3))
        if process.poll() is not None:
            break
        process.kill()
        if generator.random() < 0.5:  # the workers too, so that nobody is left who could end the nodes
            for number in marked_processes(f"{mark}/"):
                if b"worker_main" in command_of(number):
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(number, signal.SIGKILL)
        process.communicate()
        kills += 1
        process = start(folder, "resume", "plans.db")
    output, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert kills == KILLS, "the experiment is long enough for all kills"
    assert marked_processes(f"{mark}/") == []
    with open_database(folder / "plans.db", read_only=True) as database:
        (stored,) = database.experiments()
        results = database.load(stored.id)
    assert stored.finished == stored.planned == 120
    assert sorted(results.episodes["number"]) == list(range(120))
    with sqlite3.connect(folder / "plans.db") as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    ran = Counter((folder / "runs").read_text().split("\n"))
    assert set(ran) - {""} == {f"planner={row.planner};trial={row.trial}" for row in results.episodes.itertuples()}


def command_of(number: int) -> bytes:
    try:
        return Path(f"/proc/{number}/cmdline").read_bytes()
    except OSError:
        return b""


def test_a_signal_ends_the_run_and_what_it_has_started_and_says_how_to_go_on(folder: Path) -> None:
    for kind in (signal.SIGINT, signal.SIGTERM):
        before = finished(folder)
        process = start(folder, "run_experiment", "experiment.yaml", episode_s=0.5)  # not done before the signal
        while finished(folder) < before + 4:
            assert process.poll() is None, process.communicate()
            time.sleep(0.02)
        process.send_signal(kind)
        _, errors = process.communicate(timeout=60)
        assert process.returncode == 130
        assert "every ended episode is stored. To continue: rosrun modular_framework_benchmark resume" in errors
        assert marked_processes(f"{RunLock(str(folder / 'plans.db')).run}/") == []


def test_a_run_of_nohup_outlives_the_terminal(folder: Path) -> None:
    (folder / "experiment.yaml").write_text(TEXT.replace("trials: 40", "trials: 5"))
    process = start(folder, "run_experiment", "experiment.yaml", ignored_signals=(signal.SIGHUP,))
    while not finished(folder):
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    process.send_signal(signal.SIGHUP)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    assert finished(folder) == 15


def test_a_report_that_cannot_be_written_is_named_and_loses_no_result(folder: Path) -> None:
    (folder / "experiment.yaml").write_text(TEXT.replace("trials: 40", "trials: 1"))
    (folder / "plans.html").mkdir()
    process = start(folder, "run_experiment", "experiment.yaml")
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 1 and finished(folder) == 3
    assert f"error: no report: {folder}/plans.html: it exists and is not a regular file" in errors
    assert "modular_framework_benchmark report plans.db --experiment plans --into FILE" in errors


def test_a_second_run_of_a_database_is_refused_while_the_first_one_runs(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = start(here, "run_experiment", "experiment.yaml", episode_s=0.5)  # still running when the second starts
    while not finished(here):
        assert first.poll() is None, first.communicate()
        time.sleep(0.02)
    assert resume(["plans.db"]) == 2
    assert f"process {first.pid} runs episodes of plans.db already" in capsys.readouterr().err
    first.send_signal(signal.SIGINT)
    first.communicate(timeout=60)


def test_the_design_is_shown_without_running_it(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_experiment(["experiment.yaml", "--dry-run"]) == 0
    output = capsys.readouterr().out
    assert "plans: 120 episodes = 3 combinations x 40 trials; mode planning" in output
    assert "planner: RRTConnect, PRM, BKPIECE  (compared)" in output
    for planner in ("RRTConnect", "PRM", "BKPIECE"):
        text = f"substitution: CBiRRT for {planner}, which cannot keep path constraints\n"
        assert output.count(text) == 1
    assert not (here / "plans.db").exists()


def test_faults_of_the_user_end_with_exit_code_2_and_say_what_to_do(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "wrong.yaml").write_text(TEXT.replace("trials", "trails"))
    for command, arguments, fault in (
        (run_experiment, ["wrong.yaml"], "wrong.yaml:9:1: the key 'trails' is unknown"),
        (run_experiment, ["none.yaml"], "none.yaml:1:1: there is no such file"),
        (run_experiment, ["experiment.yaml", "--workers", "0"], "--workers is 0; allowed: 1 or more"),
        (resume, ["none.db"], "none.db"),
    ):
        assert command(arguments) == 2
        assert fault in capsys.readouterr().err
