# SPDX-License-Identifier: BSD-3-Clause
"""However a trajectory is timed, the curve that a controller runs through its points keeps the limits of the joints.

The curve is SciPy's: quintics through positions, velocities and accelerations at whole nanoseconds, at 1 ms samples.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly

from modular_framework_testing.planning.independent_arms import SEVEN_JOINT_SRDF, SEVEN_JOINT_URDF, seven_joint_flange

pytest.importorskip("moveit_commander", reason="source the workspace")

import pinocchio as pin  # noqa: E402
from moveit_commander.trajectory_timing import Limits, distinct, retime  # noqa: E402

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

TOLERANCE = 0.01  # of a limit, and of the range of a joint
SEEDS = st.integers(0, 2**32 - 1)
Rows = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # times, positions, velocities, accelerations
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


JERK = np.full(7, 50.0)
TIMINGS: dict[str, Timing] = {
    "retimed waypoints": retimed,
    "retimed plan": lambda model, path, limits: retimed(model, timed(path, limits).positions, limits),
    "rounded corners": lambda _, path, limits: rows_of(timed(path, limits)),
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
    times, positions, velocities, accelerations = rows
    assert times[0] == 0.0 and (np.diff(times) > 0.0).all() and np.array_equal(times, np.round(times, 9))
    assert np.abs(velocities[[0, -1]]).max() < 1e-9
    curve = BPoly.from_derivatives(times, np.stack([positions, velocities, accelerations], axis=1))
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
