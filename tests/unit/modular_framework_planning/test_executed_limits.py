# SPDX-License-Identifier: BSD-3-Clause
"""However a trajectory is timed, the curve that a controller runs through its points keeps the limits of the joints.

The curve is SciPy's: quintics through positions, velocities and accelerations at whole nanoseconds, or cubics through
positions and velocities, at 1 ms samples.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mobile_robots import SRDF, URDF
from scipy.interpolate import BPoly

from modular_framework_testing.planning.independent_arms import SEVEN_JOINT_SRDF, SEVEN_JOINT_URDF, seven_joint_flange

pytest.importorskip("moveit_commander", reason="source the workspace")

import pinocchio as pin  # noqa: E402
from geometry_msgs.msg import Quaternion, Transform, Vector3  # noqa: E402
from moveit_commander.exception import MoveItCommanderException  # noqa: E402
from moveit_commander.robot_model import RobotModel as CommanderModel  # noqa: E402
from moveit_commander.trajectory_timing import Limits, distinct, retime  # noqa: E402
from moveit_commander.trajectory_waypoints import retimed_trajectory  # noqa: E402
from moveit_msgs.msg import RobotTrajectory  # noqa: E402
from trajectory_msgs.msg import JointTrajectoryPoint, MultiDOFJointTrajectoryPoint  # noqa: E402

from modular_framework_benchmark.episodes.shake_motion import shake_motion  # noqa: E402
from modular_framework_planning.cartesian.cartesian_path import straight_line  # noqa: E402
from modular_framework_planning.constraints.constraint_kinds import FrameOnRobot
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool  # noqa: E402
from modular_framework_planning.kinematics.pose_follower import PoseFollower  # noqa: E402
from modular_framework_planning.robot_model.robot_model import RobotModel  # noqa: E402
from modular_framework_planning.trajectory_processing.compiled_timing import max_blends  # noqa: E402
from modular_framework_planning.trajectory_processing.jerk_limits import (  # noqa: E402
    averaged_curve,
    slowed_to_limits,
)
from modular_framework_planning.trajectory_processing.line_timing import time_line  # noqa: E402
from modular_framework_planning.trajectory_processing.link_speed import MovedFrame, with_limited_link_speed  # noqa: E402
from modular_framework_planning.trajectory_processing.time_parameterization import parameterize  # noqa: E402
from modular_framework_planning.trajectory_processing.trajectory import Trajectory  # noqa: E402
from modular_framework_states.smooth_timing import smooth_timing  # noqa: E402
from modular_framework_urdf.joint_limits import JointLimits  # noqa: E402

TOLERANCE = 0.01  # of a limit, and of the range of a joint
SEEDS = st.integers(0, 2**32 - 1)
Rows = tuple[np.ndarray, ...]  # times, positions, velocities, and accelerations if the points have accelerations
Timing = Callable[[RobotModel, np.ndarray, Limits], Rows]


@pytest.fixture(scope="module")
def seven() -> RobotModel:
    limits = {
        f"joint{number}": {"max_velocity": 2.0 + 0.1 * number, "max_acceleration": 5.0 + number}
        for number in range(1, 8)
    }
    return RobotModel(SEVEN_JOINT_URDF, SEVEN_JOINT_SRDF, limits)


def rows_of(motion: Trajectory) -> Rows:
    return motion.times, motion.positions, motion.velocities, motion.accelerations


def timed(path: np.ndarray, limits: Limits) -> Trajectory:
    blends = max_blends(np.ascontiguousarray(path), 0.05)
    return parameterize(tuple("abcdefg"), path, blends, limits.velocity, limits.acceleration)


def retimed(_: RobotModel, path: np.ndarray, limits: Limits) -> Rows:
    timing = retime(path, limits)
    return timing.times, path, timing.velocities, timing.accelerations


def with_slow_link(model: RobotModel, path: np.ndarray, limits: Limits) -> Trajectory:
    motion = parameterize(
        model.group("arm").joints,
        path,
        max_blends(np.ascontiguousarray(path), 0.05),
        limits.velocity,
        limits.acceleration,
    )
    flange = model.pin_model.frames[model.frame_ids["flange"]]
    frame = FrameOnRobot("flange", int(flange.parentJoint), flange.placement)
    moved = MovedFrame(model, frame, lambda values: values)
    return with_limited_link_speed(motion, moved, 0.1, limits.velocity, limits.acceleration)


def at_given_times(_: RobotModel, path: np.ndarray, limits: Limits) -> Rows:
    """Timing of a named trajectory: times that are given, some with a pause and some too short."""
    rng = np.random.default_rng(len(path))
    steps = rng.choice([0.01, 0.2, 3.0], len(path) - 1) * np.abs(np.diff(path, axis=0) / limits.velocity).max(axis=1)
    rows = np.repeat(path, 1 + (np.arange(len(path)) % 3 == 1), axis=0)
    moves = np.abs(np.diff(rows, axis=0)).max(axis=1) > 0.0
    durations = np.full(len(rows) - 1, 0.25)
    durations[moves] = steps + 1e-3
    times = np.concatenate([[0.0], np.cumsum(durations)])
    timing = smooth_timing(times, rows, limits.velocity, limits.acceleration)
    assert timing.times[-1] >= times[-1] - 1e-6
    return timing.times, rows, timing.velocities


def shaken(_: RobotModel, path: np.ndarray, limits: Limits) -> Rows:
    by_joint = {
        joint: JointLimits(*values)
        for joint, *values in zip(
            "abcdefg", limits.lower, limits.upper, limits.velocity, limits.acceleration, strict=True
        )
    }
    times, positions, velocities = shake_motion(path[0], by_joint, "abcdefg", 0.3 * len(path))
    return np.round(times, 9), positions, velocities


JERK = np.full(7, 50.0)
TIMINGS: dict[str, Timing] = {
    "retimed waypoints": retimed,
    "retimed plan": lambda model, path, limits: retimed(model, timed(path, limits).positions, limits),
    "rounded corners": lambda _, path, limits: rows_of(timed(path, limits)),
    "given times": at_given_times,
    "shake": shaken,
    "slow link": lambda model, path, limits: rows_of(with_slow_link(model, path, limits)),
    "averaged": lambda _, path, limits: rows_of(
        averaged_curve(timed(path, limits), limits.velocity, limits.acceleration, JERK)
    ),
    "slowed": lambda _, path, limits: rows_of(
        slowed_to_limits(timed(path, limits), limits.velocity, limits.acceleration, JERK)
    ),
}


def require_limits(rows: Rows, limits: Limits) -> None:
    """Asserts that the executed curve keeps the limits, from rest to rest."""
    times, positions, velocities = rows[:3]
    assert times[0] == 0.0 and (np.diff(times) > 0.0).all() and np.array_equal(times, np.round(times, 9))
    assert np.abs(velocities[[0, -1]]).max() < 1e-9
    curve = BPoly.from_derivatives(times, np.stack([positions, *rows[2:]], axis=1))
    samples = np.union1d(np.arange(0.0, times[-1], 0.001), times)
    values, rates, changes = (curve(samples, order) for order in range(3))
    slack = np.maximum(TOLERANCE * np.minimum(limits.upper - limits.lower, 1.0), 2e-4)
    assert (values >= limits.lower - slack).all() and (values <= limits.upper + slack).all()
    assert np.abs(rates / limits.velocity).max() <= 1.0 + TOLERANCE
    assert np.abs(changes / limits.acceleration).max() <= 1.0 + TOLERANCE


def random_path(rng: np.random.Generator) -> np.ndarray:
    """Waypoints near to and far from each other; some move a few joints only."""
    count = int(rng.integers(2, 12))
    sizes = rng.choice([1e-5, 0.02, 0.1, 1.0], (count, 1)) if rng.random() < 0.5 else rng.choice([0.02, 0.1, 1.0])
    moves = rng.integers(0, 2, (count, 7)) if rng.random() < 0.5 else 1
    path = np.cumsum(rng.uniform(-1.0, 1.0, (count, 7)) * sizes * moves, axis=0)
    return path[distinct(path)]


@pytest.mark.parametrize("name", TIMINGS)
@settings(max_examples=10, deadline=None)
@given(seed=SEEDS)
def test_every_timing_keeps_the_limits_along_the_executed_curve(name: str, seven: RobotModel, seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = random_path(rng)
    if len(path) < 2:
        return
    scaling = rng.choice([0.1, 0.5, 1.0])  # bounds that waypoints lie on
    limits = Limits(path.min(axis=0), path.max(axis=0), seven.max_velocity * scaling, seven.max_acceleration * scaling)
    rows = TIMINGS[name](seven, path, limits)
    if name == "retimed waypoints":
        spans = np.abs(np.diff(path, axis=0))
        stops = np.maximum(1.875 * spans / limits.velocity, np.sqrt(5.774 * spans / limits.acceleration)).max(axis=1)
        assert rows[0][-1] <= 1.01 * stops.sum(), "slower than with a stop at each waypoint"
    require_limits(rows, limits)


@pytest.mark.parametrize("scaling", [1.0, 0.1])
def test_a_straight_line_keeps_the_limits_when_timed_and_retimed(seven: RobotModel, scaling: float) -> None:
    start = np.array([0.1, -0.6, 0.1, -2.0, 0.1, 1.5, 0.7])
    goal = pin.SE3(seven_joint_flange(start))
    goal.translation += (0.0, 0.1, 0.0)
    solver = KinematicsPool(seven).solver("arm")
    rows = straight_line(PoseFollower(solver, "flange", start), [goal], 0.005).rows
    limits = Limits(seven.lower, seven.upper, scaling * seven.max_velocity, scaling * seven.max_acceleration)
    motion = time_line(solver.group.joints, rows, limits.velocity, limits.acceleration, lambda _: True)
    require_limits(rows_of(motion), limits)
    for path in (rows, motion.positions):
        require_limits(retimed(seven, path, limits), limits)


@pytest.mark.parametrize(
    ("path", "fastest_s"),
    [
        ([[0.0] * 7, [0.3] + [0.0] * 6], 2.0 * np.sqrt(0.3 / 2.5)),
        ([[0.05 * number] + [0.0] * 6 for number in range(12)], 2.0 * np.sqrt(0.55 / 2.5)),
    ],
)
def test_retimed_waypoints_take_little_longer_than_the_fastest(path: list[list[float]], fastest_s: float) -> None:
    limits = Limits(np.full(7, -3.0), np.full(7, 3.0), np.full(7, 3.0), np.full(7, 2.5))
    rows = retimed(None, np.array(path), limits)
    require_limits(rows, limits)
    assert fastest_s <= rows[0][-1] < 1.1 * fastest_s


BASE_LIMITS = {
    "planar": {"x": 0.5, "y": 0.4, "theta": 0.8},
    "floating": {name: 0.5 for name in ("trans_x", "trans_y", "trans_z", "rot_x", "rot_y", "rot_z", "rot_w")},
}
ARM = ("pan", "lift", "elbow")


def mobile(kind: str) -> CommanderModel:
    """A cart with an arm whose base moves on a plane or in space."""
    limits = {
        f"drive/{name}": {"max_velocity": speed, "max_acceleration": 2.0 * speed}
        for name, speed in BASE_LIMITS[kind].items()
    }
    return CommanderModel(URDF, SRDF.format(kind=kind), limits)


def mobile_trajectory(kind: str, rng: np.random.Generator, arm_moves: bool) -> RobotTrajectory:
    """Waypoints of the base, and of the arm; a quaternion may have either sign."""
    trajectory, count = RobotTrajectory(), int(rng.integers(2, 8))
    trajectory.multi_dof_joint_trajectory.joint_names = ["drive"]
    trajectory.joint_trajectory.joint_names = list(ARM) if arm_moves else []
    place, turn, arm = np.zeros(3), np.zeros(3), np.zeros(3)
    for _ in range(count):
        place, arm = place + rng.uniform(-0.5, 0.5, 3), np.clip(arm + rng.uniform(-0.5, 0.5, 3), -1.5, 1.5)
        turn = turn + rng.uniform(-0.5, 0.5, 3)
        rotation = pin.exp3(turn) if kind == "floating" else pin.utils.rotate("z", 3.0 + turn[2])
        quaternion = pin.Quaternion(rotation).coeffs() * rng.choice([-1.0, 1.0])
        point = MultiDOFJointTrajectoryPoint(transforms=[Transform(Vector3(*place), Quaternion(*quaternion.tolist()))])
        trajectory.multi_dof_joint_trajectory.points.append(point)
        if arm_moves:
            trajectory.joint_trajectory.points.append(JointTrajectoryPoint(positions=arm.tolist()))
    return trajectory


def base_rows(kind: str, trajectory: RobotTrajectory) -> Rows:
    """Times, positions, velocities and accelerations of the base's variables, from transforms and twists."""
    times, rows = [], []
    for point in trajectory.multi_dof_joint_trajectory.points:
        place, q = point.transforms[0].translation, point.transforms[0].rotation
        times.append(round(point.time_from_start.to_sec(), 9))
        rates = []
        for twist in (point.velocities[0], point.accelerations[0]):
            linear, angular = twist.linear, twist.angular
            if kind == "planar":
                rates.append([linear.x, linear.y, angular.z])
            else:
                rates.append([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z])
        if kind == "planar":
            rows.append(([place.x, place.y, 2.0 * np.arctan2(q.z, q.w)], *rates))
        else:
            rows.append(([place.x, place.y, place.z, q.x, q.y, q.z, q.w], *rates))
    values, velocities, accelerations = (np.array(column) for column in zip(*rows, strict=True))
    if kind == "planar":
        values[:, 2] = np.unwrap(values[:, 2])
        return np.array(times), values, velocities, accelerations
    signs = np.cumprod(np.append(1.0, np.where(np.sum(values[1:, 3:] * values[:-1, 3:], axis=1) < 0.0, -1.0, 1.0)))
    values[:, 3:] *= signs[:, None]
    return np.array(times), values, velocities, accelerations


