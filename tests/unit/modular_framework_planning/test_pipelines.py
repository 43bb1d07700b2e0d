# SPDX-License-Identifier: BSD-3-Clause
"""Pipelines: planners and adapters by name, settings, path constraints, mended starts, repeated plans."""

from __future__ import annotations

import dataclasses
import os
import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.constraints.constraint_kinds import FrameOnRobot, OrientationConstraint
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import ErrorCode, ModelError, PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planners.ompl.planner import search_threads
from modular_framework_planning.planners.ompl.planner_settings import PLANNERS, parameter_faults
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planner_configurations import PlannerConfigurations
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, Planner, PlanningProblem
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec, read_pipeline_spec
from modular_framework_planning.planning_pipeline.plugins import DEFAULT_ADAPTERS, make_adapters, make_planner
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.reproducible.scene_pickling import from_bytes, to_bytes
from modular_framework_planning.reproducible.seeded_planning import SeededPlanning
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

GROUP = "arm_and_manipulator"
TIP = "eg_manipulator"
START = (1.57, -1.57, 1.2, -1.2, -1.57, 0.0)
GOAL = (0.2, -1.57, 1.2, -1.2, -1.57, 0.0)


def place(model: RobotModel, values: tuple[float, ...]) -> np.ndarray:
    return model.merge(model.default_positions(), dict(zip(model.group(GROUP).joints, values, strict=True)))


def wall_scene(model: RobotModel) -> PlanningScene:
    """A block where the tip would be half-way to the goal."""
    middle = 0.5 * (place(model, START) + place(model, GOAL))
    pose = pin.SE3(np.eye(3), model.link_transforms(middle)[TIP].translation)
    scene = empty_scene(model, place(model, START))
    return scene.with_object(CollisionObject("wall", pose, ((Box(0.15, 0.15, 0.3), pin.SE3.Identity()),)))


def goal(model: RobotModel, values: tuple[float, ...] = GOAL) -> tuple[JointGoal, ...]:
    return (JointGoal(dict(zip(model.group(GROUP).joints, values, strict=True))),)


def wall_request(model: RobotModel, **changes: Any) -> PlanningRequest:
    request = PlanningRequest(
        wall_scene(model), GROUP, goal(model), allowed_time_s=60.0, velocity_scaling=1.0, acceleration_scaling=1.0
    )
    return dataclasses.replace(request, **changes)


def spec(**settings: Any) -> PipelineSpec:
    return PipelineSpec("ompl", "ompl_interface/OMPLPlanner", DEFAULT_ADAPTERS, PipelineSettings(**settings))


@pytest.fixture(scope="module")
def pool(model: RobotModel) -> KinematicsPool:
    return KinematicsPool(model)


@pytest.fixture(scope="module")
def pipeline(model: RobotModel, pool: KinematicsPool) -> PlanningPipeline:
    return spec().build(model, pool)


def failure(pipeline: PlanningPipeline, request: PlanningRequest) -> PlanningError:
    with pytest.raises(PlanningError) as caught:
        pipeline.plan(request)
    return caught.value


def arrives(answer: PlanningResult, values: tuple[float, ...] = GOAL) -> bool:
    return bool(np.allclose(answer.trajectory.positions[-1], values, atol=1e-9))


@pytest.mark.parametrize(
    "name", ["RRTConnect", "geometric::KPIECE", "LBKPIECEkConfigDefault", "PRM", "arm_and_manipulator[BKPIECE]"]
)
def test_planners_answer_to_the_names_moveit_gives_them(
    model: RobotModel, pipeline: PlanningPipeline, name: str
) -> None:
    answer = pipeline.plan(wall_request(model, planner_id=name))
    assert arrives(answer) and answer.planner_id in name


@pytest.mark.parametrize("name", ["BITstar", "RRTstar"])
def test_planners_that_improve_their_path_stop_with_the_time_and_return_what_they_have(
    model: RobotModel, pipeline: PlanningPipeline, name: str
) -> None:
    begun = time.monotonic()
    request = wall_request(model, planner_id=name, allowed_time_s=3.0)
    try:
        assert arrives(pipeline.plan(request))
    except PlanningError as error:  # a busy computer may be too slow for a path or for its check: it must say so
        assert error.code == ErrorCode.TIMED_OUT, error.reason
        assert "time ran out after" in error.reason or "its validation had not finished" in error.reason, error.reason
    assert time.monotonic() - begun > 1.9, "the time allowed is used, but for the last second"


def test_a_planner_that_is_not_there_is_replaced_by_the_default_one(
    model: RobotModel, pipeline: PlanningPipeline, caplog: pytest.LogCaptureFixture
) -> None:
    default = pipeline.plan(wall_request(model)).planner_id
    answer = pipeline.plan(wall_request(model, planner_id="BiTRRT"))
    assert arrives(answer) and answer.planner_id == default
    assert all(name in caplog.text for name in ("planner_id 'BiTRRT'", f"default planner '{default}'", *PLANNERS))


