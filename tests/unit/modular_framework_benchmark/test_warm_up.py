# SPDX-License-Identifier: BSD-3-Clause
"""The first episode of a stack runs twice: its first run loads what every node loads on first use."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from modular_framework_benchmark.episodes import ros_task_runner
from modular_framework_benchmark.episodes.ros_task_runner import TaskEpisodeRunner
from modular_framework_benchmark.episodes.stack import StackLaunch
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus

START_S = 8.0
Answer = Callable[[int], dict[str, Any]]


def succeeded(number: int) -> dict[str, Any]:
    ended = {"task_succeeded": True, "outcome": f"run {number}", "reason": "", "lifted": {}, "held": False}
    return ended | {"parts": {"up": START_S}}


class FakeStack:
    """Answers requests and writes a file per request into the folder of its episode."""

    foul = ""

    def __init__(self, answer: Answer) -> None:
        self._answer = answer
        self.requests: list[Mapping[str, Any]] = []

    def request(self, request: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        self.requests.append(request)
        records = Path(request["folder"]) / "task_records"
        records.mkdir()
        (records.parent / f"of_request_{len(self.requests)}").touch()
        return self._answer(len(self.requests))

    def abort(self, timeout_s: float) -> dict[str, Any]:
        return {"requested_s": 0.0, "foul": self.foul}

    def last_output(self) -> str:
        return "the launch said nothing"

    def write_log(self, path: Path) -> None:
        path.touch()

    def alive(self) -> bool:
        return True

    def stop(self) -> None:
        """Has no processes."""


def run_episodes(
    folder: Path, monkeypatch: pytest.MonkeyPatch, answer: Answer, *, count: int = 1, **launch: Any
) -> tuple[list[EpisodeRecord], list[FakeStack]]:
    """Runs episodes one after another, and returns their records and the stacks that were started."""
    stacks: list[FakeStack] = []

    def start(launch: StackLaunch) -> FakeStack:
        stacks.append(FakeStack(answer))
        return stacks[-1]

    described = StackLaunch("package", "file.launch", {}, {}, (), (), **{"can_restart": True, **launch})
    monkeypatch.setattr(ros_task_runner, "Stack", start)
    monkeypatch.setattr(ros_task_runner, "resolve_launch", lambda settings: described)
    runner, records = TaskEpisodeRunner(), []
    for number in range(count):
        (folder / str(number)).mkdir()
        spec = EpisodeSpec(number, {}, number, number, TaskSettings(time_limit=30.0))
        records.append(runner.run(spec, folder / str(number)))
    runner.close()
    return records, stacks


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_the_first_episode_of_a_stack_runs_twice_and_the_second_run_is_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    records, (stack,) = run_episodes(tmp_path, monkeypatch, succeeded, count=2)
    assert [record.outcome for record in records] == ["run 2", "run 3"]
    assert stack.requests[0] == stack.requests[1] != stack.requests[2]  # the warm-up is the episode itself
    assert files(tmp_path / "0") == {"of_request_2", "task_records", "log.txt", "episode.json"}
    assert ["cold_start" in record.snapshot for record in records] == [True, False]


def test_an_episode_adds_its_regions_to_those_of_the_launch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    goal = {"x": [0.1, 0.2]}
    _, (stack,) = run_episodes(tmp_path, monkeypatch, succeeded, regions={"goal": goal})
    assert stack.requests[0]["parameters"]["/regions"] == {"goal": goal}


def test_a_first_run_without_an_end_is_the_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(number: int) -> dict[str, Any]:
        raise TimeoutError

    (record,), (stack,) = run_episodes(tmp_path, monkeypatch, never)
    assert record.status is EpisodeStatus.TIMED_OUT and len(stack.requests) == 1
    monkeypatch.setattr(FakeStack, "foul", "a node changed the world")
    (tmp_path / "with foul").mkdir()
    (record,), _ = run_episodes(tmp_path / "with foul", monkeypatch, never)
    assert record.status is EpisodeStatus.INVALID and record.cause == "a node changed the world"


@pytest.mark.parametrize(("run_s", "runs"), [(10.0, 2), (12.0, 1)])
def test_the_start_and_both_runs_fit_into_the_time_limit_of_30_s_or_the_episode_runs_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run_s: float, runs: int
) -> None:
    clock = {"s": 0.0}

    def timed(number: int) -> dict[str, Any]:
        clock["s"] += run_s + (START_S if number == 1 else 0.0)
        return succeeded(number)

    monkeypatch.setattr(ros_task_runner.time, "monotonic", lambda: clock["s"])
    (record,), (stack,) = run_episodes(tmp_path, monkeypatch, timed)
    assert len(stack.requests) == runs and record.succeeded and record.snapshot["cold_start"]


def test_a_world_that_cannot_be_reset_runs_each_episode_once_on_a_stack_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    records, stacks = run_episodes(tmp_path, monkeypatch, succeeded, count=2, can_restart=False)
    assert [len(stack.requests) for stack in stacks] == [1, 1]
    assert all(record.snapshot["cold_start"] for record in records)
