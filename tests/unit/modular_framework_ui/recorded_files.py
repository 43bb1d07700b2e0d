# SPDX-License-Identifier: BSD-3-Clause
"""Writes records of a task, of an episode, and of an experiment with two methods."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

import smach
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus, Span
from modular_framework_benchmark.records.experiment import Direction, ExperimentDescription, Factor, Metric, MetricKind
from modular_framework_benchmark.results.database import open_database
from modular_framework_benchmark.results.json_records import record_to_json
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.task_runner.record import TaskRecorder
from modular_framework_core.task_runner.task_runner import TaskRun, write_record

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


def pick_machine(reason: str = "no object") -> smach.StateMachine:
    """A machine whose nested machine fails once, if there is a reason, and runs a second time."""
    hold = smach.StateMachine(["held", "missed"])
    both = smach.Concurrence(["good", "bad"], "bad", outcome_map={"good": {"A": "success"}})
    with both:
        smach.Concurrence.add("A", Step())
        smach.Concurrence.add("B", Step())
    with hold:
        smach.StateMachine.add("Close", Step(reason), {"success": "Lift", "fail": "missed"})
        smach.StateMachine.add("Lift", Step(), {"success": "held", "fail": "missed"})
    made = smach.StateMachine(["done", "gave_up"])
    with made:
        smach.StateMachine.add("Look", Step(), {"success": "Both", "fail": "gave_up"})
        smach.StateMachine.add("Both", both, {"good": "Hold", "bad": "gave_up"})
        smach.StateMachine.add("Hold", hold, {"held": "done", "missed": "Hold"})
    return made


def write_task(folder: Path, reason: str = "no object") -> Path:
    """Writes the record of a run in which each reading of a clock advances the clock by 1 s."""
    recorder = TaskRecorder(clock=Clock(0.0), ros_clock=Clock(ORIGIN_S), locations={"Look": "pick.yaml:7:5"})
    run = TaskRun("pick", lambda: pick_machine(reason), recorder)
    run.start()
    assert run.wait(10.0)
    return write_record(folder, BEGUN, run.result(), recorder.records(), recorder.machines())


FAILED_EPISODE = EpisodeRecord(
    EpisodeSpec(3, {"planner": "rrt"}, 2, 7, TaskSettings()),
    EpisodeStatus.FAILED,
    outcome="done",
    cause="the object fell",
    begun=BEGUN,
    wall_s=20.0,
    simulated_s=20.0,
    metrics={},
)


def write_episode(
    folder: Path, milestones: tuple[Span, ...] = (), record: EpisodeRecord = FAILED_EPISODE, reason: str = "no object"
) -> None:
    write_task(folder / "task_records", reason)
    (folder / "recording.json").write_text(json.dumps({"origin_s": ORIGIN_S, "reports": []}))
    times_s = [0.5 * number for number in range(40)]
    velocities, efforts = [0.1] * len(times_s), [float("nan")] * len(times_s)
    samples = {"time_s": times_s, "pan/position": times_s, "pan/velocity": velocities, "pan/effort": efforts}
    pd.DataFrame(samples).to_parquet(folder / "trajectory.parquet")
    tracked = {"time_s": times_s, "controller": "arm", "joint": "pan", "desired": [time + 0.01 for time in times_s]}
    pd.DataFrame(tracked | {"actual": times_s}).to_parquet(folder / "tracking.parquet")
    (folder / "episode.json").write_text(record_to_json(replace(record, spans=milestones)))
    (folder / "log.txt").write_text(
        f"[WARN] [{BEGUN - 9.0:.6f}, 8.0]: of the warm-up run\n"
        f"\x1b[33m[ WARN] [{BEGUN + 2.5:.6f}, 52.500000]: slow\x1b[0m\n[INFO] [1.0]: no\nplain text\n"
    )


PLANNERS = ("rrt", "stomp")
LIFTED = Span("milestone", "lifted", 0.0, 8.0)


def write_run(folder: Path) -> Path:
    """Writes a result database with two planners on two objects, and the files of all episodes except the last.

    Episodes 0 and 1 are a pair, of which the first failed; so are 2 and 3, which succeeded.
    """
    better = Direction.HIGHER
    metrics = (
        Metric("success", "task", MetricKind.RATE, better),
        Metric("progress", "task", MetricKind.VALUE, better),
        Metric("task_time", "task", MetricKind.TIME, Direction.LOWER, "s", limit=60.0),
    )
    factors = (Factor("planner", PLANNERS), Factor("object", ("can", "box")))
    description = ExperimentDescription(
        "two_planners", "task", text="# two planners\n", digest="d1", factors=factors, compared="planner",
        metrics=metrics, time_limit_s=60.0,
    )  # fmt: skip
    specs = [
        EpisodeSpec(number, {"planner": planner, "object": thing}, 4, 7, TaskSettings())
        for number, (thing, planner) in enumerate((thing, planner) for thing in ("can", "box") for planner in PLANNERS)
    ]
    with open_database(folder / "picks.db", create=True) as database:
        experiment = database.add_experiment(description, specs)
        for spec in specs:
            record = _record_of(spec)
            if spec.number < len(specs) - 1:
                write_episode(folder / record.folder, (LIFTED,), record, "" if record.succeeded else record.cause)
            database.write(experiment, record)
    return folder / "picks.db"


def _record_of(spec: EpisodeSpec) -> EpisodeRecord:
    has_failed = spec.number == 0
    return EpisodeRecord(
        spec,
        EpisodeStatus.FAILED if has_failed else EpisodeStatus.SUCCEEDED,
        outcome="done",
        cause="the object fell" if has_failed else "",
        begun=BEGUN,
        wall_s=20.0,
        simulated_s=20.0,
        metrics={
            "success": 0.0 if has_failed else 1.0,
            "progress": 0.5 if has_failed else 1.0,
            "task_time": None if has_failed else 9.0 + spec.number,
        },
        spans=(LIFTED,),
        snapshot={"failure_class": "slipped"} if has_failed else {},
        folder=f"files/{spec.number:06d}",
    )
