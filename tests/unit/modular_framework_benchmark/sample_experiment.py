# SPDX-License-Identifier: BSD-3-Clause
"""A small experiment with two methods on two objects, and records of its episodes."""

from __future__ import annotations

import itertools

from modular_framework_benchmark.experiments.success_criteria import SuccessCriteria
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus, Span
from modular_framework_benchmark.records.episode_settings import OwnMetric, PlacedObject
from modular_framework_benchmark.records.experiment import Direction, ExperimentDescription, Factor, Metric, MetricKind

METHODS = ("top_down", "antipodal")
OBJECTS = ("cup", "can")


def sample_description(name: str = "picks", digest: str = "d1", **changes: object) -> ExperimentDescription:
    fields: dict[str, object] = {
        "name": name,
        "mode": "task",
        "text": "# compares two grasp methods\nname: picks\n",
        "digest": digest,
        "factors": (Factor("grasp_method", METHODS), Factor("object", OBJECTS), Factor("speed", ("0.50",))),
        "compared": "grasp_method",
        "metrics": (
            Metric("success", "task", MetricKind.RATE, Direction.HIGHER),
            Metric("planning_time", "planning", MetricKind.TIME, Direction.LOWER, "s", limit=5.0),
            Metric("slipped", "grasp", MetricKind.RATE, Direction.LOWER),
        ),
        "time_limit_s": 60.0,
    }
    return ExperimentDescription(**{**fields, **changes})  # type: ignore[arg-type]


def sample_episodes(trials: int = 3) -> list[EpisodeSpec]:
    design = itertools.product(range(trials), METHODS, OBJECTS)
    return [
        EpisodeSpec(
            number,
            {"grasp_method": method, "object": thing, "speed": "0.50"},
            trial,
            1000 + trial,
            TaskSettings(
                arguments={"grasp_method": method},
                parameters={"/speed": 0.5},
                objects=(PlacedObject(thing, thing, 0.1, 0.2 + trial, 0.3),),
                success=SuccessCriteria(lifted=0.2),
                metrics=("planning_time", OwnMetric("slipped", "/own.py:slipped")),
            ),
        )
        for number, (trial, method, thing) in enumerate(design)
    ]


def sample_record(
    spec: EpisodeSpec, status: EpisodeStatus = EpisodeStatus.SUCCEEDED, **changes: object
) -> EpisodeRecord:
    succeeded = status is EpisodeStatus.SUCCEEDED
    fields: dict[str, object] = {
        "spec": spec,
        "status": status,
        "outcome": "succeeded" if succeeded else "failed",
        "cause": "" if succeeded else "no motion found",
        "begun": 1.7e9 + spec.number,
        "wall_s": 12.5,
        "simulated_s": 10.25,
        "metrics": {"success": float(succeeded), "planning_time": 0.125 * (spec.number + 1), "slipped": None},
        "spans": (
            Span("state", "PICK/APPROACH", 0.5, 4.0, "ok"),
            Span(
                "component",
                "planning",
                0.75,
                None,
                "",
                failed=not succeeded,
                reason="" if succeeded else "no motion found",
            ),
        ),
        "snapshot": {"version": "0.1.0-7-gabc", "machine": {"processors": 2}, "seeds": {"episode": spec.seed}},
        "folder": f"picks/episode_{spec.number}",
        "worker": "worker-1",
    }
    return EpisodeRecord(**{**fields, **changes})  # type: ignore[arg-type]
