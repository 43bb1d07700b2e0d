# SPDX-License-Identifier: BSD-3-Clause
"""Shipped experiments that put objects down: in a region, in a tower of two blocks, into a bin, and out of a shelf."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from modular_framework_benchmark.commands.mode_runners import known_metrics
from modular_framework_benchmark.commands.ros_run_command import experiment_path
from modular_framework_benchmark.episodes.ros_task_runner import TaskEpisodeRunner
from modular_framework_benchmark.experiments.design import plan_episodes
from modular_framework_benchmark.experiments.experiment_file import load_experiment
from modular_framework_benchmark.experiments.ros_resource_lookup import RosResourceLookup
from modular_framework_benchmark.records.episode import EpisodeSpec, EpisodeStatus


@dataclass(frozen=True, slots=True)
class Case:
    """A combination of levels of a shipped experiment, with its milestones.

    Attributes:
        file: File of the experiment.
        configuration: Level of each factor.
        milestones: Names of the milestones.
        kept_objects: Number of objects to collect, instead of all objects of the experiment; None for all.
    """

    file: str
    configuration: Mapping[str, str]
    milestones: tuple[str, ...]
    kept_objects: int | None = None


PICK_AND_PLACE = Case(
    "pick_and_place_tolerance.yaml",
    {"grasp_method": "top_down", "tolerance": "10_mm", "object": "can"},
    ("grasped", "lifted", "above_the_goal", "put_down", "released"),
)
STACK = Case(
    "stack_blocks.yaml",
    {"grasp_method": "top_down", "blocks": "two", "size": "0.06"},
    ("block_2_lifted", "block_2_placed", "block_2_released"),
)
CLEAR_TABLE = Case(
    "clear_cluttered_table.yaml",
    {"grasp_method": "antipodal", "scene": "standing"},
    ("objects_1", "objects_2"),
    kept_objects=2,
)
SHELF = Case(
    "shelf_compartment.yaml",
    {"grasp_method": "antipodal", "planner": "RRTConnect", "height": "250_mm", "position": "front"},
    ("grasped", "out_of_the_shelf", "put_down", "released"),
)
UR5, PANDA = "modular_framework_api", "panda_hand_robot"


def episode(case: Case, robot: str) -> EpisodeSpec:
    """The first episode of a case."""
    file, launch = experiment_path(Path(case.file)), f"{robot}/start_framework.launch"
    experiment = load_experiment(file, RosResourceLookup(), known_metrics(), launch=launch)
    found = next(spec for spec in plan_episodes(experiment) if spec.configuration == case.configuration)
    settings = replace(found.settings, time_limit=400.0)
    if case.kept_objects is not None:
        settings = with_fewer_objects(settings, case.kept_objects)
    return replace(found, settings=settings)


def with_fewer_objects(settings: Any, count: int) -> Any:
    """The settings of an experiment that collects its first objects only, with a milestone for each object."""
    objects = settings.objects[:count]
    names = tuple(placed.name for placed in objects)
    required = replace(settings.success.required, objects=names)
    milestones = (replace(each, predicate=replace(each.predicate, objects=names)) for each in settings.progress[:count])
    success = replace(settings.success, required=required)
    return replace(settings, objects=objects, success=success, progress=tuple(milestones))


@pytest.mark.parametrize("robot", [UR5, PANDA])
@pytest.mark.parametrize(
    "case", [PICK_AND_PLACE, STACK, CLEAR_TABLE, SHELF], ids=["pick_and_place", "stack", "clear_table", "shelf"]
)
def test_the_task_reaches_its_milestones_and_succeeds(tmp_path: Path, case: Case, robot: str) -> None:
    runner = TaskEpisodeRunner()
    try:
        record = runner.run(episode(case, robot), tmp_path)
    finally:
        runner.close()
    assert record.status is EpisodeStatus.SUCCEEDED, f"{record.cause}\n{(tmp_path / 'log.txt').read_text()}"
    milestones = [span for span in record.spans if span.kind == "milestone"]
    assert tuple(span.name for span in milestones) == case.milestones
    assert all(span.ended_s is not None for span in milestones)
    assert record.metrics["progress"] == 1.0
