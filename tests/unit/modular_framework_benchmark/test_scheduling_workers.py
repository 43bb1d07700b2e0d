# SPDX-License-Identifier: BSD-3-Clause
"""Workers are real processes: they are killed, raise and hang, and every episode still ends once, with its cause."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import fake_runners
import pytest
from experiment_texts import PICK, read

from modular_framework_benchmark.experiments.design import digest_of, plan_episodes
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.results.database import ResultDatabase, open_database
from modular_framework_benchmark.scheduling import experiment_run, local_pool
from modular_framework_benchmark.scheduling.episode_runner import RunnerFactory
from modular_framework_benchmark.scheduling.experiment_run import EpisodeQueue, ExperimentRun, RunEnd
from modular_framework_benchmark.scheduling.local_pool import LocalPool
from modular_framework_benchmark.scheduling.marked_processes import MARK, end_marked_processes, marked_processes
from modular_framework_benchmark.scheduling.progress import Progress
from modular_framework_benchmark.scheduling.run_lock import RunLock, RunLockError
from modular_framework_benchmark.scheduling.worker_process import WorkerStartError
from modular_framework_benchmark.statistics.stopping import StoppingDecision

SMALL = PICK.replace("trials: 6", "trials: 2").replace("planner: [RRTConnect, PRM]", "planner: [RRTConnect]")


class Bench:
    """An experiment of 8 short episodes in a database."""

    def __init__(self, folder: Path, text: str = SMALL) -> None:
        experiment = read(text, folder)
        self.episodes = plan_episodes(experiment)
        self.folder = folder
        self.database: ResultDatabase = open_database(folder / "results.db", create=True)
        digest = digest_of(experiment, self.episodes)
        self.number = self.database.add_experiment(experiment.describe(digest, {}), self.episodes)
        self.mark = f"test{os.getpid()}"

    def run(self, make_runner: RunnerFactory, workers: int = 2, rule: object = None) -> RunEnd:
        run = ExperimentRun(self.database, self.number, self.folder / "episodes", rule)  # type: ignore[arg-type]
        progress = Progress(len(self.episodes), 0, io.StringIO())
        return run.run(lambda: LocalPool(make_runner, workers, self.mark, self.folder / "logs"), progress)

    def records(self) -> list[EpisodeRecord]:
        return [self.database.record(self.number, spec.number) for spec in self.episodes]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    bench = Bench(tmp_path)
    yield bench
    assert marked_processes(f"{bench.mark}/") == [], "a run leaves no process behind"
    bench.database.close()


def test_every_episode_runs_once_and_its_record_and_folder_are_kept(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_RUNS", str(bench.folder / "runs"))
    assert bench.run(fake_runners.QuickRunner) == RunEnd(8)
    assert sorted((bench.folder / "runs").read_text().split()) == sorted(spec.key for spec in bench.episodes)
    for record in bench.records():
        assert record.succeeded and record.metrics["task_time"] == record.spec.seed % 1000 / 1000
        assert record.spec.key in (bench.folder / record.folder / "log.txt").read_text()
        assert record.worker in ("worker_1", "worker_2")
    assert bench.run(fake_runners.QuickRunner) == RunEnd(0), "nothing is left to run"


def test_a_killed_worker_costs_no_other_episode_and_its_own_is_tried_twice(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    (bench.folder / "tries").mkdir()
    monkeypatch.setenv("FAKE_TRIES", str(bench.folder / "tries"))
    bench.run(fake_runners.DyingRunner)
    for record in bench.records():
        if record.spec.trial == 0:
            assert record.status is EpisodeStatus.BROKEN
            assert "was killed by signal SIGKILL; its last output: the worker is about to die" in record.cause
            assert "after 2 attempts" in record.cause
        else:
            assert record.succeeded, "the second try succeeds"
            earlier = record.snapshot.get("earlier_tries", [])
            assert len(earlier) == (record.spec.trial == 1)
            assert all("was killed by signal SIGKILL" in text and text.startswith("begun 2") for text in earlier)
    assert not list(bench.folder.rglob("*.tries")), "the notes are removed once the records are stored"


def test_an_exception_of_the_runner_is_a_broken_episode_with_its_cause(bench: Bench) -> None:
    bench.run(fake_runners.RaisingRunner)
    for record in bench.records():
        assert record.succeeded == (record.spec.trial == 0)
        assert record.cause == ("the runner raised ValueError: this mode has a fault" if record.spec.trial else "")


def test_a_runner_that_does_not_return_is_killed_and_timed_out(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_pool, "GRACE_S", 1.0 - 60.0)  # the time limit of these episodes is 60 s
    bench.run(fake_runners.HangingRunner)
    for record in bench.records():
        assert record.status is (EpisodeStatus.SUCCEEDED if record.spec.trial else EpisodeStatus.TIMED_OUT)
        assert record.spec.trial or "exceeded 1 s" in record.cause


def test_a_worker_that_cannot_start_ends_the_run_with_what_it_said(bench: Bench) -> None:
    with pytest.raises(WorkerStartError, match="the robot is not there"):
        bench.run(fake_runners.no_runner)
    assert len(bench.database.pending(bench.number)) == 8


def test_a_stopping_rule_is_asked_after_each_trial_and_ends_the_run(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(experiment_run, "PAUSE_FACTOR", 0.0)

    class AfterOneTrial:
        seen: list[int] = []

        def decide(self, results: ExperimentResults) -> StoppingDecision:
            self.seen.append(len(results.episodes))
            return StoppingDecision(len(results.episodes) >= 4, "enough is known")

    end = bench.run(fake_runners.QuickRunner, workers=1, rule=AfterOneTrial())
    assert end.stopped_because == "enough is known"
    assert end.episodes < 8 and AfterOneTrial.seen[0] == 0 and AfterOneTrial.seen[-1] >= 4


def test_a_worker_keeps_the_episodes_of_one_stack_and_helps_at_the_end(tmp_path: Path) -> None:
    episodes = plan_episodes(read(PICK + "block: 3\n", tmp_path))
    queue = EpisodeQueue(episodes)
    taken: dict[str, list[EpisodeSpec]] = {"a": [], "b": []}
    while len(queue):
        for slot, list_of in taken.items():
            spec = queue.next_for(slot)
            if spec is not None:
                list_of.append(spec)
    assert sorted(spec.number for own in taken.values() for spec in own) == list(range(48))
    for own in taken.values():
        stacks = [(spec.configuration["method"], spec.configuration["planner"]) for spec in own]
        changes = sum(first != second for first, second in zip(stacks, stacks[1:], strict=False))
        assert changes <= 4, "each worker runs four of the eight groups of one stack"
    assert queue.next_for("a") is None


def test_the_last_episode_of_a_stack_is_left_to_the_worker_that_has_it_running(tmp_path: Path) -> None:
    episodes = plan_episodes(read(PICK + "block: 3\n", tmp_path))
    first, second = episodes[:3], episodes[6:9]  # six of each stack
    queue = EpisodeQueue([*first, *second])
    assert [queue.next_for("a"), queue.next_for("b")] == [first[0], second[0]]
    assert [queue.next_for("a"), queue.next_for("a")] == first[1:]
    assert queue.next_for("a") == second[1], "two are left: one of them is worth the start of a stack"
    assert queue.next_for("a") == second[2], "its stack runs here too by now"

    queue = EpisodeQueue([*first[:1], *second[:2]])
    assert [queue.next_for("a"), queue.next_for("b")] == [first[0], second[0]]
    assert queue.next_for("a") is None and len(queue) == 1
    assert queue.next_for("a", alone=True) == second[1], "the worker that had it running is lost"


def test_processes_in_sessions_of_their_own_are_found_by_their_mark_and_ended() -> None:
    mark = f"search{os.getpid()}"
    sleeper = "import subprocess, sys, time; subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'],"
    sleeper += " start_new_session=True); time.sleep(600)"
    child = subprocess.Popen(
        [sys.executable, "-c", sleeper], env=os.environ | {MARK: f"{mark}/1/"}, start_new_session=True
    )
    wait_until(lambda: len(marked_processes(f"{mark}/")) == 2)
    assert marked_processes(f"{mark}/2/") == []
    assert end_marked_processes(f"{mark}/") == 2
    assert child.wait(5) == -signal.SIGKILL and marked_processes(f"{mark}/") == []


def test_a_database_has_one_run_at_a_time(tmp_path: Path) -> None:
    target = str(tmp_path / "a.db")
    with RunLock(target, tmp_path), pytest.raises(RunLockError, match=f"process {os.getpid()} runs episodes of"):
        RunLock(target, tmp_path).__enter__()
    link = tmp_path / "link.db"
    link.symlink_to(target)
    for spelling in (f"sqlite:///{target}", str(link), os.path.relpath(target), f"{tmp_path}/../{tmp_path.name}/a.db"):
        with RunLock(target, tmp_path), pytest.raises(RunLockError, match="runs episodes of"):
            RunLock(spelling, tmp_path).__enter__()
    server = "postgresql+psycopg://me@lab/results"
    with RunLock(server, tmp_path), pytest.raises(RunLockError):
        RunLock("postgresql+psycopg2://you:secret@lab/results", tmp_path).__enter__()
    with RunLock(target, tmp_path) as lock, RunLock(str(tmp_path / "b.db"), tmp_path) as other:
        assert lock.run != other.run


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)
