# SPDX-License-Identifier: BSD-3-Clause
"""Straight lines with six and with seven joints: on the line, without jumps, and with the reason if they end early."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from modular_framework_planning.cartesian.cartesian_path import JumpThresholds, straight_line
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics, KinematicsPool
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.planners.pilz.command_planner import CommandPlanner
from modular_framework_planning.planners.pilz.sequence import PlannedItem, SequenceJoiner
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PoseGoal,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_scene.planning_scene import empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.line_timing import time_line
from modular_framework_testing.planning.independent_arms import SEVEN_JOINT_SRDF, SEVEN_JOINT_URDF, seven_joint_flange

BENT = np.array([0.1, -0.6, 0.1, -2.0, 0.1, 1.5, 0.7])
LIMITS = {"max_trans_vel": 1.0, "max_trans_acc": 2.25, "max_trans_dec": -5.0, "max_rot_vel": 1.57}


@pytest.fixture(scope="module")
def seven() -> RobotModel:
    limits = {f"joint{number}": {"max_velocity": 2.0, "max_acceleration": 10.0} for number in range(1, 8)}
    return RobotModel(SEVEN_JOINT_URDF, SEVEN_JOINT_SRDF, limits)


@pytest.fixture(scope="module")
def solver(seven: RobotModel) -> InverseKinematics:
    return KinematicsPool(seven).solver("arm")


def ahead(shift: tuple[float, float, float]) -> pin.SE3:
    start = pin.SE3(seven_joint_flange(BENT))
    return pin.SE3(start.rotation, start.translation + np.array(shift))


def off_line(rows: Array, shift: tuple[float, float, float]) -> float:
    """Largest distance from the line through the start, by forward kinematics that is not the product's."""
    start = seven_joint_flange(BENT)[:3, 3]
    direction = np.array(shift) / np.linalg.norm(shift)
    ways = np.array([seven_joint_flange(values)[:3, 3] for values in rows]) - start
    return float(np.linalg.norm(ways - np.outer(ways @ direction, direction), axis=1).max())


def test_seven_joints_follow_a_line_and_are_timed_within_limits(seven: RobotModel, solver: InverseKinematics) -> None:
    shift = (0.1, 0.1, -0.1)
    line = straight_line(PoseFollower(solver, "flange", BENT), [ahead(shift)], 0.01)
    assert line.fraction == 1.0 and line.stop == ""
    assert off_line(line.rows, shift) < 1e-6
    assert np.abs(np.diff(line.rows, axis=0)).max() < 0.1
    motion = time_line(solver.group.joints, line.rows, seven.max_velocity, seven.max_acceleration, lambda _: True)
    position, velocity, acceleration, _ = motion.sample(motion.sample_times())
    assert off_line(position, shift) < 3e-4
    assert (np.abs(velocity) <= 2.0).all() and (np.abs(acceleration) <= 10.0).all()
    assert (np.diff(motion.times) > 0.0).all()


def test_the_fraction_counts_each_line_the_same(solver: InverseKinematics) -> None:
    near, far = ahead((0.0, 0.0, -0.05)), ahead((0.0, 0.0, -3.0))
    line = straight_line(PoseFollower(solver, "flange", BENT), [near, far], 0.01)
    assert 0.5 < line.fraction < 0.75
    assert line.stop.startswith("waypoint 1, step ") and line.code == ErrorCode.NO_IK_SOLUTION
    reached = seven_joint_flange(BENT)[2, 3] - seven_joint_flange(line.rows[-1])[2, 3]
    assert reached == pytest.approx(0.05 + (2.0 * line.fraction - 1.0) * 2.95, abs=1e-6)


def test_a_rejected_step_ends_the_line_with_its_reason(solver: InverseKinematics) -> None:
    asked: list[int] = []

    def reject_step(_before: Array, _after: Array) -> str:
        asked.append(1)
        return "a wall" if len(asked) == 4 else ""

    line = straight_line(PoseFollower(solver, "flange", BENT), [ahead((0.1, 0, 0))], 0.01, check_step=reject_step)
    assert line.fraction == pytest.approx(0.3) and line.stop == "waypoint 0, step 4 of 10: a wall"
    assert line.code == ErrorCode.INVALID_MOTION_PLAN and len(line.rows) == 4


