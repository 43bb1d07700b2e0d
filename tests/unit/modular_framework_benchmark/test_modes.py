# SPDX-License-Identifier: BSD-3-Clause
"""The modes that plan or solve inverse kinematics without simulation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml

from modular_framework_benchmark.commands import ros_make_problems
from modular_framework_benchmark.experiments.kinematics_mode import KinematicsSettings
from modular_framework_benchmark.experiments.planning_mode import PlanningSettings
from modular_framework_benchmark.experiments.problem_sets import Problem
from modular_framework_benchmark.modes import ros_planning_runner
from modular_framework_benchmark.modes.measured_record import Stopwatch
from modular_framework_benchmark.modes.ros_kinematics_runner import KinematicsEpisodeRunner
from modular_framework_benchmark.modes.ros_planning_runner import PlanningEpisodeRunner
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.episode_settings import SettingsError
from modular_framework_planning.errors import ErrorCode, PlanningError

ROBOT, GROUP = "panda_hand_moveit_config", "panda_arm"


@pytest.fixture(scope="module")
def problems(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("problems")
    assert ros_make_problems.main([ROBOT, GROUP, str(folder / "boxes"), "--count", "2", "--boxes", "3"]) == 0
    return folder / "boxes"


@pytest.fixture(scope="module")
def planning() -> Iterator[PlanningEpisodeRunner]:
    runner = PlanningEpisodeRunner()
    yield runner
    runner.close()


def plan(runner: PlanningEpisodeRunner, problems: Path, folder: Path, seed: int = 1, **changes: Any) -> EpisodeRecord:
    settings = PlanningSettings(
        robot=ROBOT,
        planner="RRTConnect",
        planning_time=20.0,
        problem=Problem("boxes/0001", str(problems / "scene0001.yaml"), str(problems / "request0001.yaml")),
        metrics=("success", "planning_time", "path_length", "motion_duration"),
    )
    folder.mkdir()
    return runner.run(EpisodeSpec(0, {}, 0, seed, replace(settings, **changes)), folder)


def test_a_planned_motion_joins_start_and_goal_and_is_measured(
    planning: PlanningEpisodeRunner, problems: Path, tmp_path: Path
) -> None:
    record = plan(planning, problems, tmp_path / "episode")
    assert record.status is EpisodeStatus.SUCCEEDED, record.cause
    motion = pq.read_table(tmp_path / "episode" / "trajectory.parquet").to_pydict()
    request = yaml.safe_load((problems / "request0001.yaml").read_text())
    start = dict(zip(*request["start_state"]["joint_state"].values(), strict=True))
    goal = {item["joint_name"]: item["position"] for item in request["goal_constraints"][0]["joint_constraints"]}
    for joint, value in goal.items():
        positions = motion[f"{joint}/position"]
        assert positions[0] == pytest.approx(start[joint], abs=1e-6)
        assert positions[-1] == pytest.approx(value, abs=2e-4)
    straight = float(np.linalg.norm([start[joint] - value for joint, value in goal.items()]))
    assert record.metrics["path_length"] >= 0.999 * straight
    assert record.metrics["motion_duration"] == pytest.approx(motion["time_s"][-1])
    assert 0.0 < record.metrics["planning_time"] <= record.wall_s
    (planner,) = record.snapshot["planners"]
    assert planner == "RRTConnect of ompl" and set(record.snapshot["digests"]) == {
        "robot description", "semantic description", "robot meshes"
    }  # fmt: skip


def test_a_seed_repeats_a_plan_whatever_was_planned_before(
    planning: PlanningEpisodeRunner, problems: Path, tmp_path: Path
) -> None:
    for number, seed in enumerate((7, 8, 7)):
        plan(planning, problems, tmp_path / str(number), seed)
    one, other, again = (pq.read_table(tmp_path / str(number) / "trajectory.parquet") for number in range(3))
    assert one.equals(again) and not one.equals(other)


def test_the_start_of_the_planning_process_is_no_part_of_the_first_plan(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = {"s": 0.0}

    class SlowStart:
        started = False

        def __init__(self, *arguments: object) -> None:
            """Takes the model and the pipelines, and needs neither."""

        def start(self) -> None:
            if not self.started:
                clock["s"] += 100.0
            self.started = True

        def plan(self, *arguments: object) -> None:
            self.start()
            clock["s"] += 1.0
            raise PlanningError(ErrorCode.TIMED_OUT, "no path found")

        def close(self) -> None:
            """Has no process."""

    monkeypatch.setattr(ros_planning_runner, "SeededPlanning", SlowStart)
    monkeypatch.setattr(Stopwatch, "elapsed_s", lambda self: clock["s"])
    record = plan(PlanningEpisodeRunner(), problems, tmp_path / "episode")
    assert record.status is EpisodeStatus.TIMED_OUT and record.metrics["planning_time"] == 1.0


@pytest.mark.parametrize(
    ("code", "status"),
    [
        (ErrorCode.INVALID_GROUP_NAME, EpisodeStatus.BROKEN),
        (ErrorCode.INVALID_LINK_NAME, EpisodeStatus.BROKEN),
        (ErrorCode.INVALID_ROBOT_STATE, EpisodeStatus.BROKEN),
        (ErrorCode.FRAME_TRANSFORM_FAILURE, EpisodeStatus.BROKEN),
        (ErrorCode.PLANNING_FAILED, EpisodeStatus.FAILED),
        (ErrorCode.GOAL_IN_COLLISION, EpisodeStatus.FAILED),
    ],
)
def test_an_unknown_name_is_no_failure_of_the_planner(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: ErrorCode, status: EpisodeStatus
) -> None:
    class Refusing:
        def __init__(self, *arguments: object) -> None:
            """Takes the model and the pipelines, and needs neither."""

        def start(self) -> None:
            """Has no process."""

        def plan(self, *arguments: object) -> None:
            raise PlanningError(code, "refused")

        def close(self) -> None:
            """Has no process."""

    monkeypatch.setattr(ros_planning_runner, "SeededPlanning", Refusing)
    record = plan(PlanningEpisodeRunner(), problems, tmp_path / "episode")
    assert record.status is status and code.name in record.cause


def test_a_problem_whose_start_names_no_joint_of_the_robot_is_broken(
    planning: PlanningEpisodeRunner, problems: Path, tmp_path: Path
) -> None:
    text = (problems / "request0001.yaml").read_text()
    assert "panda_joint2" in text
    (tmp_path / "request0001.yaml").write_text(text.replace("panda_joint2", "panda_joint22", 1))
    (tmp_path / "scene0001.yaml").write_text((problems / "scene0001.yaml").read_text())
    record = plan(planning, tmp_path, tmp_path / "episode")
    assert record.status is EpisodeStatus.BROKEN
    assert "request0001.yaml: " in record.cause and "did you mean 'panda_joint2'?" in record.cause


@pytest.mark.parametrize(
    ("settings", "cause"),
    [
        (
            {"planner": "RRTConect"},
            "planner 'RRTConect': pipeline 'ompl' has no such planner; allowed",
        ),
        ({"planner_parameters": {"rage": 1.0}}, "rage"),
        ({"parameters": {"/other_node/x": 1}}, "'/other_node/x' has no effect in this mode"),
        ({"robot": "no_such_robot_moveit_config"}, "no_such_robot_moveit_config"),
        ({"group": "leg"}, "leg"),
    ],
)
def test_what_cannot_be_run_is_broken_with_its_cause(
    planning: PlanningEpisodeRunner, problems: Path, tmp_path: Path, settings: Mapping[str, Any], cause: str
) -> None:
    record = plan(planning, problems, tmp_path / "episode", **settings)
    assert record.status in (EpisodeStatus.BROKEN, EpisodeStatus.FAILED) and cause in record.cause
    assert not record.succeeded


def test_problems_are_the_same_for_a_seed_and_never_overwritten(problems: Path, tmp_path: Path) -> None:
    for name, seed, expected in (("again", "1", True), ("other", "2", False)):
        arguments = [ROBOT, GROUP, str(tmp_path / name), "--count", "2", "--boxes", "3", "--seed", seed]
        assert ros_make_problems.main(arguments) == 0
        texts = [(folder / "request0002.yaml").read_text() for folder in (problems, tmp_path / name)]
        assert (texts[0] == texts[1]) is expected
    assert ros_make_problems.main([ROBOT, GROUP, str(problems), "--count", "1"]) == 2


def test_an_unknown_group_is_refused_with_the_known_ones(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ros_make_problems.main([ROBOT, "leg", str(tmp_path)]) == 2
    assert GROUP in capsys.readouterr().err


def test_reachable_poses_are_solved(tmp_path: Path) -> None:
    metrics = ("success", "solved_share", "solutions", "position_error", "rotation_error")
    settings = KinematicsSettings(robot=ROBOT, group=GROUP, poses=10, timeout=5.0, metrics=metrics)
    record = KinematicsEpisodeRunner().run(EpisodeSpec(0, {}, 0, 3, settings), tmp_path)
    assert record.status is EpisodeStatus.SUCCEEDED, record.cause
    assert record.metrics["solved_share"] == 1.0 and record.metrics["solutions"] >= 1.0
    assert record.metrics["position_error"] < 1e-5 and record.metrics["rotation_error"] < 1e-5


def test_a_group_without_a_chain_is_refused(tmp_path: Path) -> None:
    settings = KinematicsSettings(robot="dual_panda_moveit_config", group="both_arms", poses=1, metrics=("success",))
    record = KinematicsEpisodeRunner().run(EpisodeSpec(0, {}, 0, 3, settings), tmp_path)
    assert record.status is EpisodeStatus.BROKEN and "both_arms' is not a chain" in record.cause


def test_an_episode_of_another_mode_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="has PlanningSettings; allowed: KinematicsSettings"):
        KinematicsEpisodeRunner().run(EpisodeSpec(0, {}, 0, 3, PlanningSettings(robot=ROBOT)), tmp_path)
