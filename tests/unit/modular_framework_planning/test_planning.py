# SPDX-License-Identifier: BSD-3-Clause
"""Plans are safe and timed within limits, and failures have reasons; verdicts equal those of an independent checker."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pinocchio as pin
import pytest
from pose_difference import pose_difference

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
    PoseGoal,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.robot_model.urdf_document import package_resolver
from modular_framework_planning.trajectory_processing.time_parameterization import WINDOW_S
from modular_framework_testing.planning.independent_checker import IndependentChecker
from modular_framework_testing.planning.independent_checker import box as solid_box

GROUP = "arm_and_manipulator"
PALM = "ezgripper_palm_link"
BOXES = 6
PLANS = 50


@pytest.fixture(scope="module")
def pipeline(model: RobotModel) -> PlanningPipeline:
    return PipelineSpec(settings=PipelineSettings(seed=3)).build(model, KinematicsPool(model))


@pytest.fixture(scope="module")
def checker(robot: object) -> IndependentChecker:
    return IndependentChecker(robot.urdf, robot.srdf, package_resolver)


def at(x: float, y: float, z: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def random_world(model: RobotModel, rng: np.random.Generator) -> tuple[PlanningScene, list[tuple[object, ...]]]:
    scene, world = empty_scene(model), []
    for number in range(BOXES):
        angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.45, 0.9)
        pose = at(distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.9, 1.6))
        size = rng.uniform(0.05, 0.25, 3)
        scene = scene.with_object(CollisionObject(f"b{number}", pose, ((Box(*size), pin.SE3.Identity()),)))
        world.append((f"b{number}", solid_box(*size), pose.homogeneous))
    return scene, world


def random_positions(model: RobotModel, rng: np.random.Generator) -> np.ndarray:
    positions = model.default_positions()
    positions[model.group(GROUP).indices] = rng.uniform(-np.pi, np.pi, 6)
    return positions


def named(model: RobotModel, positions: np.ndarray) -> dict[str, float]:
    return dict(zip(model.joint_names, positions.tolist(), strict=True))


def free_positions(model: RobotModel, scene: PlanningScene, rng: np.random.Generator) -> np.ndarray:
    test = ExactCollisionChecker(scene, model.group(GROUP).indices)
    while True:
        positions = random_positions(model, rng)
        if test.is_free(positions):
            return positions


def goal_at(model: RobotModel, positions: np.ndarray) -> JointGoal:
    group = model.group(GROUP)
    return JointGoal(dict(zip(group.joints, positions[group.indices].tolist(), strict=True)))


def test_verdicts_equal_those_of_an_independent_checker(model: RobotModel, checker: IndependentChecker) -> None:
    rng = np.random.default_rng(5)
    for _ in range(4):
        scene, world = random_world(model, rng)
        checker.set_world(world)
        ours = ExactCollisionChecker(scene)
        for _ in range(150):
            positions = random_positions(model, rng)
            assert ours.is_free(positions) == (not checker.collisions(named(model, positions)))
            assert ours.is_free(positions) == (not ours.contacts(positions))


def check_timing(model: RobotModel, answer: PlanningResult, factor: float) -> None:
    motion, group = answer.trajectory, model.group(GROUP)
    assert (np.diff(motion.times) > 0).all() and motion.times[0] == 0.0
    assert (np.abs(motion.velocities) <= model.max_velocity[group.indices] * factor * (1 + 1e-6)).all()
    assert (np.abs(motion.accelerations) <= model.max_acceleration[group.indices] * factor * (1 + 1e-6)).all()
    assert (motion.positions >= model.lower[group.indices] - 1e-9).all()
    assert (motion.positions <= model.upper[group.indices] + 1e-9).all()
    assert np.array_equal(motion.positions[0], answer.start[group.indices])
    assert not motion.velocities[0].any() and not motion.velocities[-1].any()
    step = np.diff(motion.positions, axis=0)
    rate = np.diff(motion.times)[:, None]
    assert (np.abs(step) <= model.max_velocity[group.indices] * factor * rate * (1 + 1e-3) + 1e-9).all()


def test_random_plans_are_free_at_a_hundredth_rad_timed_within_limits_and_end_at_the_goal(
    model: RobotModel, pipeline: PlanningPipeline, checker: IndependentChecker
) -> None:
    rng = np.random.default_rng(11)
    solved = 0
    for _ in range(PLANS // 10):
        scene, world = random_world(model, rng)
        checker.set_world(world)
        start = free_positions(model, scene, rng)
        for _ in range(10):
            goal = free_positions(model, scene, rng)
            request = PlanningRequest(
                scene.with_positions(start),
                GROUP,
                (goal_at(model, goal),),
                planner_id="",
                attempts=1,
                allowed_time_s=10.0,
                velocity_scaling=0.5,
                acceleration_scaling=0.5,
            )
            answer = pipeline.plan(request)
            check_timing(model, answer, 0.5)
            assert np.allclose(answer.trajectory.positions[-1], goal[model.group(GROUP).indices])
            hits = checker.colliding_states(
                answer.trajectory.joint_names, answer.trajectory.positions, named(model, answer.start)
            )
            assert hits == 0
            solved += 1
            start = goal
    assert solved == PLANS


def table_scene(model: RobotModel) -> PlanningScene:
    positions = model.merge(
        model.default_positions(),
        dict(zip(model.group(GROUP).joints, (1.57, -1.57, 1.2, -1.2, -1.57, 0.0), strict=True)),
    )
    scene = empty_scene(model, positions)
    return scene.with_object(CollisionObject("table", at(0, 0.56, 0.82), ((Box(1.2, 0.8, 0.04), at(0, 0, 0)),)))


def down(x: float, y: float, z: float) -> PoseGoal:
    return PoseGoal("eg_manipulator", pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0), np.array([x, y, z])))


def test_a_pose_goal_is_reached_above_the_table(model: RobotModel, pipeline: PlanningPipeline) -> None:
    goal = down(0.1, 0.5, 0.95)
    answer = pipeline.plan(PlanningRequest(table_scene(model), GROUP, (goal,)))
    distance, angle = pose_difference(model.link_transforms(answer.goal)["eg_manipulator"], goal.target)
    assert distance < 1e-6 and angle < 1e-6


def test_an_answer_says_how_long_each_part_of_the_plan_took(model: RobotModel, pipeline: PlanningPipeline) -> None:
    answer = pipeline.plan(PlanningRequest(table_scene(model), GROUP, (down(0.1, 0.5, 0.95),)))
    assert set(answer.phases_s) == {"setup", "goals", "search", "repair", "shortening", "timing", "check"}
    assert all(spent > 0.0 for spent in answer.phases_s.values())
    total_s = sum(answer.phases_s.values())
    assert total_s <= answer.total_time_s
    assert total_s > 0.5 * answer.statistics.processor_s  # between two parts, other processes may take any time


def test_scaling_makes_the_motion_slower_in_proportion(model: RobotModel, pipeline: PlanningPipeline) -> None:
    request = PlanningRequest(
        table_scene(model),
        GROUP,
        (down(0.1, 0.5, 0.95),),
        planner_id="",
        attempts=1,
        allowed_time_s=5.0,
        velocity_scaling=1.0,
        acceleration_scaling=1.0,
    )
    full = pipeline.plan(request).trajectory.duration_s
    half = pipeline.plan(dataclasses.replace(request, velocity_scaling=0.5, acceleration_scaling=0.25))
    assert half.trajectory.duration_s - WINDOW_S == pytest.approx(2.0 * (full - WINDOW_S), rel=0.005), (
        "but for the time over which the acceleration is averaged"
    )


def test_the_same_seed_gives_the_same_direct_motion(model: RobotModel, pipeline: PlanningPipeline) -> None:
    request = PlanningRequest(table_scene(model), GROUP, (down(0.1, 0.5, 0.95),))
    first, second = pipeline.plan(request), pipeline.plan(request)
    assert np.array_equal(first.trajectory.positions, second.trajectory.positions)


def test_being_there_already_gives_a_motion_of_one_point(model: RobotModel, pipeline: PlanningPipeline) -> None:
    scene = table_scene(model)
    answer = pipeline.plan(PlanningRequest(scene, GROUP, (goal_at(model, scene.positions),)))
    assert len(answer.trajectory.times) == 1


def failure(pipeline: PlanningPipeline, request: PlanningRequest) -> PlanningError:
    with pytest.raises(PlanningError) as caught:
        pipeline.plan(request)
    return caught.value


def test_failures_have_a_code_and_name_the_culprit(model: RobotModel, pipeline: PlanningPipeline) -> None:
    scene = table_scene(model)
    bad, invalid = ErrorCode.INVALID_GOAL_CONSTRAINTS, ErrorCode.INVALID_MOTION_PLAN
    cases = [
        (PlanningRequest(scene, "nobody", (down(0, 0.5, 1),)), ErrorCode.INVALID_GROUP_NAME, "known: .*arm"),
        (PlanningRequest(scene, GROUP, ()), ErrorCode.INVALID_GOAL_CONSTRAINTS, "no goal"),
        (PlanningRequest(scene, GROUP, (down(0, 3.0, 1),)), ErrorCode.NO_IK_SOLUTION, "out of reach"),
        (PlanningRequest(scene, GROUP, (down(0.1, 0.5, 0.8),)), ErrorCode.GOAL_IN_COLLISION, "'table'.* mm deep"),
        (PlanningRequest(scene, GROUP, (JointGoal({"elbow_joint": 99.0}),)), ErrorCode.GOAL_STATE_INVALID, "elbow"),
        (PlanningRequest(scene, GROUP, (JointGoal({"no_joint": 1.0}),)), bad, "no_joint"),
        (PlanningRequest(scene, GROUP, (down(0.1, 0.5, 1),), velocity_scaling=np.nan), invalid, "nan"),
        (
            PlanningRequest(scene.with_positions(scene.positions * np.nan), GROUP, (down(0, 0.5, 1),)),
            ErrorCode.INVALID_ROBOT_STATE,
            "not finite",
        ),
    ]
    for request, code, text in cases:
        error = failure(pipeline, request)
        assert error.code == code, error.reason
        assert re.search(text, error.reason), error.reason


def test_time_that_runs_out_is_reported(model: RobotModel, pipeline: PlanningPipeline) -> None:
    rng = np.random.default_rng(21)
    scene, _ = random_world(model, rng)
    indices = model.group(GROUP).indices
    blocked = False
    while not blocked:
        start, goal = free_positions(model, scene, rng), free_positions(model, scene, rng)
        motion = MotionChecker(ExactCollisionChecker(scene, indices), indices, start)
        blocked = not motion.edge_is_free(start[indices], goal[indices], 0.05)
    request = PlanningRequest(scene.with_positions(start), GROUP, (goal_at(model, goal),), allowed_time_s=1e-4)
    error = failure(pipeline, request)
    assert error.code == ErrorCode.TIMED_OUT and "allowed 0.00 s" in error.reason
    cancelled = failure(pipeline, dataclasses.replace(request, allowed_time_s=30.0, cancelled=lambda: True))
    assert cancelled.code == ErrorCode.PREEMPTED


def holding(model: RobotModel, sunk_m: float) -> PlanningScene:
    """The gripper holds a block whose lower side is `sunk_m` below the table's surface."""
    scene = table_scene(model)
    found = (
        KinematicsPool(model).solver(GROUP).solutions("eg_manipulator", down(0.1, 0.5, 0.90).target, scene.positions)
    )
    scene = scene.with_positions(found[0])
    palm = model.link_transforms(scene.positions)[PALM]
    pose = palm.actInv(at(0.1, 0.5, 0.84 - sunk_m + 0.04))
    block = CollisionObject("block", pose, ((Box(0.04, 0.04, 0.08), at(0, 0, 0)),))
    links = frozenset(name for name in model.frame_ids if "ezgripper" in name)
    return scene.with_attached(AttachedObject(block, PALM, links))


