# SPDX-License-Identifier: BSD-3-Clause
"""A record of a task or an episode is replayed with the runs, outcomes, samples and milestones of the live task."""

from __future__ import annotations

import contextlib
import json
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from recorded_files import write_episode, write_task

from modular_framework_benchmark.records.episode import Span
from modular_framework_core.task_constructor.machine_graph import MachineFrame
from modular_framework_simulation.viewer.web_server import free_port
from modular_framework_ui.joint_history import JointSample
from modular_framework_ui.page_server import PageServer
from modular_framework_ui.recorded_episode import read_episode
from modular_framework_ui.recorded_task import ReplayError
from modular_framework_ui.replay import replayed_model
from modular_framework_ui.replay_command import main, replay_source
from modular_framework_ui.task_state import Mark, Phase, StateRun, TaskChanges

WEB = Path(__file__).parents[3] / "src" / "modular_framework_ui" / "web"


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
    source = replay_source(str(write_task(tmp_path)))
    server = PageServer(WEB, source, "127.0.0.1", free_port("127.0.0.1", 8980))
    server.start()
    yield server
    server.close()


def test_a_record_is_served_on_the_page_with_its_drawing(server: PageServer) -> None:
    with urllib.request.urlopen(server.address, timeout=5.0) as answer:
        assert answer.read() == (WEB / "index.html").read_bytes()
