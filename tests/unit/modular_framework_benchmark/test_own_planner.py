# SPDX-License-Identifier: BSD-3-Clause
"""A planner in its own process competes in the mode `planning`: as created, as documented, and with a fault."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from mbf_method.create_method import create_method
from modular_framework_benchmark.commands import ros_make_problems
from modular_framework_benchmark.commands.mode_runners import known_metrics, setting_checks
from modular_framework_benchmark.experiments.design import plan_episodes
from modular_framework_benchmark.experiments.experiment_file import load_experiment
from modular_framework_benchmark.experiments.planning_mode import PlanningSettings
from modular_framework_benchmark.experiments.problem_sets import Problem
from modular_framework_benchmark.experiments.ros_resource_lookup import RosResourceLookup
from modular_framework_benchmark.modes.ros_planning_runner import PlanningEpisodeRunner
from modular_framework_benchmark.modes.ros_run_digests import run_digests
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus

ROOT = Path(__file__).parents[3]
PYTHON = f'"/usr/bin/env", "PYTHONPATH={ROOT}/src/mbf_method/src", "{sys.executable}"'
EXAMPLE = ROOT / "docs/examples/my_planner.py"
FAULTY_PLANNER = ROOT / "tests/unit/mbf_method/faulty_planner.py"
COMMAND = "/move_group/planning_pipelines/external/command"
METRICS = ("success", "planning_time", "planner_method_time", "planner_transport_time", "path_length")


@pytest.fixture(scope="module")
def runner() -> Iterator[PlanningEpisodeRunner]:
    runner = PlanningEpisodeRunner()
    yield runner
    runner.close()


@pytest.fixture(scope="module")
def problems(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("own") / "problems"
    arguments = ["panda_hand_moveit_config", "panda_arm", str(folder), "--count", "4", "--boxes", "3"]
    assert ros_make_problems.main(arguments) == 0
    return folder


def test_a_created_and_the_documented_planner_solve_problems_of_an_experiment(
    runner: PlanningEpisodeRunner, problems: Path, tmp_path: Path
) -> None:
    file = create_method("mine", "planner", tmp_path) / "experiment.yaml"
    (file.parent / "problems").mkdir()
    for path in problems.glob("*000[34].yaml"):
        shutil.copy(path, file.parent / "problems")
    text = file.read_text()
    for old, new in (
        (f'"{sys.executable}"', PYTHON),
        ("planning_time: 5 ", "planning_time: 20 "),
        ("trials: 20 ", "trials: 2 "),
        (
            "RRTConnect: {pipeline: ompl, planner: RRTConnect}",
            f'documented: {{pipeline: external, parameters: {{{COMMAND}: [{PYTHON}, "{EXAMPLE}"]}}}}',
        ),
    ):
        assert old in text, old
        text = text.replace(old, new)
    file.write_text(text)
    experiment = load_experiment(file, RosResourceLookup(), known_metrics(), setting_checks(), "")
    episodes = plan_episodes(experiment)
    assert any("my_planner.py" in description for description in run_digests(episodes))

    records: dict[str, list[EpisodeRecord]] = {"documented": [], "mine": []}
    for spec in episodes:
        folder = tmp_path / spec.key
        folder.mkdir()
        records[spec.configuration["planner"]].append(runner.run(spec, folder))
    for record in records["documented"]:
        assert record.status is EpisodeStatus.SUCCEEDED, record.cause
        assert 0.0 < record.metrics["planner_method_time"] < record.metrics["planning_time"]
        assert record.metrics["planner_transport_time"] > 0.0 and record.metrics["path_length"] > 0.0
        assert "failure_class" not in record.snapshot
        assert len(sources_of(record)) == 64
    for record in records["mine"]:  # a straight path, valid or in collision
        assert record.metrics["planner_method_time"] > 0.0
        assert record.succeeded or "fails the final validation" in record.cause
    first, second = ({sources_of(record) for record in records[level]} for level in ("documented", "mine"))
    assert len(first) == len(second) == 1 and first != second


def sources_of(record: EpisodeRecord) -> str:
    (planner,) = record.snapshot["planners"].values()
    return str(planner["sources"])


@pytest.mark.parametrize(
    ("fault", "status", "failure_class", "cause"),
    [
        ("exits", EpisodeStatus.FAILED, "component died", "exited with code 3"),
        ("dies", EpisodeStatus.FAILED, "component died", "was ended by SIGKILL"),
        ("hangs", EpisodeStatus.TIMED_OUT, "timeout", "no result within"),
        ("raises", EpisodeStatus.FAILED, "invalid output", "ValueError: no roadmap"),
        ("returns NaN", EpisodeStatus.FAILED, "invalid output", "is not finite"),
        ("finds no path", EpisodeStatus.FAILED, "no plan", "found no path"),
    ],
    ids=["exits", "dies", "hangs", "raises", "returns NaN", "finds no path"],
)
def test_a_fault_of_a_planner_counts_against_the_planner_with_its_class(
    runner: PlanningEpisodeRunner,
    problems: Path,
    tmp_path: Path,
    fault: str,
    status: EpisodeStatus,
    failure_class: str,
    cause: str,
) -> None:
    settings = PlanningSettings(
        robot="panda_hand_moveit_config",
        pipeline="external",
        planner="faulty",
        planning_time=2.0,
        parameters={COMMAND: [sys.executable, str(FAULTY_PLANNER), fault]},
        problem=Problem("problems/0001", str(problems / "scene0001.yaml"), str(problems / "request0001.yaml")),
        metrics=METRICS,
    )
    record: EpisodeRecord = runner.run(EpisodeSpec(0, {}, 0, 1, settings), tmp_path)
    assert record.status is status, record.cause
    assert record.snapshot["failure_class"] == failure_class
    assert cause in record.cause