@pytest.mark.parametrize(
    ("jumps", "text"),
    [
        (JumpThresholds(revolute=1e-4), "revolute_jump_threshold allows 0.0001"),
        (JumpThresholds(factor=1.0001), "jump_threshold 1.0001 times the mean"),
    ],
)
def test_jumps_end_the_line_and_name_the_joint(solver: InverseKinematics, jumps: JumpThresholds, text: str) -> None:
    line = straight_line(PoseFollower(solver, "flange", BENT), [ahead((0.15, 0.1, 0))], 0.01, jumps=jumps)
    assert line.fraction < 1.0 and "joint 'joint" in line.stop and text in line.stop


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"max_step_m": 0.0}, "max_step is 0.0"),
        ({"max_step_m": float("nan")}, "max_step is nan"),
        ({"max_step_m": 1e-9}, "steps; allowed: at most 50000"),
        ({"waypoints": [pin.SE3.Identity()] * 50_001}, "waypoints: got 50001; allowed: at most 50000"),
        ({"waypoints": []}, "at least one pose"),
        ({"jumps": JumpThresholds(factor=-1.0)}, "'factor' is -1.0"),
    ],
)
def test_requests_without_meaning_are_refused(solver: InverseKinematics, changes: dict[str, object], text: str) -> None:
    arguments: dict[str, object] = {
        "waypoints": [ahead((0.1, 0, 0))],
        "max_step_m": 0.01,
    }
    with pytest.raises(PlanningError) as caught:
        straight_line(PoseFollower(solver, "flange", BENT), **(arguments | changes))
    assert text in caught.value.reason


def test_a_link_that_does_not_exist_is_refused(solver: InverseKinematics) -> None:
    with pytest.raises(PlanningError, match="nobody"):
        PoseFollower(solver, "nobody", BENT)


def test_the_curve_that_touches_something_is_run_with_stops_or_not_at_all(
    solver: InverseKinematics, seven: RobotModel
) -> None:
    rows = straight_line(PoseFollower(solver, "flange", BENT), [ahead((0.03, 0, 0))], 0.01).rows
    verdicts = iter([False, True])
    motion = time_line(solver.group.joints, rows, seven.max_velocity, seven.max_acceleration, lambda _: next(verdicts))
    still = np.abs(motion.velocities).max(axis=1) < 1e-9
    assert still.sum() == len(rows), "it stops at every row"
    with pytest.raises(PlanningError, match="is in collision"):
        time_line(solver.group.joints, rows, seven.max_velocity, seven.max_acceleration, lambda _: False)


def test_seven_joints_end_a_line_at_joint_values_and_blend(seven: RobotModel) -> None:
    kinematics, settings = KinematicsPool(seven), PipelineSettings()
    pipeline = PlanningPipeline(kinematics, settings, CommandPlanner(LIMITS), adapters=())
    scene = empty_scene(seven, BENT)
    first = PlanningRequest(
        scene,
        "arm",
        (PoseGoal("flange", ahead((0.15, 0, 0))),),
        planner_id="LIN",
        velocity_scaling=0.2,
        acceleration_scaling=0.2,
    )
    middle = pipeline.plan(first)
    wanted = middle.goal + np.array([0.1, 0.05, 0.1, -0.2, 0.0, 0.1, 0.0])
    goal = JointGoal(dict(zip(seven.group("arm").joints, wanted.tolist(), strict=True)))
    second = dataclasses.replace(first, scene=scene.with_positions(middle.goal), goals=(goal,))
    end = pipeline.plan(second)
    assert np.allclose(end.trajectory.positions[-1], wanted, atol=1e-6)
    joined = (
        SequenceJoiner(kinematics, pipeline.checker, 0.1, 0.01)
        .join([PlannedItem(first, middle, 0.04), PlannedItem(second, end, 0.0)])[0]
        .trajectory
    )
    times = joined.sample_times()
    position, velocity, acceleration, _ = joined.sample(times)
    assert (np.abs(velocity) <= 2.0).all() and (np.abs(acceleration) <= 10.0 * 1.01).all()
    assert (np.abs(np.diff(velocity, axis=0)) <= 10.0 * np.diff(times)[:, None] * 1.05).all()
    assert np.allclose(position[-1], wanted, atol=1e-6)
    assert joined.duration_s < middle.trajectory.duration_s + end.trajectory.duration_s
