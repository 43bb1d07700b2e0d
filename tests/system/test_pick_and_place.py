# SPDX-License-Identifier: BSD-3-Clause
"""The shipped pick and place: one robot after another puts an object down in the narrow region."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from modular_framework_benchmark.commands.mode_runners import known_metrics
from modular_framework_benchmark.commands.ros_run_command import experiment_path
from modular_framework_benchmark.episodes.ros_task_runner import TaskEpisodeRunner
from modular_framework_benchmark.experiments.design import plan_episodes
from modular_framework_benchmark.experiments.experiment_file import load_experiment
from modular_framework_benchmark.experiments.ros_resource_lookup import RosResourceLookup
from modular_framework_benchmark.records.episode import EpisodeSpec, EpisodeStatus

FILE = experiment_path(Path("pick_and_place_tolerance.yaml"))
NARROW = {"grasp_method": "top_down", "tolerance": "10_mm", "object": "can"}


def episode(robot: str) -> EpisodeSpec:
    """The first episode with a can and the narrow region."""
    experiment = load_experiment(FILE, RosResourceLookup(), known_metrics(), launch=f"{robot}/start_framework.launch")
    found = next(spec for spec in plan_episodes(experiment) if spec.configuration == NARROW)
    return replace(found, settings=replace(found.settings, time_limit=400.0))


@pytest.mark.parametrize("robot", ["modular_framework_api", "panda_hand_robot"])
def test_an_object_is_picked_and_put_down_in_the_region(tmp_path: Path, robot: str) -> None:
    runner = TaskEpisodeRunner()
    try:
        record = runner.run(episode(robot), tmp_path)
    finally:
        runner.close()
    assert record.status is EpisodeStatus.SUCCEEDED, f"{record.cause}\n{(tmp_path / 'log.txt').read_text()}"
    milestones = [span for span in record.spans if span.kind == "milestone"]
    assert [span.name for span in milestones] == ["grasped", "lifted", "above_the_goal", "put_down", "released"]
    assert all(span.ended_s is not None for span in milestones)
    assert record.metrics["progress"] == 1.0
