# SPDX-License-Identifier: BSD-3-Clause
"""A record says what ran, as the running parts said it; an episode in which something else ran is invalid."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rospkg

from modular_framework_benchmark.episodes.episode_record import SNAPSHOT_KEYS, EpisodeEnd, make_record
from modular_framework_benchmark.episodes.ros_file_digests import robot_digests
from modular_framework_benchmark.episodes.ros_package_sources import package_source, tree_digest
from modular_framework_benchmark.episodes.ros_running_stack import running_stack
from modular_framework_benchmark.episodes.snapshot import MachineLoad
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.metrics.measurements import ComponentReport
from modular_framework_benchmark.modes.measured_record import Stopwatch, measured_record
from modular_framework_benchmark.records.episode import EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.snapshot_parts import SNAPSHOT_PARTS
from modular_framework_benchmark.records.used_software import UsedSoftware
from modular_framework_planning.plan_statistics import PlannerRun
from modular_framework_ros.component_report import ReportedMethod

REPLACED = "the named software did not run: planner 'BKPIECEE' was named, and RRTConnect planned"


def plan(planner: str, implementation: str, replaced: str = "") -> dict[str, Any]:
    """A planning report of move_group."""
    run = {"pipeline": "ompl", "planner": planner, "settings": {"range": 0.2}, "adapters": ["FixStartStateBounds"]}
    return {"kind": "plan", "run": {**run, "implementation": implementation, "replaced": replaced}}


def stack(tmp_path: Path, *plans: dict[str, Any]) -> dict[str, Any]:
    (tmp_path / "table.world").write_text("<sdf/>")
    (tmp_path / "task.yaml").write_text("name: pick")
    parameters = {
        "robot_description": "<robot/>",
        "gazebo": {"world_file": str(tmp_path / "table.world"), "physics_engine": "mujoco"},
        "gazebo_cameras": {"renderer": "tiny"},
        "task": {"task_constructor_script": str(tmp_path / "task.yaml")},
        "arm": {"gains": {"p": 1.0}},
    }
    ran = running_stack(parameters, {"arm": "position_controllers/JointTrajectoryController"}, [], plans)
    return dict(json.loads(json.dumps(asdict(ran))))  # as it comes from the other process


def record_of(tmp_path: Path, ran: dict[str, Any]) -> Any:
    spec = EpisodeSpec(0, {}, 0, 1, TaskSettings(metrics=("success",)))
    end = EpisodeEnd(spec, tmp_path, time.time(), time.monotonic(), MachineLoad.now())
    return make_record(end.with_status(EpisodeStatus.SUCCEEDED, "", {"ran": ran, "task_s": 1.0}))


def test_a_record_says_planner_settings_implementation_and_digests(tmp_path: Path) -> None:
    ran = stack(tmp_path, plan("PRM", ""), plan("PRM", "OMPL"), {"kind": "ik"})
    snapshot = record_of(tmp_path, ran).snapshot
    assert snapshot["planners"] == {
        "PRM of ompl": {"range": 0.2, "request_adapters": "FixStartStateBounds", "implementation": "OMPL"}
    }
    assert snapshot["physics_engine"] == "mujoco"
    assert snapshot["controllers"] == {"arm": "position_controllers/JointTrajectoryController"}
    assert snapshot["renderer"] == "tiny"
    assert set(snapshot["digests"]) == {"robot description", "world", "task", "controller arm"}
    assert snapshot["digests"]["task"] == hashlib.sha256(b"name: pick").hexdigest()


def test_the_digests_cover_the_files_in_the_command_of_an_external_method(tmp_path: Path) -> None:
    method = tmp_path / "method.py"
    method.write_text("serve()")
    parameters = {"external": {"command": ["python3", str(method), "--fast", str(tmp_path)]}, "other": {"command": 3}}
    digests = running_stack(parameters, {}, ["/external", "/other"], []).digests
    assert digests == {f"method file {tmp_path.name}/method.py": hashlib.sha256(b"serve()").hexdigest()}


def test_a_record_says_the_sources_of_an_external_method_and_which_are_unknown(tmp_path: Path) -> None:
    script = tmp_path / "my_grasps" / "method.py"
    parameters = {
        "narrow": {"command": ["/opt/own/bin/python", str(script), "--fast"], "address": "", "method_sources": "aa"},
        "remote": {"command": [], "address": "ws://127.0.0.1:8700"},
        "top_down": {"yaw_step": 0.1},
    }
    ran = running_stack(parameters, {}, ["/narrow", "/remote", "/top_down"], [])
    snapshot = record_of(tmp_path, json.loads(json.dumps(asdict(ran)))).snapshot
    assert snapshot["methods"] == {
        "bin/python my_grasps/method.py --fast": {"version": "", "sources": "aa"},
        "ws://127.0.0.1:8700": {"version": "", "sources": ""},
    }
    assert snapshot["unknown_sources"] == ("ws://127.0.0.1:8700",)


def test_a_record_says_the_sources_of_a_policy_and_marks_what_the_policy_states(
    tmp_path: Path,
) -> None:
    script = tmp_path / "my_policy" / "policy.py"
    script.parent.mkdir()
    script.write_text("serve()")
    command = ("/opt/own/bin/python", str(script))
    policies = [
        ReportedMethod(command=command, sources="aa", said_name="reach", said_version="1.2"),
        ReportedMethod(command=command, sources="aa", said_name="reach", said_version="1.2"),
        ReportedMethod(address="ws://127.0.0.1:8000"),
    ]
    ran = running_stack({}, {}, [], [], process_methods=policies)
    snapshot = record_of(tmp_path, json.loads(json.dumps(asdict(ran)))).snapshot
    assert snapshot["methods"] == {
        "bin/python my_policy/policy.py": {
            "version": "", "sources": "aa", "said_name": "reach", "said_version": "1.2"
        },
        "ws://127.0.0.1:8000": {"version": "", "sources": ""},
    }  # fmt: skip
    assert snapshot["unknown_sources"] == ("ws://127.0.0.1:8000",)
    assert snapshot["digests"] == {"method file my_policy/policy.py": hashlib.sha256(b"serve()").hexdigest()}


def test_a_record_says_the_sources_of_a_planner_in_its_own_process_or_that_they_are_unknown(tmp_path: Path) -> None:
    runs = [PlannerRun("external", name, {}, sources=sources) for name, sources in (("mine", "aa"), ("old", ""))]
    ran = UsedSoftware().with_plans([*runs, PlannerRun("ompl", "PRM", {})])
    snapshot = record_of(tmp_path, json.loads(json.dumps(asdict(ran)))).snapshot
    sources = {name: planner.get("sources") for name, planner in snapshot["planners"].items()}
    assert sources == {"mine of external": "aa", "old of external": None, "PRM of ompl": None}
    assert snapshot["unknown_sources"] == ("old of external",)


MESH = "<visual name='v'><geometry><mesh{}</mesh></geometry></visual>"


def test_the_digests_of_world_robot_and_objects_cover_the_files_that_they_name(tmp_path: Path) -> None:
    files = {
        "table.world": "<sdf version='1.6'><world name='w'><include><uri>model://shelf</uri></include></world></sdf>",
        "models/shelf/model.sdf": f"<sdf version='1.6'><model name='m'>{MESH.format('><uri>model://shelf/a.stl</uri>')}"
        "</model></sdf>",
        "models/shelf/a.stl": "1",
        "models/can/model.sdf": f"<sdf version='1.6'><model name='m'>{MESH.format('><uri>model://can/b.stl</uri>')}"
        "</model></sdf>",
        "models/can/b.stl": "1",
        "arm.stl": "1",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)

    robot_mesh = MESH.format(f" filename='file://{tmp_path}/arm.stl'>")

    def digests(parameter: float = 1.0) -> Mapping[str, str]:
        robot_digests.cache_clear()  # as in another process
        parameters = {
            "robot_description": f"<robot>{robot_mesh}</robot>",
            "gazebo_model_path": str(tmp_path / "models"),
            "gazebo": {"world_file": str(tmp_path / "table.world")},
            "arm": {"gains": {"p": parameter}},
        }
        return running_stack(parameters, {"arm": "a/B"}, [], [], ["can"]).digests

    before = digests()
    assert digests() == before
    assert {name for name, digest in digests(2.0).items() if digest != before[name]} == {"controller arm"}
    for file, name in {
        "models/shelf/a.stl": "world",
        "models/can/b.stl": "object can/model.sdf",
        "arm.stl": "robot meshes",
    }.items():
        (tmp_path / file).write_text("22")
        after = digests()
        assert {each for each, digest in after.items() if digest != before[each]} == {name}
        before = after


def test_every_part_of_a_record_is_declared(tmp_path: Path) -> None:
    task = record_of(tmp_path, stack(tmp_path)).snapshot
    report = ComponentReport("planning", "boxes", True, "", 0.0, 1.0, wall_s=1.0, ran=UsedSoftware())
    spec = EpisodeSpec(0, {}, 0, 1, TaskSettings(metrics=("success",)))
    single = measured_record(spec, EpisodeStatus.SUCCEEDED, "", report=report, folder=tmp_path, watch=Stopwatch())
    assert task.keys() | single.snapshot.keys() | set(SNAPSHOT_KEYS) <= SNAPSHOT_PARTS.keys()


def test_a_record_says_the_versions_of_the_environment(tmp_path: Path) -> None:
    snapshot = record_of(tmp_path, stack(tmp_path)).snapshot
    assert snapshot["packages"]["numpy"] == np.__version__
    manifest = Path(rospkg.RosPack().get_path("rospy")) / "package.xml"
    assert f"<version>{snapshot['ros_packages']['rospy']}</version>" in manifest.read_text()
    assert len(snapshot["environment"]) == 64


def test_a_record_says_by_which_method_poses_were_solved_and_for_which_plugin(tmp_path: Path) -> None:
    plans = [plan("RRT", "OMPL"), plan("RRT", "OMPL")]
    plans[1]["run"]["solver"] = "closed form"
    kinematics = {"arm": {"kinematics_solver": "kdl_kinematics_plugin/KDLKinematicsPlugin"}, "wrist": {}}
    ran = running_stack({"robot_description_kinematics": kinematics}, {}, [], plans)
    snapshot = record_of(tmp_path, json.loads(json.dumps(asdict(ran)))).snapshot
    assert snapshot["solver"] == "closed form"
    assert snapshot["substitutions"] == (
        "the framework's inverse kinematics for kdl_kinematics_plugin/KDLKinematicsPlugin",
    )


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"move_group": {"collision_detector": "Bullet"}}, "the framework's exact collision checker for Bullet"),
        ({"collision_detector": "hybrid"}, "the framework's exact collision checker for hybrid"),
        ({"collision_detector": "FCL"}, ""),
        ({"move_group": {"collision_detector": "my_arm.checks/MyChecker"}}, ""),
        ({}, ""),
    ],
)
def test_a_record_says_which_collision_checker_ran_and_for_which_detector(
    tmp_path: Path, parameters: dict[str, Any], text: str
) -> None:
    plans = [plan("RRT", "OMPL"), plan("RRT", "OMPL")]
    plans[1]["run"]["collision_checker"] = "checks/MyChecker"
    ran = running_stack(parameters, {}, [], plans)
    snapshot = record_of(tmp_path, json.loads(json.dumps(asdict(ran)))).snapshot
    assert snapshot["collision_checker"] == "checks/MyChecker"
    assert snapshot["substitutions"] == ((text,) if text else ())


def test_a_documented_substitution_is_recorded_and_the_episode_counts(tmp_path: Path) -> None:
    record = record_of(tmp_path, stack(tmp_path, plan("PRM", "CBiRRT"), plan("PRM", "OMPL")))
    assert record.status is EpisodeStatus.SUCCEEDED
    assert record.snapshot["planners"]["PRM of ompl"]["implementation"] == "CBiRRT, OMPL"
    assert record.snapshot["substitutions"] == ("CBiRRT for PRM, which cannot keep path constraints",)


def test_an_episode_in_which_another_planner_ran_is_invalid_and_says_which(tmp_path: Path) -> None:
    record = record_of(tmp_path, stack(tmp_path, plan("RRTConnect", "compiled", replaced="BKPIECEE")))
    assert record.status is EpisodeStatus.INVALID
    assert record.cause == REPLACED
    assert record.metrics == {"success": None}


def test_a_plan_without_simulation_by_another_planner_is_invalid(tmp_path: Path) -> None:
    run = PlannerRun("ompl", "RRTConnect", {}, (), "compiled", "BKPIECEE")
    ran = UsedSoftware().with_plans([run])
    report = ComponentReport("planning", "boxes", True, "", 0.0, 1.0, wall_s=1.0, ran=ran)
    spec = EpisodeSpec(0, {}, 0, 1, TaskSettings(metrics=("success", "planning_time")))
    record = measured_record(
        spec, EpisodeStatus.SUCCEEDED, "SUCCESS", report=report, folder=tmp_path, watch=Stopwatch()
    )
    assert (record.status, record.cause) == (EpisodeStatus.INVALID, REPLACED)
    assert record.metrics == {"success": None, "planning_time": None}


def test_a_sequence_that_failed_says_what_planned_its_motions(tmp_path: Path) -> None:
    runs = [plan("LIN", "")["run"], plan("RRTConnect", "compiled", replaced="BKPIECEE")["run"]]
    record = record_of(tmp_path, stack(tmp_path, {"kind": "sequence", "error_code": -1, "runs": runs}))
    assert set(record.snapshot["planners"]) == {"LIN of ompl", "RRTConnect of ompl"}
    assert (record.status, record.cause) == (EpisodeStatus.INVALID, REPLACED)


def test_the_digest_of_a_method_changes_with_its_sources_and_not_with_caches(tmp_path: Path) -> None:
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "method.py").write_text("YAW_STEP = 1")
    before = tree_digest([tmp_path])
    (tmp_path / "src" / "__pycache__").mkdir()
    (tmp_path / "src" / "__pycache__" / "method.pyc").write_bytes(b"1")
    assert tree_digest([tmp_path]) == before
    (tmp_path / "src" / "method.py").write_text("YAW_STEP = 2")
    assert tree_digest([tmp_path]) != before


@pytest.mark.parametrize("package", ["top_down_grasps", "modular_framework_benchmark"])
def test_a_package_of_the_workspace_has_a_version_and_a_digest(package: str) -> None:
    version, digest = package_source(package)
    assert version and len(digest) == 64
    assert package_source("no_such_package") == ("", "")