def test_a_default_planner_that_is_not_there_is_refused_with_the_list(model: RobotModel, pool: KinematicsPool) -> None:
    settings = PipelineSettings(groups={GROUP: {"default_planner_config": "BiTRRT"}})
    for name in ("", "nobody"):
        error = failure(PipelineSpec(settings=settings).build(model, pool), wall_request(model, planner_id=name))
        assert error.code == ErrorCode.PLANNING_FAILED
        assert all(word in error.reason for word in ("BiTRRT", *PLANNERS))


def test_projections_and_segment_lengths_of_the_group_are_honoured(model: RobotModel, pool: KinematicsPool) -> None:
    for text in ("joints(shoulder_pan_joint,elbow_joint)", f"link({TIP})"):
        given = spec(groups={GROUP: {"projection_evaluator": text, "longest_valid_segment_fraction": 0.001}})
        assert arrives(given.build(model, pool).plan(wall_request(model, planner_id="KPIECE")))
    for text, part in (("joints(nobody)", "nobody"), ("link(nobody)", "nobody"), ("cells", "must be joints")):
        given = spec(groups={GROUP: {"projection_evaluator": text}})
        assert part in failure(given.build(model, pool), wall_request(model, planner_id="KPIECE")).reason


def test_settings_of_planners_are_checked() -> None:
    assert parameter_faults("RRTConnect", {"type": "geometric::RRTConnect", "range": "0.0"}) == []
    assert "allowed: enforce_constrained_state_space" in parameter_faults("RRTConnect", {"rnge": 1.0})[0]
    assert "cannot be read" in parameter_faults("RRT", {"goal_bias": "much"})[0]
    assert "cannot be set" in parameter_faults("BFMT", {"optimality": 1})[0]
    assert parameter_faults("SPARS", {"anything": 1}) == [], "nothing is known of a planner that is not there"


def test_a_setting_that_cannot_be_read_fails_the_plan(model: RobotModel, pool: KinematicsPool) -> None:
    given = spec(planner_configs={"mine": {"type": "geometric::RRT", "goal_bias": "much"}}).build(model, pool)
    error = failure(given, wall_request(model, planner_id="mine"))
    assert "goal_bias" in error.reason and "much" in error.reason


def test_settings_of_a_group_come_before_those_of_all() -> None:
    store = PlannerConfigurations({"RRT": {"range": 0.1, "goal_bias": 0.2}})
    store.set("RRT", "arm", {"range": "0.3"}, replace=False)
    assert store.get("RRT", "arm") == {"range": "0.3", "goal_bias": 0.2}
    assert store.get("RRT") == store.get("RRT", "hand") == {"range": 0.1, "goal_bias": 0.2}
    store.set("RRT", "", {"goal_bias": "0.5"}, replace=True)
    assert store.get("RRT") == {"goal_bias": "0.5"}
    copy = PlannerConfigurations({})
    copy.restore(store.snapshot())
    assert copy.get("RRT", "arm") == store.get("RRT", "arm")


class Straight(Planner):
    """A user's planner: the straight way."""

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        return PlannedPath(np.vstack([problem.start_values, problem.goal_states()[0]]))


def test_a_planner_of_ones_own_is_named_by_module_and_class(model: RobotModel, pool: KinematicsPool) -> None:
    own = make_planner(f"{Straight.__module__}/Straight", model, PipelineSettings())
    given = PlanningPipeline(pool, PipelineSettings(), own, adapters=make_adapters(), name="own")
    free = PlanningRequest(empty_scene(model, place(model, START)), GROUP, goal(model), planner_id="whatever")
    assert arrives(given.plan(free))
    error = failure(given, wall_request(model))
    assert error.code == ErrorCode.INVALID_MOTION_PLAN, "the validation does not trust it"
    assert "touches object 'wall'" in error.reason


@pytest.mark.parametrize(
    ("names", "part"),
    [
        ("default_planner_request_adapters/AddEverything", "default_planner_request_adapters/FixWorkspaceBounds"),
        ("default_planer_request_adapters/AddTimeOptimalParam", "mean '.*_adapters/AddTimeOptimalParameterization'"),
        ("no_module/Adapter", "module/Class"),
        ("json/JSONDecoder", "no method adapt_and_plan"),
    ],
)
def test_an_unknown_adapter_is_refused_with_the_list(names: str, part: str) -> None:
    with pytest.raises(ModelError, match=part) as caught:
        make_adapters(names)
    assert names in caught.value.reason


