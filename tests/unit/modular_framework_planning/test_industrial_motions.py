# SPDX-License-Identifier: BSD-3-Clause
"""PTP, LIN and CIRC on the shipped arm: exact in space, within limits at every millisecond, refused with the reason."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pinocchio as pin
import pytest

from modular_framework_planning.errors import ErrorCode, ModelError, PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.planners.pilz.command_planner import CommandPlanner
from modular_framework_planning.planners.pilz.velocity_profile import ROUNDING_S
from modular_framework_planning.planning_interface.planning_request import (
    AuxiliaryPoint,
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PoseGoal,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

GROUP, LINK = "arm_and_manipulator", "eg_manipulator"
HOME = (1.57, -1.57, 1.2, -1.2, -1.57, 0.0)
LIMITS = {"max_trans_vel": 1.0, "max_trans_acc": 2.25, "max_trans_dec": -5.0, "max_rot_vel": 1.57}
STRAIGHT_M = 1.0e-4


@pytest.fixture(scope="module")
def pipeline(model: RobotModel) -> PlanningPipeline:
    settings = PipelineSettings(
        parameters={"default_planner_config": "PTP"}, robot_planning={"cartesian_limits": LIMITS}
    )
    planner = CommandPlanner.configure(model, settings)
    return PlanningPipeline(KinematicsPool(model), settings, planner, adapters=(), name="pilz")


@pytest.fixture(scope="module")
def scene(model: RobotModel) -> PlanningScene:
    joints = model.group(GROUP).joints
    return empty_scene(model, model.merge(model.default_positions(), dict(zip(joints, HOME, strict=True))))


@pytest.fixture(scope="module")
def follower(model: RobotModel, scene: PlanningScene) -> PoseFollower:
    return PoseFollower(KinematicsPool(model).solver(GROUP), LINK, scene.positions)


@pytest.fixture(scope="module")
def home(follower: PoseFollower) -> pin.SE3:
    return follower.pose(np.array(HOME))


def moved(pose: pin.SE3, shift: tuple[float, float, float], turn: tuple[float, float, float] = (0, 0, 0)) -> pin.SE3:
    return pin.SE3(pose.rotation @ pin.exp3(np.array(turn, dtype=float)), pose.translation + np.array(shift))


def lin(scene: PlanningScene, target: pin.SE3, **changes: object) -> PlanningRequest:
    """A line; a long arc on a busy machine takes longer than the default time."""
    scaling = {"velocity_scaling": 0.3, "acceleration_scaling": 0.3}
    request = PlanningRequest(scene, GROUP, (PoseGoal(LINK, target),), planner_id="LIN", allowed_time_s=60.0, **scaling)
    return dataclasses.replace(request, **changes)


def joint_goal(model: RobotModel, values: np.ndarray) -> JointGoal:
    return JointGoal(dict(zip(model.group(GROUP).joints, np.asarray(values).tolist(), strict=True)))


def check_limits(model: RobotModel, motion: Trajectory, factor: float = 1.0) -> None:
    """Along the curve a controller makes of the points, at every millisecond."""
    indices = model.group(GROUP).indices
    _, velocity, acceleration, _ = motion.sample(motion.sample_times())
    assert (np.diff(motion.times) > 0).all() and motion.times[0] == 0.0
    assert (np.abs(velocity) <= model.max_velocity[indices] * factor * (1 + 2e-3)).all()
    assert (np.abs(acceleration) <= model.max_acceleration[indices] * factor * (1 + 2e-3)).all()
    for rows in (motion.velocities, motion.accelerations):
        assert not rows[0].any() and not rows[-1].any(), "from rest to rest"


def test_ptp_moves_all_joints_in_the_phases_of_the_widest_move(
    model: RobotModel, pipeline: PlanningPipeline, scene: PlanningScene
) -> None:
    change = np.array([-0.9, 0.2, -0.3, 0.1, 0.0, 0.45])
    request = PlanningRequest(
        scene,
        GROUP,
        (joint_goal(model, np.array(HOME) + change),),
        planner_id="PTP",
        velocity_scaling=0.2,
        acceleration_scaling=0.1,
    )
    motion = pipeline.plan(request).trajectory
    velocity, acceleration = 3.0 * 0.2, 5.0 * 0.1  # the strictest of all joints, scaled
    peak = min(velocity, np.sqrt(0.9 * acceleration))
    closed_form = 0.9 / peak + peak / acceleration
    assert motion.duration_s == pytest.approx(closed_form + ROUNDING_S, abs=1e-9)
    position, speed, _, _ = motion.sample(motion.sample_times())
    lead = (position[:, 0] - HOME[0]) / change[0]
    assert np.allclose(position - np.array(HOME), lead[:, None] * change, atol=1e-9), "one common profile"
    assert np.abs(speed[:, 0]).max() == pytest.approx(peak, rel=1e-3)
    assert np.array_equal(motion.positions[-1], np.array(HOME) + change)
    assert np.diff(motion.times).max() <= 0.1 + 1e-9, "sampling_time"
    check_limits(model, motion, 0.2)


def test_a_faster_joint_does_not_run_ahead_of_the_strictest_limit(robot: object) -> None:
    limits = {name: {"max_velocity": 3.0, "max_acceleration": 5.0} for name in robot.model.group(GROUP).joints}
    limits["elbow_joint"] = {
        "max_velocity": 0.5,
        "max_acceleration": 0.8,
        "has_deceleration": True,
        "max_deceleration": -0.4,
    }
    model = RobotModel(robot.urdf, robot.srdf, limits)
    scene = empty_scene(
        model, model.merge(model.default_positions(), dict(zip(model.group(GROUP).joints, HOME, strict=True)))
    )
    pipeline = PlanningPipeline(KinematicsPool(model), PipelineSettings(), CommandPlanner(None), adapters=())
    goal = JointGoal({"wrist_3_joint": 1.0})
    motion = pipeline.plan(
        PlanningRequest(scene, GROUP, (goal,), planner_id="PTP", velocity_scaling=1.0, acceleration_scaling=1.0)
    ).trajectory
    assert motion.duration_s == pytest.approx(1.0 / 0.5 + 0.5 * (0.5 / 0.8 + 0.5 / 0.4) + ROUNDING_S, abs=1e-9)
    _, speed, change, _ = motion.sample(motion.sample_times())
    assert speed.max() == pytest.approx(0.5, rel=1e-6)
    assert change.max() == pytest.approx(0.8, rel=1e-6) and change.min() == pytest.approx(-0.4, rel=1e-6)


@pytest.mark.parametrize(("value", "text"), [(0.4, "must be below 0"), (0.0, "must be below 0")])
def test_a_deceleration_that_is_not_below_0_is_refused(robot: object, value: float, text: str) -> None:
    with pytest.raises(ModelError, match=text):
        RobotModel(robot.urdf, robot.srdf, {"elbow_joint": {"max_deceleration": value}})


def test_lin_is_straight_at_every_millisecond(
    model: RobotModel, pipeline: PlanningPipeline, scene: PlanningScene, follower: PoseFollower, home: pin.SE3
) -> None:
    for shift, turn in (((0.2, 0.1, -0.2), (0, 0, 0.5)), ((-0.1, 0.0, 0.15), (0.4, 0, 0)), ((0, 0, 0), (0, 0.3, 0.2))):
        target = moved(home, shift, turn)
        motion = pipeline.plan(lin(scene, target)).trajectory
        whole_turn = pin.log3(home.rotation.T @ target.rotation)
        rows = motion.sample(motion.sample_times())[0]
        for values in rows:
            pose = follower.pose(values)
            way = pose.translation - home.translation
            length = float(np.linalg.norm(shift))
            share = float(way @ np.array(shift)) / length**2 if length else None
            if share is None:
                turned = pin.log3(home.rotation.T @ pose.rotation)
                share = float(turned @ whole_turn) / float(whole_turn @ whole_turn)
            assert np.linalg.norm(way - share * np.array(shift)) < STRAIGHT_M
            assert np.linalg.norm(pin.log3(home.rotation.T @ pose.rotation) - share * whole_turn) < 1e-3
        assert np.allclose(follower.pose(rows[-1]).homogeneous, target.homogeneous, atol=1e-6)
        check_limits(model, motion)


def test_lin_keeps_the_cartesian_limits(
    pipeline: PlanningPipeline, scene: PlanningScene, follower: PoseFollower, home: pin.SE3
) -> None:
    motion = pipeline.plan(lin(scene, moved(home, (0.25, 0.0, 0.0)))).trajectory
    peak = 0.3 * 1.0
    rise, fall = peak / (0.3 * 2.25), peak / (0.3 * 5.0)
    assert motion.duration_s == pytest.approx(0.25 / peak + 0.5 * (rise + fall) + ROUNDING_S, abs=1e-9)
    points = np.array([follower.pose(values).translation for values in motion.sample(motion.sample_times())[0]])
    step = np.diff(motion.sample_times())[0]
    speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) / step
    assert speeds.max() == pytest.approx(peak, rel=1e-3)
    changes = np.diff(speeds) / step
    assert changes.max() <= 0.3 * 2.25 * 1.01 and changes.min() >= -0.3 * 5.0 * 1.01


def test_lin_to_joint_values_ends_there_or_says_that_the_posture_is_another(
    model: RobotModel, pipeline: PlanningPipeline, scene: PlanningScene, home: pin.SE3
) -> None:
    end = pipeline.plan(lin(scene, moved(home, (0.1, 0.05, -0.1)))).trajectory.positions[-1]
    again = pipeline.plan(dataclasses.replace(lin(scene, home), goals=(joint_goal(model, end),))).trajectory
    assert np.allclose(again.positions[-1], end, atol=1e-6)
    turned = end + np.array([0, 0, 0, 0, 0, 2 * np.pi if end[5] < 0 else -2 * np.pi])
    error = failure(pipeline, dataclasses.replace(lin(scene, home), goals=(joint_goal(model, turned),)))
    assert error.code == ErrorCode.GOAL_CONSTRAINTS_VIOLATED and "wrist_3_joint" in error.reason


@pytest.mark.parametrize(
    ("name", "point", "goal", "angle"),
    [
        ("center", (0.1, 0.0, 0.0), (0.1, 0.0, -0.1), np.pi / 2),
        ("interim", (0.1, 0.0, -0.1), (0.2, 0.0, 0.0), np.pi),
        ("interim", (0.2, 0.0, 0.0), (0.1, 0.0, 0.1), 3 * np.pi / 2),
    ],
)
def test_circ_stays_on_the_circle(
    model: RobotModel,
    pipeline: PlanningPipeline,
    scene: PlanningScene,
    follower: PoseFollower,
    home: pin.SE3,
    name: str,
    point: tuple[float, ...],
    goal: tuple[float, ...],
    angle: float,
) -> None:
    request = dataclasses.replace(
        lin(scene, moved(home, goal)),
        planner_id="CIRC",
        velocity_scaling=0.1,
        acceleration_scaling=0.1,
        auxiliary_point=AuxiliaryPoint(name, home.translation + np.array(point)),
    )
    motion = pipeline.plan(request).trajectory
    centre = home.translation + np.array([0.1, 0.0, 0.0])
    points = np.array([follower.pose(values).translation for values in motion.sample(motion.sample_times())[0]])
    assert np.abs(np.linalg.norm(points - centre, axis=1) - 0.1).max() < STRAIGHT_M
    assert np.abs(points[:, 1] - centre[1]).max() < STRAIGHT_M, "in the plane"
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(0.1 * angle, rel=1e-3)
    if name == "interim":
        assert np.linalg.norm(points - request.auxiliary_point.position, axis=1).min() < 1e-3
    check_limits(model, motion)


def failure(pipeline: PlanningPipeline, request: PlanningRequest) -> PlanningError:
    with pytest.raises(PlanningError) as caught:
        pipeline.plan(request)
    return caught.value


def test_nothing_is_gone_around(
    model: RobotModel, pipeline: PlanningPipeline, scene: PlanningScene, home: pin.SE3
) -> None:
    pose = pin.SE3(np.eye(3), home.translation + np.array([0.15, 0.0, -0.1]))
    blocked = scene.with_object(CollisionObject("post", pose, ((Box(0.02, 0.02, 0.5), pin.SE3.Identity()),)))
    goal = moved(home, (0.3, 0.0, 0.0))
    values = pipeline.plan(lin(scene, goal)).trajectory.positions[-1]
    for request in (
        lin(blocked, goal),
        dataclasses.replace(lin(blocked, goal), planner_id="PTP", goals=(joint_goal(model, values),)),
    ):
        error = failure(pipeline, request)
        assert error.code == ErrorCode.INVALID_MOTION_PLAN
        assert re.search("'post'.* mm deep", error.reason), error.reason


def test_a_joint_that_would_be_too_fast_refuses_the_line_and_is_named(
    pipeline: PlanningPipeline, scene: PlanningScene, home: pin.SE3
) -> None:
    far = moved(home, (0.3, 0.1, -0.1), (0, 0, 1.5))
    error = failure(pipeline, lin(scene, far, velocity_scaling=1.0, acceleration_scaling=1.0))
    assert error.code == ErrorCode.INVALID_MOTION_PLAN
    assert re.search("joint '.*' would need (velocity|acceleration) .*; its limit is .*scaling_factor", error.reason)


def test_refusals_have_a_code_and_a_reason(
    model: RobotModel, pipeline: PlanningPipeline, scene: PlanningScene, home: pin.SE3
) -> None:
    line = lin(scene, moved(home, (0.1, 0, 0)))
    circle = dataclasses.replace(line, planner_id="CIRC")
    half = AuxiliaryPoint("center", home.translation + np.array([0.05, 0, 0]))
    flat = AuxiliaryPoint("interim", home.translation + np.array([0.05, 0, 0]))
    cases = [
        (dataclasses.replace(line, start_velocities={"elbow_joint": 0.2}), ErrorCode.INVALID_ROBOT_STATE, "elbow"),
        (dataclasses.replace(line, cancelled=lambda: True), ErrorCode.PREEMPTED, "cancelled"),
        (dataclasses.replace(line, goals=line.goals * 2), ErrorCode.INVALID_GOAL_CONSTRAINTS, "2 goals"),
        (dataclasses.replace(line, planner_id="RRT"), ErrorCode.PLANNING_FAILED, "PTP, LIN, CIRC"),
        (dataclasses.replace(line, velocity_scaling=1.5), ErrorCode.INVALID_MOTION_PLAN, "1.5"),
        (dataclasses.replace(line, velocity_scaling=1e-6), ErrorCode.INVALID_MOTION_PLAN, "larger scaling factors"),
        (dataclasses.replace(line, planner_id="PTP", velocity_scaling=1e-7), ErrorCode.INVALID_MOTION_PLAN, "points"),
        (lin(scene, moved(home, (0, 2.0, 0))), ErrorCode.NO_IK_SOLUTION, "out of reach"),
        (circle, ErrorCode.INVALID_MOTION_PLAN, "'center' or 'interim'"),
        (dataclasses.replace(circle, auxiliary_point=half), ErrorCode.INVALID_MOTION_PLAN, "half"),
        (dataclasses.replace(circle, auxiliary_point=flat), ErrorCode.INVALID_MOTION_PLAN, "one line"),
    ]
    for request, code, text in cases:
        error = failure(pipeline, request)
        assert error.code == code and text in error.reason, error.reason
    bare = PlanningPipeline(KinematicsPool(model), PipelineSettings(), CommandPlanner(None), adapters=())
    error = failure(bare, line)
    assert error.code == ErrorCode.INVALID_MOTION_PLAN and "cartesian_limits is not set" in error.reason
    with pytest.raises(ModelError, match="sampling_time"):
        CommandPlanner(None, 0.0)


def test_being_there_already_gives_a_motion_of_one_point(
    pipeline: PlanningPipeline, scene: PlanningScene, home: pin.SE3
) -> None:
    for planner in ("PTP", "LIN"):
        assert len(pipeline.plan(dataclasses.replace(lin(scene, home), planner_id=planner)).trajectory.times) == 1


def test_the_sampling_time_changes_the_points_and_not_the_motion(
    model: RobotModel, pipeline: PlanningPipeline, scene: PlanningScene, home: pin.SE3
) -> None:
    fine = PlanningPipeline(KinematicsPool(model), PipelineSettings(), CommandPlanner(LIMITS, 0.02), adapters=())
    request = lin(scene, moved(home, (0.2, 0.0, 0.0)))
    one, other = pipeline.plan(request).trajectory, fine.plan(request).trajectory
    assert len(other.times) > 2 * len(one.times) and one.duration_s == other.duration_s
    times = one.sample_times()
    assert np.abs(one.sample(times)[0] - other.sample(times)[0]).max() < 1e-5
