# SPDX-License-Identifier: BSD-3-Clause
"""An episode of an experiment: judged by the world, recorded, the same again on a stack that is kept, nothing left."""

from __future__ import annotations

import contextlib
import os
import signal
import time
import uuid
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
import rosgraph

from modular_framework_benchmark.episodes.ros_task_runner import TaskEpisodeRunner
from modular_framework_benchmark.experiments.success_criteria import SuccessCriteria
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.metrics.registry import METRICS
from modular_framework_benchmark.predicates.conditions import HeldFor, Lifted, NoContact, OnTopOf
from modular_framework_benchmark.predicates.predicate import Not
from modular_framework_benchmark.predicates.progress import Milestone
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.episode_settings import PlacedObject, RecordedFiles
from modular_framework_core.launching.launch_session import processes_with

MARK = "EPISODE_TEST"
ENOUGH_S = 240.0
PICK = TaskSettings(
    arguments={"world_file": "ur5_table.world", "real_time_factor": "0"},
    objects=(PlacedObject("cube_1", "cube", 0.05, 0.5, 0.866, yaw=0.3),),
    success=SuccessCriteria(lifted=0.1, hold_time=1.0, shake=2.0),
    progress=(
        Milestone(name="touched", predicate=Not(NoContact(object="cube_1"))),
        Milestone(name="grasped", predicate=HeldFor(object="cube_1", duration=0.2)),
        Milestone(name="lifted", predicate=Lifted(object="cube_1", height=0.1), weight=2.0),
        Milestone(name="put_back", predicate=OnTopOf(object="cube_1", support="table")),
    ),
    metrics=tuple(METRICS),
    time_limit=ENOUGH_S,
)


@pytest.fixture
def runner(monkeypatch: pytest.MonkeyPatch) -> Iterator[TaskEpisodeRunner]:
    """A runner that leaves no process when it is closed."""
    mark = uuid.uuid4().hex
    monkeypatch.setenv(MARK, mark)
    made = TaskEpisodeRunner()
    try:
        yield made
    finally:
        made.close()
        assert processes_with(MARK, mark) == []


def run(runner: TaskEpisodeRunner, folder: Path, settings: TaskSettings) -> EpisodeRecord:
    folder.mkdir()
    return runner.run(EpisodeSpec(0, {"object": "cube"}, 0, 7, settings), folder)


def _process_in_task(node: str) -> int:
    """The process of a node of this test's session, once the task runs."""
    end = time.monotonic() + ENOUGH_S
    while time.monotonic() < end:
        for pid in processes_with(MARK, os.environ[MARK]):
            with contextlib.suppress(OSError):  # a process that ended, a master that does not answer yet
                if f"__name:={node}".encode() in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0"):
                    variables = Path(f"/proc/{pid}/environ").read_bytes().decode().split("\0")
                    uri = next(each for each in variables if each.startswith("ROS_MASTER_URI=")).partition("=")[2]
                    services = rosgraph.Master("/test", master_uri=uri).getSystemState()[2]
                    if any(name == "/task/stop" for name, _ in services):
                        return pid
        time.sleep(0.2)
    raise AssertionError(f"the task of node {node} did not start")


