# SPDX-License-Identifier: BSD-3-Clause
"""A record of a task or an episode is replayed with the runs, outcomes, samples and milestones of the live task."""

from __future__ import annotations

import contextlib
import json
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import smach
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus, Span
from modular_framework_benchmark.records.episode_settings import EpisodeSettings
from modular_framework_benchmark.results.json_records import record_to_json
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.task_constructor.machine_graph import MachineFrame
from modular_framework_core.task_runner.record import TaskRecorder
from modular_framework_core.task_runner.task_runner import TaskRun, write_record
from modular_framework_ui.joint_history import JointSample
from modular_framework_ui.page_server import PageServer
from modular_framework_ui.recorded_episode import read_episode
from modular_framework_ui.recorded_task import ReplayError
from modular_framework_ui.replay import replayed_model
from modular_framework_ui.replay_command import main, replay_server
from modular_framework_ui.task_state import Mark, Phase, StateRun, TaskChanges

WEB = Path(__file__).parents[3] / "src" / "modular_framework_ui" / "web"
BEGUN = 1000.0
ORIGIN_S = 50.0
"""ROS time at the start of the recording [s]."""


class Clock:
    """A clock that advances by a second per reading."""

    def __init__(self, start_s: float) -> None:
        self._now_s = start_s - 1.0

    def __call__(self) -> float:
        self._now_s += 1.0
        return self._now_s


class Step(FrameworkState):
    """Gives a reason for failing on the first execution, if there is one."""

    def __init__(self, reason: str = "") -> None:
        super().__init__(output_keys=["chosen"])
        self._next_reason = reason

    def execute(self, userdata: Any) -> str:
        userdata.chosen = 0.5
        reason, self._next_reason = self._next_reason, ""
        return self.fail(reason) if reason else self.succeed()


def pick_machine() -> smach.StateMachine:
    """A machine whose nested machine fails once and runs a second time."""
    hold = smach.StateMachine(["held", "missed"])
    both = smach.Concurrence(["good", "bad"], "bad", outcome_map={"good": {"A": "success"}})
    with both:
        smach.Concurrence.add("A", Step())
        smach.Concurrence.add("B", Step())
    with hold:
        smach.StateMachine.add("Close", Step("no object"), {"success": "Lift", "fail": "missed"})
        smach.StateMachine.add("Lift", Step(), {"success": "held", "fail": "missed"})
    made = smach.StateMachine(["done", "gave_up"])
    with made:
        smach.StateMachine.add("Look", Step(), {"success": "Both", "fail": "gave_up"})
        smach.StateMachine.add("Both", both, {"good": "Hold", "bad": "gave_up"})
        smach.StateMachine.add("Hold", hold, {"held": "done", "missed": "Hold"})
    return made


def write_task(folder: Path) -> Path:
    """Writes the record of a run in which each reading of a clock advances the clock by 1 s."""
    recorder = TaskRecorder(clock=Clock(0.0), ros_clock=Clock(ORIGIN_S), locations={"Look": "pick.yaml:7:5"})
    run = TaskRun("pick", pick_machine, recorder)
    run.start()
    assert run.wait(10.0)
    return write_record(folder, BEGUN, run.result(), recorder.records(), recorder.machines())


def write_episode(folder: Path, milestones: tuple[Span, ...] = ()) -> None:
    write_task(folder / "task_records")
    (folder / "recording.json").write_text(json.dumps({"origin_s": ORIGIN_S, "reports": []}))
    times_s = [0.5 * number for number in range(40)]
    velocities, efforts = [0.1] * len(times_s), [float("nan")] * len(times_s)
    samples = {"time_s": times_s, "pan/position": times_s, "pan/velocity": velocities, "pan/effort": efforts}
    pd.DataFrame(samples).to_parquet(folder / "trajectory.parquet")
    tracked = {"time_s": times_s, "controller": "arm", "joint": "pan", "desired": [time + 0.01 for time in times_s]}
    pd.DataFrame(tracked | {"actual": times_s}).to_parquet(folder / "tracking.parquet")
    record = EpisodeRecord(
        EpisodeSpec(3, {"planner": "rrt"}, 2, 7, EpisodeSettings()),
        EpisodeStatus.FAILED,
        outcome="done",
        cause="the object fell",
        begun=BEGUN,
        wall_s=20.0,
        simulated_s=20.0,
        metrics={},
        spans=milestones,
    )
    (folder / "episode.json").write_text(record_to_json(record))
    (folder / "log.txt").write_text(
        f"[WARN] [{BEGUN - 9.0:.6f}, 8.0]: of the warm-up run\n"
        f"\x1b[33m[ WARN] [{BEGUN + 2.5:.6f}, 52.500000]: slow\x1b[0m\n[INFO] [1.0]: no\nplain text\n"
    )


def replayed(path: Path) -> TaskChanges:
    return replayed_model(read_episode(path)).changes_since(0)


def runs_of(changes: TaskChanges, path: str) -> list[StateRun]:
    return [run for run in changes.runs.values() if run.path == f"/pick/{path}"]