def test_a_held_block_may_leave_the_table_it_stands_on(model: RobotModel, pipeline: PlanningPipeline) -> None:
    answer = pipeline.plan(PlanningRequest(holding(model, 0.002), GROUP, (down(0.1, 0.5, 1.1),)))
    heights = [
        model.link_transforms(model.merge(answer.start, dict(zip(answer.trajectory.joint_names, row, strict=True))))[
            "eg_manipulator"
        ].translation[2]
        for row in answer.trajectory.positions[::5]
    ]
    assert min(heights) > 0.90 - 1e-3, "the block never goes deeper into the table than it was"


def test_a_held_block_deep_in_the_table_is_a_start_in_collision(model: RobotModel, pipeline: PlanningPipeline) -> None:
    error = failure(pipeline, PlanningRequest(holding(model, 0.03), GROUP, (down(0.1, 0.5, 1.1),)))
    assert error.code == ErrorCode.START_STATE_IN_COLLISION
    assert "'block'" in error.reason and "'table'" in error.reason


def test_a_held_block_blocks_ways_its_gripper_alone_could_go(model: RobotModel, pipeline: PlanningPipeline) -> None:
    low = down(0.1, 0.5, 0.872)
    pipeline.plan(PlanningRequest(table_scene(model), GROUP, (low,)))
    error = failure(pipeline, PlanningRequest(holding(model, -0.01), GROUP, (down(-0.1, 0.5, 0.872),)))
    assert error.code == ErrorCode.GOAL_IN_COLLISION and "'block'" in error.reason
