# SPDX-License-Identifier: BSD-3-Clause
"""Experiment files for tests, and what they refer to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from modular_framework_benchmark.experiments.experiment import Experiment
from modular_framework_benchmark.experiments.experiment_file import read_experiment
from modular_framework_benchmark.experiments.reading import ExperimentFault
from modular_framework_benchmark.experiments.resource_lookup import UnresolvedReference
from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind

LAUNCH = "modular_framework_api/start_framework.launch"
ARGUMENTS = {"world_file": "a.world", "method_launch_file": "", "gui": "false", "speed": "1.0"}
METRICS = {
    "task": {
        "success": Metric("success", "task", MetricKind.RATE, Direction.HIGHER),
        "task_time": Metric("task_time", "task", MetricKind.TIME, Direction.LOWER, "s"),
    }
}
MODEL = """<?xml version="1.0"?>
<sdf version="1.5"><model name="{name}"><link name="link"><collision name="c">
<geometry>{shape}</geometry></collision></link></model></sdf>
"""
SHAPES = {
    "cube": "<box><size>0.04 0.04 0.06</size></box>",
    "ball": "<sphere><radius>0.05</radius></sphere>",
    "can": "<cylinder><radius>0.02</radius><length>0.1</length></cylinder>",
}

PICK = """
experiment: picks
mode: task
arguments: {world_file: table.world}
parameters: {/planner_name: $planner}
objects:
  - {model: $object, x: [-0.2, 0.2], y: {choice: [0.4, 0.5]}, yaw: {normal: [0, 1]}, rests_at: 0.8}
success: {lifted: 0.1}
factors:
  method:
    above: {arguments: {method_launch_file: a/above.launch}}
    aside: {arguments: {method_launch_file: b/aside.launch}}
  planner: [RRTConnect, PRM]
  object: [cube, ball]
compare: method
trials: 6
metrics: [success, task_time]
time_limit: 60
"""


class FakeResources:
    """One launch file, one task, and the models of a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        for name, shape in SHAPES.items():
            (folder / name).mkdir(parents=True, exist_ok=True)
            (folder / name / "model.sdf").write_text(MODEL.format(name=name, shape=shape))
        (folder / "simulation_pick.yaml").write_text("name: simulation_pick\n")

    def launch_file(self, name: str) -> Path:
        if name != LAUNCH:
            raise UnresolvedReference(f"there is no launch file {name}")
        return self._folder / "start_framework.launch"

    def launch_arguments(self, launch: str) -> Mapping[str, str | None]:
        self.launch_file(launch)
        return ARGUMENTS

    def launch_faults(self, launch: str, arguments: Mapping[str, str]) -> Sequence[str]:
        if arguments.get("gui", "false") not in ("true", "false"):
            return (f"argument 'gui' is '{arguments['gui']}', allowed are true and false",)
        return ()

    def task(self, name: str, folder: Path) -> str:
        if name != "simulation_pick.yaml":
            raise UnresolvedReference(f"there is no task '{name}'")
        return str(self._folder / name)

    def model(self, name: str, launch: str, arguments: Mapping[str, str], folder: Path) -> Path:
        if name not in SHAPES:
            raise UnresolvedReference(f"there is no model '{name}'; allowed: {', '.join(SHAPES)}")
        return self._folder / name / "model.sdf"

    def world_models(self, launch: str, arguments: Mapping[str, str]) -> Mapping[str, Sequence[str]]:
        return {"ground_plane": (), "table": ("drawer_slide",)}

    def package(self, name: str) -> Path:
        if name != "some_moveit_config":
            raise UnresolvedReference(f"there is no package '{name}'")
        return self._folder


def read(text: str, folder: Path) -> Experiment:
    """Returns the experiment of a text, whose file would be in a folder."""
    return read_experiment(text, folder / "experiment.yaml", FakeResources(folder / "models"), METRICS)


def faults_of(text: str, folder: Path) -> list[str]:
    """Returns the faults of a text as LINE:COLUMN: MESSAGE."""
    try:
        read(text, folder)
    except ExperimentFault as error:
        return [f"{one.location.line}:{one.location.column}: {one.message}" for one in error.faults]
    return []
