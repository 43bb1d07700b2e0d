# SPDX-License-Identifier: BSD-3-Clause
"""Sequences: blended motions leave their paths only within the radius, smoothly and within limits; rules are kept."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import BPoly

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.planners.pilz.command_planner import CommandPlanner
from modular_framework_planning.planners.pilz.sequence import ItemSpec, PlannedItem, SequenceJoiner, checked_radii
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planning_request import (
    AuxiliaryPoint,
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
Step = tuple[str, tuple[float, float, float], tuple[float, float, float], float]  # planner, position, turn, radius


class Robot:
    """Plans sequences from home; positions and turns are relative to the pose at home."""

    def __init__(self, model: RobotModel) -> None:
        self.model, self.kinematics = model, KinematicsPool(model)
        self.settings = PipelineSettings()
        self.pipeline = PlanningPipeline(self.kinematics, self.settings, CommandPlanner(LIMITS), adapters=())
        joints = model.group(GROUP).joints
        self.scene = empty_scene(model, model.merge(model.default_positions(), dict(zip(joints, HOME, strict=True))))
        self.follower = PoseFollower(self.kinematics.solver(GROUP), LINK, self.scene.positions)
        self.home = self.follower.pose(np.array(HOME))
        self.joiner = SequenceJoiner(self.kinematics, self.pipeline.checker, 0.1, self.settings.motion_step)

    def planned(self, steps: list[Step], world: PlanningScene | None = None, pace: float = 0.2) -> list[PlannedItem]:
        items, scene = [], world or self.scene
        for planner, position, turn, radius in steps:
            target = pin.SE3(
                self.home.rotation @ pin.exp3(np.array(turn, dtype=float)), self.home.translation + np.array(position)
            )
            request = PlanningRequest(
                scene,
                GROUP,
                (PoseGoal(LINK, target),),
                planner_id=planner,
                velocity_scaling=pace,
                acceleration_scaling=pace,
            )
            if planner == "CIRC":
                here = self.follower.pose(scene.positions[self.model.group(GROUP).indices]).translation
                middle = 0.5 * (here + target.translation) + np.array([0.0, 0.0, -0.03])
                request = dataclasses.replace(request, auxiliary_point=AuxiliaryPoint("interim", middle))
            answer = self.pipeline.plan(request)
            items.append(PlannedItem(request, answer, radius))
            scene = scene.with_positions(answer.goal)
        return items

    def points(self, motion: Trajectory) -> np.ndarray:
        return np.array([self.follower.pose(values).translation for values in motion.sample(motion.sample_times())[0]])


@pytest.fixture(scope="module")
def robot_at_home(model: RobotModel) -> Robot:
    return Robot(model)


SQUARE: list[Step] = [("LIN", (0.2, 0, 0), (0, 0, 0), 0.05), ("LIN", (0.2, 0, -0.2), (0, 0, 0.3), 0.0)]
MIXED: list[Step] = [
    ("PTP", (0.15, 0.05, 0), (0, 0, 0), 0.04),
    ("LIN", (0.15, 0.05, -0.15), (0, 0, 0.4), 0.03),
    ("CIRC", (-0.05, 0.05, -0.15), (0, 0, 0), 0.05),
    ("PTP", (0, 0, 0), (0, 0, 0), 0.0),
]


@pytest.mark.parametrize("steps", [SQUARE, MIXED])
def test_a_blended_motion_is_off_the_paths_only_within_the_radius_and_never_stops(
    robot_at_home: Robot, steps: list[Step]
) -> None:
    robot = robot_at_home
    items = robot.planned(steps)
    parts = robot.joiner.join(items)
    assert len(parts) == 1 and len(parts[0].answers) == len(steps)
    motion = parts[0].trajectory
    points = robot.points(motion)
    paths = np.vstack([robot.points(item.answer.trajectory) for item in items])
    ends = [robot.home.translation + np.array(step[1]) for step in steps]
    outside = np.ones(len(points), dtype=bool)
    speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(motion.sample_times())
    for end, step in zip(ends[:-1], steps[:-1], strict=True):
        inside = np.linalg.norm(points - end, axis=1) < step[3]
        outside &= ~inside
        assert inside.any() and speeds[inside[:-1]].min() > 0.02, "the link does not stop at the corner"
    off = [np.linalg.norm(paths - point, axis=1).min() for point in points[outside][::20]]
    assert max(off) < 5e-4, "outside the spheres the motion is on the paths"
    assert motion.duration_s < sum(item.answer.trajectory.duration_s for item in items)
    assert np.array_equal(motion.positions[-1], items[-1].answer.trajectory.positions[-1])


@pytest.mark.parametrize("steps", [SQUARE, MIXED])
def test_a_blended_motion_has_continuous_velocity_within_the_joints_limits(
    robot_at_home: Robot, model: RobotModel, steps: list[Step]
) -> None:
    motion = robot_at_home.joiner.join(robot_at_home.planned(steps))[0].trajectory
    assert (np.diff(motion.times) > 0.0).all() and motion.times[0] == 0.0
    times = motion.sample_times()
    position, velocity, acceleration, _ = motion.sample(times)
    indices = model.group(GROUP).indices
    assert (np.abs(velocity) <= model.max_velocity[indices]).all()
    assert (np.abs(acceleration) <= model.max_acceleration[indices]).all()
    step = np.diff(times)[:, None]
    highest = model.max_acceleration[indices]
    assert (np.abs(np.diff(velocity, axis=0)) <= highest * step * 1.01).all(), "no jump of the velocity"
    assert (np.abs(np.diff(position, axis=0) - 0.5 * (velocity[1:] + velocity[:-1]) * step) <= 1e-5).all()
    assert np.abs(velocity[[0, -1]]).max() < 1e-12


def random_steps(rng: np.random.Generator) -> list[Step]:
    """Two or three motions of all planners, each at most 0.15 m per axis from the previous one."""
    positions = np.clip(np.cumsum(rng.uniform(-0.15, 0.15, (int(rng.integers(2, 4)), 3)), axis=0), -0.2, 0.2)
    planners = rng.choice(["LIN", "PTP", "CIRC"], len(positions))
    radii = [*rng.uniform(0.01, 0.05, len(positions) - 1), 0.0]
    turns = rng.uniform(-0.3, 0.3, positions.shape)
    return [(str(a), tuple(b), tuple(c), d) for a, b, c, d in zip(planners, positions, turns, radii, strict=True)]


def test_random_sequences_keep_the_joints_limits_along_the_executed_curve_or_are_refused(
    robot_at_home: Robot, model: RobotModel
) -> None:
    indices, joined = model.group(GROUP).indices, 0
    for seed in range(50):
        try:
            items = robot_at_home.planned(random_steps(np.random.default_rng(seed)))
            motion = robot_at_home.joiner.join(items)[0].trajectory
        except PlanningError:
            continue
        joined += 1
        rows = np.stack([motion.positions, motion.velocities, motion.accelerations], axis=1)
        curve = BPoly.from_derivatives(motion.times, rows)
        samples = np.union1d(np.arange(0.0, motion.duration_s, 0.001), motion.times)
        assert np.abs(curve(samples, 1) / model.max_velocity[indices]).max() <= 1.01
        assert np.abs(curve(samples, 2) / model.max_acceleration[indices]).max() <= 1.01
    assert joined >= 5


def test_without_radii_the_motions_follow_each_other_from_rest_to_rest(robot_at_home: Robot) -> None:
    items = robot_at_home.planned([(name, position, turn, 0.0) for name, position, turn, _ in MIXED])
    motion = robot_at_home.joiner.join(items)[0].trajectory
    assert motion.duration_s == pytest.approx(sum(item.answer.trajectory.duration_s for item in items))
    assert (np.diff(motion.times) > 0.0).all()
    for item in items:
        assert np.abs(motion.positions - item.answer.trajectory.positions[-1]).max(axis=1).min() < 1e-12


def refused(robot: Robot, steps: list[Step], world: PlanningScene | None = None, pace: float = 0.2) -> PlanningError:
    with pytest.raises(PlanningError) as caught:
        robot.joiner.join(robot.planned(steps, world, pace))
    return caught.value


def test_spheres_that_overlap_are_refused(robot_at_home: Robot) -> None:
    error = refused(
        robot_at_home,
        [
            ("LIN", (0.1, 0, 0), (0, 0, 0), 0.06),
            ("LIN", (0.1, 0, -0.1), (0, 0, 0), 0.04),
            ("LIN", (0, 0, -0.1), (0, 0, 0), 0.0),
        ],
    )
    assert error.code == ErrorCode.INVALID_MOTION_PLAN
    assert "items[0] and items[1]" in error.reason and "below the distance 0.1000 m" in error.reason


def test_a_radius_longer_than_a_motion_is_refused(robot_at_home: Robot) -> None:
    error = refused(robot_at_home, [("LIN", (0.05, 0, 0), (0, 0, 0), 0.1), ("LIN", (0.05, 0, -0.2), (0, 0, 0), 0.0)])
    assert error.code == ErrorCode.INVALID_MOTION_PLAN and "the motion before" in error.reason
    error = refused(robot_at_home, [("LIN", (0.2, 0, 0), (0, 0, 0), 0.1), ("LIN", (0.2, 0, -0.1), (0, 0, 0), 0.0)])
    assert error.code == ErrorCode.INVALID_MOTION_PLAN and "overlap" in error.reason


def world_with_cube(robot: Robot, items: list[PlannedItem], joined: Trajectory) -> PlanningScene:
    """A world with a cube that only the blended motion touches."""
    indices = robot.model.group(GROUP).indices
    corner = robot.follower.pose(items[0].answer.goal[indices]).translation
    for aside in np.linspace(0.09, 0.12, 4):
        for below in np.linspace(-0.03, 0.01, 5):
            pose = pin.SE3(np.eye(3), corner + np.array([-aside, 0.0, -below]))
            world = robot.scene.with_object(
                CollisionObject("cube", pose, ((Box(0.01, 0.01, 0.01), pin.SE3.Identity()),))
            )
            motion = MotionChecker(ExactCollisionChecker(world, indices), indices, world.positions)
            if all(motion.colliding_state(item.answer.trajectory.curve(0.02), 0.02) is None for item in items) and (
                motion.colliding_state(joined.curve(0.02), 0.02) is not None
            ):
                return world
    raise AssertionError("there is a place that only the short cut touches")


def test_a_short_cut_through_an_obstacle_is_refused_and_the_contact_named(robot_at_home: Robot) -> None:
    robot = robot_at_home
    steps: list[Step] = [("LIN", (0.2, 0, 0), (0, 0, 0), 0.15), ("LIN", (0.2, 0, -0.2), (0, 0, 0), 0.0)]
    items = robot.planned(steps)
    world = world_with_cube(robot, items, robot.joiner.join(items)[0].trajectory)
    error = refused(robot, steps, world)
    assert error.code == ErrorCode.INVALID_MOTION_PLAN
    assert "'cube'" in error.reason and "items[0] and items[1]" in error.reason


def spec(group: str = GROUP, radius: float = 0.0, start: bool = False) -> ItemSpec:
    return ItemSpec(group, radius, start)


@pytest.mark.parametrize(
    ("items", "code", "text"),
    [
        ([spec(radius=-0.1), spec()], ErrorCode.INVALID_MOTION_PLAN, "items[0].blend_radius is -0.1"),
        ([spec(radius=float("nan")), spec()], ErrorCode.INVALID_MOTION_PLAN, "items[0].blend_radius is nan"),
        (
            [spec(), spec(radius=0.1)],
            ErrorCode.INVALID_MOTION_PLAN,
            "items[1].blend_radius is 0.1; the last radius must be 0",
        ),
        ([spec(start=True), spec(start=True)], ErrorCode.INVALID_ROBOT_STATE, "items[1].start_state"),
        ([spec(), spec("ezgripper"), spec(start=True)], ErrorCode.INVALID_ROBOT_STATE, "items[2].start_state"),
    ],
)
def test_rules_of_a_sequence(items: list[ItemSpec], code: ErrorCode, text: str) -> None:
    with pytest.raises(PlanningError) as caught:
        checked_radii(items)
    assert caught.value.code == code and text in caught.value.reason


def test_each_group_may_start_somewhere_and_is_not_blended_into_another() -> None:
    radii, warnings = checked_radii([spec(start=True, radius=0.1), spec(radius=0.1), spec("ezgripper", start=True)])
    assert radii == [0.1, 0.0, 0.0]
    assert len(warnings) == 1 and "items[1]" in warnings[0] and "ezgripper" in warnings[0]
    assert checked_radii([]) == ([], [])