@pytest.mark.parametrize(
    ("plugin", "part"),
    [
        ("chomp_interface/CHOMPPlanner", "ompl_interface/OMPLPlanner"),
        ("ompl_interface::OMPL", "did you mean 'ompl_interface/OMPLPlanner'"),
        ("Nothing", "module/Class"),
        ("json/JSONDecoder", "JSONDecoder is not derived from .*planner_interface.Planner"),
        (f"{Planner.__module__}/Planner", "Planner does not define plan"),
        ("this_module_is_missing/Planner", "this_module_is_missing"),
    ],
)
def test_an_unknown_planner_plugin_is_refused_with_the_list(model: RobotModel, plugin: str, part: str) -> None:
    with pytest.raises(ModelError, match=part) as caught:
        make_planner(plugin, model, PipelineSettings())
    assert plugin in caught.value.reason


def test_every_adapter_of_moveit_is_known() -> None:
    assert len(make_adapters(DEFAULT_ADAPTERS)) == 6
    assert make_adapters("default_planner_request_adapters/ResolveConstraintFrames") == ()


def test_a_start_beyond_a_bound_is_left_from_where_the_robot_is_or_refused(
    model: RobotModel, pipeline: PlanningPipeline
) -> None:
    upper = float(model.upper[model.index["wrist_3_joint"]])
    far = empty_scene(model, place(model, (1.57, -1.57, 1.2, -1.2, -1.57, upper + 0.5)))
    error = failure(pipeline, PlanningRequest(far, GROUP, goal(model)))
    assert error.code == ErrorCode.START_STATE_INVALID and "wrist_3_joint" in error.reason
    near = empty_scene(model, place(model, (1.57, -1.57, 1.2, -1.2, -1.57, upper + 0.05)))
    answer = pipeline.plan(PlanningRequest(near, GROUP, goal(model)))
    assert answer.trajectory.positions[0][5] == pytest.approx(upper + 0.05), "the motion begins where the robot is"
    bare = PipelineSpec(adapters="").build(model, KinematicsPool(model))
    assert "FixStartStateBounds" in failure(bare, PlanningRequest(near, GROUP, goal(model))).reason


def level(model: RobotModel, tolerance: float) -> KinematicConstraints:
    """The tip keeps the direction of its axis at the start."""
    frame = model.pin_model.frames[model.frame_ids[TIP]]
    target = model.link_transforms(place(model, START))[TIP].rotation
    turn = OrientationConstraint(
        FrameOnRobot(TIP, frame.parentJoint, frame.placement),
        FrameOnRobot("world", 0, pin.SE3.Identity()),
        target,
        np.array([tolerance, tolerance, 7.0]),
    )
    return KinematicConstraints(model, (), (), (turn,))


@pytest.mark.parametrize("tolerance", [0.8, 0.1, 0.02])
def test_path_constraints_hold_along_the_whole_motion(
    model: RobotModel, pipeline: PlanningPipeline, tolerance: float
) -> None:
    constraints = level(model, tolerance)
    answer = pipeline.plan(wall_request(model, path_constraints=constraints))
    motion = MotionChecker(ExactCollisionChecker(wall_scene(model)), model.group(GROUP).indices, answer.start)
    curve = answer.trajectory.curve(0.004)
    assert arrives(answer) and len(curve) > 100
    assert all(constraints.are_satisfied(motion.full_positions(values)) for values in curve)


def test_a_start_or_goal_that_violates_path_constraints_says_so(model: RobotModel, pipeline: PlanningPipeline) -> None:
    tilted = (0.2, -1.57, 1.2, -0.6, -1.57, 0.0)
    error = failure(pipeline, wall_request(model, goals=goal(model, tilted), path_constraints=level(model, 0.1)))
    assert error.code == ErrorCode.GOAL_VIOLATES_PATH_CONSTRAINTS, error.reason
    scene = empty_scene(model, place(model, (1.57, -1.57, 1.2, -1.0, -1.57, 0.0)))
    request = PlanningRequest(scene, GROUP, goal(model, START), path_constraints=level(model, 0.1))
    answer = pipeline.plan(request)
    assert answer.trajectory.positions[0][3] == pytest.approx(-1.0), "FixStartStatePathConstraints leads it there"
    bare = PipelineSpec(adapters="").build(model, KinematicsPool(model))
    assert failure(bare, request).code == ErrorCode.START_STATE_VIOLATES_PATH_CONSTRAINTS


def test_requests_reach_another_process_whole(model: RobotModel) -> None:
    request = wall_request(model, path_constraints=level(model, 0.2), cancelled=threading.Event().is_set)
    request = dataclasses.replace(request, cancelled=bool)
    request.scene.objects["wall"].shapes[0][0].geometry  # noqa: B018 - built geometry must not be sent
    back = from_bytes(to_bytes(request), model)
    assert back.scene.model is model and back.goals == request.goals
    assert np.array_equal(back.scene.positions, request.scene.positions)
    assert back.path_constraints.are_satisfied(request.scene.positions)
    assert not ExactCollisionChecker(back.scene).contacts(back.scene.positions)


