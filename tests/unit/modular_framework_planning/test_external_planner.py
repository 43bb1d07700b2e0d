# SPDX-License-Identifier: BSD-3-Clause
"""A planner in its own process: what it receives, how its path is judged, and how each of its faults ends the plan."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import psutil
import pytest

from mbf_method.errors import MethodFault
from mbf_method.path_request import PathRequest
from mbf_method.wire import unpack
from modular_framework_planning.errors import ErrorCode, ModelError, PlanningError
from modular_framework_planning.geometry.shapes import Box, Cylinder, Mesh
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.planning_request import JointGoal, PipelineSettings, PlanningRequest
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_pipeline.plugins import DEFAULT_ADAPTERS
from modular_framework_planning.planning_scene.planning_scene import AttachedObject, CollisionObject, empty_scene
from modular_framework_planning.reproducible.seeded_planning import SeededPlanning
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_ros.reported_figures import (
    PLANNER_FAULT,
    PLANNER_METHOD_TIME,
    PLANNER_QUEUE_TIME,
    PLANNER_TRANSPORT_TIME,
)
from modular_framework_testing.planning.planner_conformance import (
    GOAL,
    GROUP,
    JOINTS,
    LIMITS,
    SRDF,
    START,
    URDF,
    WALL_SIZE_M,
    WALL_XYZ_M,
    PlannerConformance,
)

PLUGIN = "mbf_method/ExternalPlanner"
FAULTY_PLANNER = str(Path(__file__).parents[1] / "mbf_method/faulty_planner.py")
MODEL = RobotModel(URDF, SRDF, LIMITS)
IDENTITY = pin.SE3.Identity()

MakePipeline = Callable[..., PlanningPipeline]


class TestExternal(PlannerConformance):
    """The straight path of a process."""

    plugin = PLUGIN
    parameters = {"command": [sys.executable, FAULTY_PLANNER, "none"]}
    avoids_obstacles = False


def spec_of(fault: str, **parameters: Any) -> PipelineSpec:
    parameters = {"command": [sys.executable, FAULTY_PLANNER, fault], **parameters}
    return PipelineSpec("external", PLUGIN, DEFAULT_ADAPTERS, PipelineSettings(parameters=parameters))


@pytest.fixture
def make_pipeline() -> Iterator[MakePipeline]:
    """Yields a function that creates a pipeline with a faulty planner; then checks that no process remains."""
    pipelines: list[PlanningPipeline] = []

    def make(fault: str, **parameters: Any) -> PlanningPipeline:
        pipelines.append(spec_of(fault, **parameters).build(MODEL, KinematicsPool(MODEL)))
        return pipelines[-1]

    yield make
    for pipeline in pipelines:
        pipeline.close()
    assert FAULTY_PLANNER not in [word for child in psutil.Process().children() for word in child.cmdline()]


def request_for(planner_id: str = "", **changes: Any) -> PlanningRequest:
    scene = empty_scene(MODEL, MODEL.merge(MODEL.default_positions(), dict(zip(JOINTS, START, strict=True))))
    goal = JointGoal(dict(zip(JOINTS, GOAL, strict=True)))
    return replace(PlanningRequest(scene, GROUP, (goal,), planner_id=planner_id, allowed_time_s=5.0), **changes)


def refused(pipeline: PlanningPipeline, request: PlanningRequest) -> PlanningError:
    with pytest.raises(PlanningError) as caught:
        pipeline.plan(request)
    return caught.value


@pytest.mark.parametrize(
    ("fault", "code", "kind", "reason"),
    [
        ("dies", ErrorCode.COMMUNICATION_FAILURE, MethodFault.DIED, "was ended by SIGKILL"),
        ("hangs", ErrorCode.TIMED_OUT, MethodFault.LATE, "no result within"),
        ("raises", ErrorCode.PLANNING_FAILED, MethodFault.RAISED, "ValueError: no roadmap"),
        ("returns NaN", ErrorCode.INVALID_MOTION_PLAN, MethodFault.INVALID_RESULT, "positions[1] is not finite"),
        ("has too few columns", ErrorCode.INVALID_MOTION_PLAN, MethodFault.INVALID_RESULT, "shape (2, 2)"),
        ("ends elsewhere", ErrorCode.INVALID_MOTION_PLAN, MethodFault.INVALID_RESULT, "the nearest goal at 1.2000"),
        ("leaves the limits", ErrorCode.INVALID_MOTION_PLAN, MethodFault.INVALID_RESULT, "from -2.5000 to 2.5000"),
        ("is too large", ErrorCode.INVALID_MOTION_PLAN, MethodFault.TOO_LARGE, "larger than 100000 bytes"),
        ("has too many points", ErrorCode.INVALID_MOTION_PLAN, MethodFault.INVALID_RESULT, "at most 100 are allowed"),
    ],
)
def test_a_fault_ends_the_plan_with_its_class_and_the_next_plan_succeeds(
    make_pipeline: MakePipeline, fault: str, code: ErrorCode, kind: MethodFault, reason: str
) -> None:
    pipeline = make_pipeline(fault, size_limit=100_000, max_path_points=100)
    pipeline.start()
    begin_s = time.monotonic()
    error = refused(pipeline, request_for("faulty", allowed_time_s=1.0 if fault == "hangs" else 5.0))
    assert time.monotonic() - begin_s < 5.0
    assert error.code is code
    assert "the external planner failed: " in error.reason and reason in error.reason
    assert error.statistics is not None and error.statistics.figures[PLANNER_FAULT] == kind
    assert pipeline.plan(request_for()).path.tolist() == [list(START), list(GOAL)]


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"command": [sys.executable, FAULTY_PLANNER, "exits"]}, "exited with code 3 before the method was ready"),
        ({"command": ["/no/such/python"]}, "cannot be started"),
        ({"command": []}, "set one of them"),
    ],
)
def test_a_planner_that_does_not_start_has_its_cause(
    make_pipeline: MakePipeline, parameters: dict[str, Any], reason: str
) -> None:
    pipeline = make_pipeline("none", **parameters)
    with pytest.raises(PlanningError) as caught:
        pipeline.start()
    error = refused(pipeline, request_for())
    assert error.code is caught.value.code is ErrorCode.COMMUNICATION_FAILURE
    assert reason in error.reason and reason in caught.value.reason
    assert error.statistics is not None and error.statistics.figures[PLANNER_FAULT] == MethodFault.NOT_STARTED


def test_no_path_is_no_fault(make_pipeline: MakePipeline) -> None:
    error = refused(make_pipeline("finds no path"), request_for("faulty"))
    assert error.code is ErrorCode.PLANNING_FAILED and "found no path" in error.reason
    assert error.statistics is not None and PLANNER_FAULT not in error.statistics.figures


def test_a_colliding_path_fails_the_validation(make_pipeline: MakePipeline) -> None:
    request = request_for()
    wall = CollisionObject("wall", pin.SE3(np.eye(3), np.array(WALL_XYZ_M)), ((Box(*WALL_SIZE_M), IDENTITY),))
    error = refused(make_pipeline("none"), replace(request, scene=request.scene.with_object(wall)))
    assert error.code is ErrorCode.INVALID_MOTION_PLAN
    assert "fails the final validation" in error.reason and "'wall'" in error.reason


def test_a_cancelled_plan_ends_at_once(make_pipeline: MakePipeline) -> None:
    pipeline, cancelled = make_pipeline("hangs"), threading.Event()
    pipeline.start()
    threading.Timer(0.2, cancelled.set).start()
    begin_s = time.monotonic()
    error = refused(pipeline, request_for("faulty", allowed_time_s=30.0, cancelled=cancelled.is_set))
    assert error.code is ErrorCode.PREEMPTED
    assert time.monotonic() - begin_s < 5.0


def test_the_times_of_function_queue_and_transport_are_separate(make_pipeline: MakePipeline) -> None:
    pipeline = make_pipeline("none")
    pipeline.start()
    result = pipeline.plan(request_for())
    times = [
        result.statistics.figures[figure]
        for figure in (PLANNER_METHOD_TIME, PLANNER_QUEUE_TIME, PLANNER_TRANSPORT_TIME)
    ]
    assert min(times) >= 0.0 and times[2] > 0.0
    assert sum(times) < result.total_time_s


def test_the_request_describes_robot_and_scene_and_a_seed_repeats_it(
    make_pipeline: MakePipeline, tmp_path: Path
) -> None:
    triangle = Mesh(np.array([[5.0, 0.0, 0.0], [5.0, 1.0, 0.0], [5.0, 0.0, 1.0]]), np.array([[0, 1, 2]]))
    away = pin.SE3(np.eye(3), np.array([3.0, 0.0, 0.0]))
    scene = request_for().scene
    scene = scene.with_object(CollisionObject("things", away, ((Cylinder(0.4, 0.1), away), (triangle, IDENTITY))))
    held = CollisionObject("held", pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0])), ((Box(0.1, 0.02, 0.02), IDENTITY),))
    scene = scene.with_attached(AttachedObject(held, "link_3", frozenset({"link_2"})))
    scene = scene.with_acm(scene.acm.with_entry("things", "link_1", True))
    pipeline = make_pipeline("none", record_inputs=str(tmp_path))
    seeded = SeededPlanning(MODEL, [spec_of("none")])
    seeded.start()
    for seed in (1, 1, 2):
        seeded.plan(pipeline, request_for("mine", scene=scene), seed)
    first, again, other = (
        PathRequest.from_message(unpack(file.read_bytes())) for file in sorted(tmp_path.glob("*.msgpack"))
    )
    assert first.seed == again.seed != other.seed
    assert (first.planner, first.group, first.frame, first.joint_names) == ("mine", GROUP, "base", JOINTS)
    assert first.start.tolist() == list(START) and first.goals.tolist() == [list(GOAL)]
    assert first.lower.tolist() == [-2.5] * 3 and first.max_velocity.tolist() == pytest.approx([0.2] * 3)
    cylinder, mesh, box = first.obstacles
    assert (cylinder.kind, cylinder.dimensions.tolist(), cylinder.pose[0, 3]) == ("cylinder", [0.1, 0.4], 6.0)
    assert (mesh.name, mesh.kind, mesh.triangles.tolist()) == ("things", "mesh", [[0, 1, 2]])
    assert (box.link, box.pose[0, 3], cylinder.link) == ("link_3", 0.3, "")
    allowed = {frozenset(pair) for pair in first.allowed_contacts}
    assert allowed == {
        frozenset(pair)
        for pair in (
            ("link_1", "link_2"), ("link_2", "link_3"), ("link_1", "things"), ("link_3", "held"), ("link_2", "held")
        )
    }  # fmt: skip
    assert "<link name='link_3'>" in first.urdf and "disable_collisions" in first.srdf


def test_an_invalid_parameter_is_refused(make_pipeline: MakePipeline) -> None:
    with pytest.raises(ModelError, match="external planner: parameter 'start_limit' is 0"):
        make_pipeline("none", start_limit=0)
