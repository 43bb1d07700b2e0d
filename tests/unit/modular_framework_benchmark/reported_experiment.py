# SPDX-License-Identifier: BSD-3-Clause
"""A made-up experiment with known truths: three planners, two objects, metrics of each kind, failures with causes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus, Span
from modular_framework_benchmark.records.experiment import (
    Direction,
    ExperimentDescription,
    Factor,
    Metric,
    MetricKind,
)
from modular_framework_benchmark.results.database import open_database

LIMIT_S = 30.0
STATES = ("setup", "generate_grasps", "plan_approach", "approach", "close_gripper", "lift", "place")
CAUSES = (
    "no grasp was reachable: 0 of 24 candidates had a joint state",
    "planning failed: no solution in 5.0 s",
    "the object slipped 0.08 m while it was lifted",
    "joint 'wrist' left its path by 0.21 rad",
)
CLASSES = ("unreachable", "no plan", "slipped", "collision in execution")
"""Class of each cause."""
MILESTONES = ("grasped", "lifted", "moved", "released", "placed")
TEXT = """# Compares planners on two objects.
experiment: planners_on_two_objects
task: pick_and_place
compare: planner
factors:
  planner: [rrt_connect, bitstar, stomp]
  object: [can, box]
seeds: 7
repetitions: 50
"""


def metrics() -> tuple[Metric, ...]:
    """Returns a metric of each kind, of several components."""
    lower, higher = Direction.LOWER, Direction.HIGHER
    return (
        Metric(
            "success", "task", MetricKind.RATE, higher, "", limit=None, description="The object stands where it should."
        ),
        Metric(
            "task_time",
            "task",
            MetricKind.TIME,
            lower,
            "s",
            limit=LIMIT_S,
            description="From the first state to the last.",
        ),
        Metric(
            "candidates",
            "generation",
            MetricKind.VALUE,
            higher,
            "",
            limit=None,
            description="Grasps that were offered.",
        ),
        Metric(
            "planning_time",
            "planning",
            MetricKind.TIME,
            lower,
            "s",
            limit=5.0,
            description="Sum over all requests of the episode.",
        ),
        Metric(
            "path_length",
            "planning",
            MetricKind.VALUE,
            lower,
            "rad",
            limit=None,
            description="Joint space, all motions.",
        ),
        Metric(
            "tracking_error",
            "execution",
            MetricKind.VALUE,
            lower,
            "rad",
            limit=None,
            description="Largest of any joint.",
        ),
        Metric(
            "slip",
            "grasp",
            MetricKind.VALUE,
            lower,
            "m",
            limit=None,
            description="Of the object in the gripper, while lifted.",
        ),
    )


def snapshot_of(spec: EpisodeSpec) -> dict[str, Any]:
    """Returns a snapshot with the parts of a real record; planner and world are those of the levels."""
    planner, item = spec.configuration["motion_planner"], spec.configuration["object"]
    return {
        "version": "v0.1.0",
        "git_revision": "0f3c9d2",
        "git_changed": False,
        "packages": {"ompl": "2.0.1", "numpy": "2.4.6"},
        "ros_packages": {"rospy": "1.15.15"},
        "machine": {"host": "lab-pc", "cores": 8},
        "reference_s": 0.1,
        "others_share": 0.0,
        "seed": spec.seed,
        "planners": {f"{planner} of ompl": {"range": 0.1, "implementation": "OMPL"}},
        "physics_engine": "pybullet",
        "digests": {"world": f"digest of the world with {item}"},
    }


@dataclass(frozen=True)
class ReportedExperiment:
    """How many episodes to make up, and how the methods differ.

    Attributes:
        trials: Scenes of each object; the episodes are trials x objects x planners.
        planners: Chance of success and typical planning time [s] of each planner.
        causes: Why episodes fail.
        name: Of the experiment.
        seed: Of what is drawn.
        with_spans: Whether states and components are recorded.
        with_files: Whether failed episodes have files.
        finished: How many episodes are finished; None: all.
        with_progress: Whether episodes have milestones, and failed ones a class.
    """

    trials: int = 50
    planners: tuple[tuple[str, float, float], ...] = (
        ("rrt_connect", 0.9, 0.4),
        ("bitstar", 0.72, 1.1),
        ("stomp", 0.88, 0.8),
    )
    objects: tuple[str, ...] = ("can", "box")
    causes: tuple[str, ...] = CAUSES
    name: str = "planners_on_two_objects"
    seed: int = 7
    with_spans: bool = True
    with_files: bool = True
    finished: int | None = None
    with_progress: bool = False

    @property
    def planned(self) -> int:
        """Returns how many episodes there are."""
        return self.trials * len(self.objects) * len(self.planners)

    def description(self) -> ExperimentDescription:
        """Returns what was run."""
        planners = tuple(name for name, _, _ in self.planners)
        factors = (Factor("motion_planner", planners), Factor("object", self.objects))
        return ExperimentDescription(
            self.name,
            "task",
            text=TEXT,
            digest="ab" * 32,
            factors=factors,
            compared="motion_planner",
            metrics=metrics(),
            time_limit_s=LIMIT_S,
        )

    def specs(self) -> list[EpisodeSpec]:
        """Returns what is planned, in the order of the run."""
        keys = [
            (planner, item, trial)
            for trial in range(self.trials)
            for item in self.objects
            for planner, _, _ in self.planners
        ]
        return [
            EpisodeSpec(
                number, {"motion_planner": planner, "object": item}, trial, self._seed_of(trial, item), TaskSettings()
            )
            for number, (planner, item, trial) in enumerate(keys)
        ]

    def records(self) -> Iterator[EpisodeRecord]:
        """Yields what each episode gave. Episodes of a trial share how hard it is, so that pairs are related."""
        chances = {name: (chance, time_s) for name, chance, time_s in self.planners}
        hardness = np.random.default_rng(self.seed).normal(size=(self.trials, len(self.objects)))
        begun = 1_790_000_000.0
        for spec in self.specs()[: self.finished]:
            random = np.random.default_rng((self.seed, spec.number))
            chance, time_s = chances[spec.configuration["motion_planner"]]
            hard = hardness[spec.trial, self.objects.index(spec.configuration["object"])]
            record = self._record(spec, random, chance - 0.12 * hard, time_s * float(np.exp(0.4 * hard)), begun)
            begun += record.wall_s
            yield record

    def store(self, path: Path) -> Path:
        """Writes all episodes into a result database, some of them with a folder of files beside it."""
        folders = path.parent / f"{self.name}_files"
        with open_database(path, create=True) as database:
            number = database.add_experiment(self.description(), self.specs())
            for record in self.records():
                database.write(number, record)
                if self.with_files:
                    folder = folders / f"{record.spec.number:06d}"
                    folder.mkdir(parents=True)
                    (folder / "episode.log").write_text(record.cause)
                    (folder / "video.mp4").write_bytes(b"")
        return path

    def _seed_of(self, trial: int, item: str) -> int:
        return (1000 * self.seed + trial) * len(self.objects) + self.objects.index(item)

    def _record(
        self, spec: EpisodeSpec, random: np.random.Generator, chance: float, time_s: float, begun: float
    ) -> EpisodeRecord:
        draw = float(random.random())
        status = EpisodeStatus.SUCCEEDED if draw < chance else EpisodeStatus.FAILED
        if status is EpisodeStatus.FAILED and random.random() < 0.2:
            status = EpisodeStatus.TIMED_OUT
        if random.random() < 0.01:
            status = EpisodeStatus.BROKEN
        success = status is EpisodeStatus.SUCCEEDED
        values = self._values(status, random, time_s)
        cause = "" if success else self.causes[int(random.integers(len(self.causes)))]
        wall_s = float(8.0 + 3.0 * random.random())
        return EpisodeRecord(
            spec, status, outcome="success" if success else "fail", cause=cause, begun=begun, wall_s=wall_s,
            simulated_s=values["task_time"], metrics=values,
            spans=self._spans(spec, status, cause, float(values["planning_time"] or 1.0)) if self.with_spans else (),
            snapshot=snapshot_of(spec)
            | ({"failure_class": CLASSES[self.causes.index(cause)]} if self.with_progress and cause else {}),
            folder=f"{self.name}_files/{spec.number:06d}", worker=f"worker-{spec.number % 2}",
        )  # fmt: skip

    def _values(self, status: EpisodeStatus, random: np.random.Generator, time_s: float) -> dict[str, float | None]:
        if status is EpisodeStatus.BROKEN:
            return {metric.name: None for metric in metrics()}
        success = status is EpisodeStatus.SUCCEEDED
        moved = success or random.random() < 0.5
        return {
            "success": float(success),
            "task_time": float(9.0 + 4.0 * random.random() + time_s) if success else None,
            "candidates": float(random.integers(6, 30)),
            "planning_time": min(float(random.lognormal(np.log(time_s), 0.5)), 5.0) if moved else None,
            "path_length": float(random.gamma(8.0, 0.9)) if moved else None,
            "tracking_error": float(random.gamma(4.0, 0.002)) if moved else None,
            "slip": float(random.exponential(0.004)) if success else None,
        }

    def _spans(self, spec: EpisodeSpec, status: EpisodeStatus, cause: str, planning_s: float) -> tuple[Span, ...]:
        random = np.random.default_rng((self.seed, spec.number, 1))
        count = len(STATES) if status is EpisodeStatus.SUCCEEDED else int(random.integers(2, len(STATES)))
        spans, now = [], 0.0
        for index, name in enumerate(STATES[:count]):
            length = planning_s if name.startswith("plan") else float(0.3 + 2.0 * random.random())
            failed = status is not EpisodeStatus.SUCCEEDED and index == count - 1
            ended = None if failed and status is EpisodeStatus.TIMED_OUT else now + length
            outcome = "" if ended is None else "fail" if failed else "success"
            spans.append(Span("state", f"/{name}", now, ended, outcome, failed=failed, reason=cause if failed else ""))
            component = {"generate_grasps": "generation", "plan_approach": "planning", "approach": "execution"}
            if name in component:
                spans.append(Span("component", component[name], now + 0.05 * length, ended, outcome, failed=failed))
            now += length
        if self.with_progress:
            reached = count if status is EpisodeStatus.SUCCEEDED else count - 1
            spans += [
                Span("milestone", name, 0.5, 1.0 + index if index < reached else None, failed=index >= reached)
                for index, name in enumerate(MILESTONES)
            ]
        return tuple(spans)