def test_an_episode_is_judged_by_the_world_measured_and_the_same_again_on_the_stack_that_is_kept(
    runner: TaskEpisodeRunner, tmp_path: Path
) -> None:
    enough_for_two_runs = replace(PICK, time_limit=2.0 * ENOUGH_S)
    cold = run(runner, tmp_path / "cold", replace(enough_for_two_runs, record=RecordedFiles(bag=True, video=True)))
    warm = run(runner, tmp_path / "warm", PICK)
    assert cold.status is EpisodeStatus.SUCCEEDED, f"{cold.cause}\n{(tmp_path / 'cold/log.txt').read_text()}"
    assert cold.outcome == "successful_pipeline" and cold.simulated_s is not None
    wanted = {"success", "task_time", "generation_time", "planning_time", "path_length", "tracking_error", "slip"}
    assert {name: cold.metrics[name] for name in wanted if cold.metrics[name] is None} == {}
    assert (cold.metrics["lift"] or 0.0) > 0.1 and cold.metrics["hold_time"] == pytest.approx(2.0)
    assert {"start", "begin", "task", "check", "stop"} <= {span.name for span in cold.spans if span.kind == "episode"}
    assert {span.name for span in cold.spans if span.kind == "component"} == {
        *("generation", "planning", "execution", "grasp")
    }
    assert any(span.name == "MoveLift" for span in cold.spans if span.kind == "state")
    assert cold.metrics["progress"] == pytest.approx(4 / 5)  # a pick does not put the cube back
    milestones = [span for span in cold.spans if span.kind == "milestone"]
    assert [span.name for span in milestones] == ["touched", "grasped", "lifted", "put_back"]
    *reached_s, missed_s = [span.ended_s for span in milestones]
    assert missed_s is None and milestones[0].started_s < reached_s[0] < reached_s[1] < reached_s[2] <= cold.simulated_s
    assert [span.reason for span in milestones] == ["", "", "", "missed first"]
    assert cold.snapshot["seed"] == 7 and cold.snapshot["packages"]["ompl"] and cold.snapshot["machine"]["cores"]

    assert (tmp_path / "cold/episode.bag").read_bytes().startswith(b"#ROSBAG V2.0\n")
    assert b"topic=/joint_states" in (tmp_path / "cold/episode.bag").read_bytes()
    with av.open(str(tmp_path / "cold/video.mp4")) as video:
        images = [frame.to_ndarray(format="gray").astype(int) for frame in video.decode(video=0)]
    assert len(images) == pytest.approx(10 * cold.simulated_s, abs=2), cold.snapshot.get("video_fault")
    assert np.abs(images[-1] - images[0]).max() > 50  # the arm has moved

    assert warm.status is EpisodeStatus.SUCCEEDED, f"{warm.cause}\n{(tmp_path / 'warm/log.txt').read_text()}"
    assert warm.snapshot["final_objects"] == cold.snapshot["final_objects"]
    assert cold.snapshot["cold_start"] and "cold_start" not in warm.snapshot
    logs = [(tmp_path / name / "log.txt").read_text() for name in ("cold", "warm")]
    assert [log.count(" were stored.") for log in logs] == [2, 1]  # generated once to warm up, then in each episode
    lifts = [log.count("state machine goes from 'MoveLift'") for log in logs]
    assert lifts == [2, 1]  # all plans and motions warm up, too
    assert len(list((tmp_path / "cold/task_records").iterdir())) == 1
    for record in (cold, warm):
        assert (record.metrics["method_processor_time"] or 0.0) > 0.0
        assert (record.metrics["generation_time"] or 0.0) < (record.metrics["task_wall_time"] or 0.0)
        assert record.metrics["concurrent_plans"] == 1.0  # no plan waits for another one
        assert (record.metrics["planning_processor_time"] or 0.0) > 0.0
    for name in ("trajectory.parquet", "tracking.parquet"):
        assert (tmp_path / "cold" / name).read_bytes() == (tmp_path / "warm" / name).read_bytes()


def test_a_launch_that_dies_is_an_episode_with_its_cause_at_once(runner: TaskEpisodeRunner, tmp_path: Path) -> None:
    begun = time.monotonic()
    arguments = {"world_file": "../../../tests/system/nameless_link.world"}
    record = run(runner, tmp_path / "dead", replace(PICK, arguments=arguments))
    assert record.status is EpisodeStatus.BROKEN
    assert "node 'gazebo' died (exited with 1)" in record.cause and "nameless_link.world:4" in record.cause
    assert time.monotonic() - begun < ENOUGH_S
    assert "nameless_link.world" in (tmp_path / "dead/log.txt").read_text()


@pytest.mark.parametrize("node", ["move_group", "gazebo", "task"])
def test_a_frozen_node_makes_the_episode_invalid_and_is_named(
    runner: TaskEpisodeRunner, tmp_path: Path, node: str
) -> None:
    with ThreadPoolExecutor() as pool:
        episode = pool.submit(run, runner, tmp_path / "frozen", PICK)
        try:
            pid = _process_in_task(node)
            os.kill(pid, signal.SIGSTOP)
            record = episode.result(ENOUGH_S)
        finally:
            runner.close()
    assert record.status is EpisodeStatus.INVALID, record.cause
    assert record.cause.startswith(f"node '/{node}' is frozen: its process {pid} was stopped")
    assert record.metrics["success"] is None


def test_a_time_limit_that_passes_before_the_method_is_asked_says_nothing_of_the_method(
    runner: TaskEpisodeRunner, tmp_path: Path
) -> None:
    record = run(runner, tmp_path / "short", replace(PICK, time_limit=1.0))
    assert record.status is EpisodeStatus.BROKEN
    assert record.cause.startswith("no end within 1 s")


def test_a_setting_that_is_wrong_is_named_and_nothing_is_launched(runner: TaskEpisodeRunner, tmp_path: Path) -> None:
    record = run(runner, tmp_path / "wrong", replace(PICK, arguments={"world_fil": "ur5_table.world"}))
    assert record.status is EpisodeStatus.BROKEN
    assert "unknown argument 'world_fil'; did you mean 'world_file'" in record.cause
    assert not any((tmp_path / "wrong").iterdir())