def test_a_task_has_the_runs_outcomes_reasons_and_userdata_of_its_record(tmp_path: Path) -> None:
    changes = replayed(write_task(tmp_path))
    assert (changes.task.phase, changes.task.outcome, changes.task.start_s) == (Phase.SUCCEEDED, "done", 0.0)
    (look,) = runs_of(changes, "Look")
    assert (look.outcome, look.location, look.outputs) == ("success", "pick.yaml:7:5", {"chosen": "0.5"})
    assert look.end_s is not None and look.end_s - look.start_s == pytest.approx(1.0)
    failed, second = runs_of(changes, "Hold/Close")
    assert (failed.reason, failed.has_failed, second.has_failed) == ("no object", True, False)
    assert all(run.end_s is not None for run in changes.runs.values())


def test_nested_and_concurrent_machines_have_a_run_for_each_execution(tmp_path: Path) -> None:
    changes = replayed(write_task(tmp_path))
    first, second = runs_of(changes, "Hold")
    assert (first.outcome, first.has_failed, second.outcome, first.is_machine) == ("missed", True, "held", True)
    close, _ = runs_of(changes, "Hold/Close")
    assert (first.start_s, first.end_s) == (close.start_s, close.end_s)
    (both,) = runs_of(changes, "Both")
    inner = [*runs_of(changes, "Both/A"), *runs_of(changes, "Both/B")]
    assert both.is_machine and both.start_s == min(run.start_s for run in inner)


def test_the_drawing_is_that_of_the_recorded_machines(tmp_path: Path) -> None:
    frame = replayed_model(read_episode(write_task(tmp_path))).frame()
    assert frame is not None and [child.label for child in frame.children] == ["Look", "Both", "Hold"]
    both = frame.child("Both")
    assert isinstance(both, MachineFrame) and both.is_concurrent


def test_an_episode_has_its_judgement_samples_milestones_and_warnings(tmp_path: Path) -> None:
    grasped, lifted = Span("milestone", "grasped", 0.0, 6.0), Span("milestone", "lifted", 0.0, None, failed=True)
    write_episode(tmp_path, (grasped, lifted))
    changes = replayed(tmp_path)
    assert (changes.task.phase, changes.task.reason) == (Phase.FAILED, "the object fell")
    assert "planner rrt, trial 2" in changes.record.title
    first_close = runs_of(changes, "Hold/Close")[0]  # starts 6 s after the recording, by the ROS clock
    assert changes.record.marks == (Mark(name="grasped", time_s=first_close.start_s), Mark(name="lifted", time_s=None))
    assert [(line.time_s, line.level, line.text) for line in changes.log.values()] == [
        (pytest.approx(2.5), "WARN", "slow")
    ]
    assert changes.joints == ("pan",)
    samples: list[JointSample] = list(changes.samples.values())
    times_s = [sample.time_s for sample in samples]
    assert times_s == sorted(times_s) and (times_s[0], times_s[-1]) == (1.0, 12.0)
    (position,), (velocity,), (effort,), (error,) = samples[0].values
    assert (velocity, effort, error) == (0.1, None, pytest.approx(0.01))
    assert position == 0.0


def test_what_a_record_leaves_out_is_said(tmp_path: Path) -> None:
    path = write_task(tmp_path / "task_records")
    assert replayed(path).record.omissions == ("the world", "the joints", "the log")
    assert replayed(tmp_path).record.omissions == (
        "the world", "the joints", "the milestones and the judgement of the episode", "the log",
    )  # fmt: skip
    old = json.loads(path.read_text())
    del old["machines"]
    path.write_text(json.dumps(old))
    changes = replayed(path)
    assert "the state machine" in changes.record.omissions and runs_of(changes, "Hold/Lift")


def test_what_is_no_record_is_refused_with_what_is_allowed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ReplayError, match="no record of a task in task_records; allowed: the folder of an episode"):
        read_episode(tmp_path)
    (tmp_path / "other.json").write_text("[]")
    for name in ("other.json", "absent.json"):
        with pytest.raises(ReplayError, match=f"{name}: no record of a task .*; allowed: the folder"):
            read_episode(tmp_path / name)
    assert main(["--replay", str(tmp_path / "absent.json")], WEB) == 2
    assert "absent.json: no record of a task" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["episode.json", "recording.json"])
@pytest.mark.parametrize("text", ['{"spec": ', "{}", "[1, 2]"])
def test_an_incomplete_file_of_an_episode_is_refused_or_left_out(tmp_path: Path, name: str, text: str) -> None:
    write_episode(tmp_path)
    (tmp_path / name).write_text(text)
    with contextlib.suppress(ReplayError):
        assert "the world" in read_episode(tmp_path).omissions


@pytest.fixture
def server(tmp_path: Path) -> Iterator[PageServer]:
    server = replay_server(write_task(tmp_path), WEB, 8980)
    server.start()
    yield server
    server.close()


def test_a_record_is_served_on_the_page_with_its_drawing(server: PageServer) -> None:
    with urllib.request.urlopen(server.address, timeout=5.0) as answer:
        assert answer.read() == (WEB / "index.html").read_bytes()