def same(first: Trajectory, second: Trajectory) -> bool:
    return all(
        np.array_equal(getattr(first, name), getattr(second, name))
        for name in ("times", "positions", "velocities", "accelerations")
    )


@pytest.fixture(scope="module")
def seeded(model: RobotModel) -> Iterator[list[SeededPlanning]]:
    """Two worker processes, as two runs of the node have them."""
    workers = [SeededPlanning(model, [spec()]) for _ in range(2)]
    yield workers
    for worker in workers:
        worker.close()
        worker.close()


def test_a_seed_repeats_a_plan_bit_for_bit_in_two_runs_and_at_the_same_time(
    model: RobotModel, pipeline: PlanningPipeline, seeded: list[SeededPlanning]
) -> None:
    request = wall_request(model)
    answers = [seeded[0].plan(pipeline, request, 7), seeded[1].plan(pipeline, request, 7)]
    assert len(answers[0].path) > 2, "the problem needs a search"

    def work() -> None:
        answers.append(seeded[0].plan(pipeline, request, 7))

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120.0)
    assert len(answers) == 5 and all(same(answers[0].trajectory, item.trajectory) for item in answers[1:])
    assert not same(answers[0].trajectory, seeded[0].plan(pipeline, request, 8).trajectory)


def test_seeded_plans_fail_with_a_reason_and_can_be_cancelled(
    model: RobotModel, pipeline: PlanningPipeline, seeded: list[SeededPlanning]
) -> None:
    cases = [
        (wall_request(model, planner_id="PRM"), 1, ErrorCode.PLANNING_FAILED, "threads"),
        (wall_request(model, cancelled=lambda: True), 1, ErrorCode.PREEMPTED, "cancelled"),
        (wall_request(model), -1, ErrorCode.FAILURE, "at least 0"),
    ]
    for request, seed, code, text in cases:
        with pytest.raises(PlanningError, match=text) as caught:
            seeded[0].plan(pipeline, request, seed)
        assert caught.value.code == code


@pytest.mark.parametrize("value", [0, -1, 1.5, "two", True])
def test_a_number_of_search_threads_that_is_none_is_refused_with_what_is_allowed(value: object) -> None:
    with pytest.raises(
        PlanningError, match=r"pipeline 'ompl': search_threads is .*; allowed: a whole number, at least 1"
    ):
        read_pipeline_spec("ompl", {"search_threads": value}, {}, {})


def test_search_threads_of_a_pipeline_come_before_those_of_the_node() -> None:
    assert read_pipeline_spec("ompl", {"search_threads": 3}, {}, {"search_threads": 2}).settings.search_threads == 3
    assert read_pipeline_spec("ompl", {}, {}, {"search_threads": 2}).settings.search_threads == 2


@pytest.mark.parametrize(
    ("joints", "load", "changes", "expected"),
    [
        (14, 0.4, {}, 3),
        (14, 0.0, {}, 4),
        (14, 7.0, {}, 1),
        (8, 0.0, {}, 1),
        (14, 0.0, {"repeatable": True}, 1),
        (14, 0.0, {"request": SimpleNamespace(seed=5)}, 1),
        (14, 0.0, {"settings": PipelineSettings(seed=0)}, 1),
        (8, 7.0, {"settings": PipelineSettings(seed=0, search_threads=2)}, 2),
    ],
)
def test_large_groups_without_a_seed_are_searched_in_as_many_threads_as_processors_are_free(
    monkeypatch: pytest.MonkeyPatch, joints: int, load: float, changes: dict[str, Any], expected: int
) -> None:
    processors = 4 if load else 8
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(processors)))
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0))
    problem = {
        "settings": PipelineSettings(),
        "repeatable": False,
        "request": SimpleNamespace(seed=None),
        "group": SimpleNamespace(joints=("joint",) * joints),
        **changes,
    }
    assert search_threads(SimpleNamespace(**problem)) == expected  # type: ignore[arg-type]


@pytest.mark.parametrize("given", [{}, {"default_planner_config": "None"}, {"default_planner_config": None}])
def test_a_group_without_a_default_planner_gets_rrt_connect(
    model: RobotModel, pool: KinematicsPool, given: dict[str, Any]
) -> None:
    settings = read_pipeline_spec("ompl", {GROUP: {**given, "planner_configs": ["RRTstar"]}}, {}, {}).settings
    answer = PipelineSpec(settings=settings).build(model, pool).plan(wall_request(model))
    assert arrives(answer) and answer.planner_id == "RRTConnect"