@pytest.mark.parametrize("arm_moves", [False, True])
@pytest.mark.parametrize("kind", BASE_LIMITS)
@settings(max_examples=10, deadline=None)
@given(seed=SEEDS)
def test_a_moving_base_is_retimed_with_the_arm_and_keeps_its_limits(kind: str, arm_moves: bool, seed: int) -> None:
    rng, model = np.random.default_rng(seed), mobile(kind)
    asked = mobile_trajectory(kind, rng, arm_moves)
    factor = float(rng.choice([0.1, 1.0]))
    found = retimed_trajectory(model, asked, factor, factor)
    times, values, velocities, accelerations = base_rows(kind, found)
    linear = 2 if kind == "planar" else 3
    columns = slice(0, 3) if kind == "planar" else slice(0, linear)
    speeds = factor * np.array(list(BASE_LIMITS[kind].values()))[columns]
    unbounded = np.full(len(speeds), 1e3)
    require_limits(
        (times, values[:, columns], velocities[:, columns], accelerations[:, columns]),
        Limits(-unbounded, unbounded, speeds, 2.0 * speeds),
    )
    transforms = [point.transforms for point in asked.multi_dof_joint_trajectory.points]
    assert [point.transforms for point in found.multi_dof_joint_trajectory.points] == transforms
    if kind == "floating":
        rates = np.linalg.norm(velocities[:, 3:], axis=1)
        assert (rates <= 2.0 * 2.0 * factor * 0.5 * (1.0 + TOLERANCE)).all()  # |omega| = 2 |q'|, of four components
        turns = np.linalg.norm(np.diff(values[:, 3:], axis=0), axis=1)
        assert (np.diff(times) >= turns / (2.0 * factor * 0.5) * (1.0 - TOLERANCE)).all()
    if arm_moves:
        points = found.joint_trajectory.points
        assert [round(point.time_from_start.to_sec(), 9) for point in points] == times.tolist()
        arm = tuple(np.array([getattr(point, name) for point in points]) for name in ("positions", "velocities"))
        speeds = factor * np.array([model.joints[name].velocity for name in ARM])
        changes = factor * np.array([model.joints[name].acceleration for name in ARM])
        rows = (times, *arm, np.array([point.accelerations for point in points]))
        require_limits(rows, Limits(np.full(3, -4.0), np.full(3, 4.0), speeds, changes))


def test_a_base_and_an_arm_with_different_numbers_of_points_are_refused() -> None:
    trajectory = mobile_trajectory("planar", np.random.default_rng(1), arm_moves=True)
    trajectory.joint_trajectory.points.pop()
    with pytest.raises(MoveItCommanderException, match="both need the same points"):
        retimed_trajectory(mobile("planar"), trajectory, 1.0, 1.0)
    trajectory.multi_dof_joint_trajectory.joint_names = ["wheels"]
    with pytest.raises(MoveItCommanderException, match=r"\['wheels'\]; allowed: \['drive'\]"):
        retimed_trajectory(mobile("planar"), trajectory, 1.0, 1.0)
