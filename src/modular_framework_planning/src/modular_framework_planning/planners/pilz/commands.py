# SPDX-License-Identifier: BSD-3-Clause
"""PTP, LIN and CIRC trajectories: synchronous joint motion, link motion along a line, link motion along an arc."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.planners.pilz.cartesian_limits import CartesianLimits
from modular_framework_planning.planners.pilz.joint_motion import JointRateLimits, JointState, Posture, at_rest, follow
from modular_framework_planning.planners.pilz.pose_path import PosePath, TimedPath, time_pose_path
from modular_framework_planning.planners.pilz.velocity_profile import fastest_profile, sample_times
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

MIN_MOTION = 1.0e-9  # [rad or m]
GOAL_TOLERANCE = 1.0e-4  # distance between the end of a path and the requested joint values [rad or m]


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Speed and sampling period of a motion.

    Attributes:
        velocity_scaling, acceleration_scaling: Fractions of the limits, in (0, 1].
        period_s: Sampling period of the trajectory [s].
    """

    velocity_scaling: float
    acceleration_scaling: float
    period_s: float


def standstill(joints: tuple[str, ...], values: Array) -> Trajectory:
    """Returns a trajectory with a single point."""
    still = np.zeros((1, len(values)))
    return Trajectory(joints, np.zeros(1), values[None, :].copy(), still, still.copy())


def point_to_point(start: Array, goal: Array, limits: JointRateLimits, settings: MotionSettings) -> Trajectory:
    """Returns a PTP motion whose joints accelerate, cruise and brake together.

    The joint with the largest change moves within the strictest limits of all joints; the others scale with it.

    Args:
        start: Start joint vector [rad or m].
        goal: Goal joint vector [rad or m].
        limits: Joint limits.
        settings: Speed and sampling period.
    """
    change = goal - start
    max_change = float(np.abs(change).max())
    if max_change < MIN_MOTION:
        return standstill(limits.joints, start)
    profile = fastest_profile(
        max_change,
        float(limits.velocity.min()) * settings.velocity_scaling,
        float(limits.acceleration.min()) * settings.acceleration_scaling,
        float(limits.deceleration.min()) * settings.acceleration_scaling,
    )
    times = sample_times(profile.duration_s, profile.knots, settings.period_s)
    position, velocity, acceleration = (values[:, None] / max_change * change for values in profile.sample(times))
    positions = start + position
    positions[-1], velocity[-1], acceleration[-1] = goal, 0.0, 0.0
    return Trajectory(limits.joints, times, positions, velocity, acceleration)


def along_path(
    path: PosePath,
    follower: PoseFollower,
    start: Array,
    limits: CartesianLimits,
    *,
    settings: MotionSettings,
    goal: Array | None = None,
) -> Trajectory:
    """Returns the joint trajectory of a link motion along a path.

    Args:
        path: Path of the follower's link.
        follower: Kinematics of the link.
        start: Joint values at the start of the path [rad or m].
        limits: Cartesian limits of the link.
        settings: Speed and sampling period.
        goal: Joint values of a joint goal [rad or m], otherwise None.

    Raises:
        PlanningError: A pose cannot be reached without a jump, a joint limit is exceeded, or the final posture
            differs from the goal.
    """
    motion = time_pose_path(path, limits, settings.velocity_scaling, settings.acceleration_scaling)
    if motion is None:
        trajectory = standstill(follower.group.joints, start)
    else:
        posture = None if goal is None else _posture_between(motion, start, goal)
        trajectory = follow(motion, follower, settings.period_s, start=at_rest(start), posture=posture)
    if goal is not None:
        require_posture(trajectory, goal)
    return trajectory


def _posture_between(motion: TimedPath, start: Array, goal: Array) -> Posture:
    """Returns the preferred postures of a redundant arm during the motion to a joint goal."""

    def posture(time_s: float) -> JointState:
        progress = (float(values[0]) / motion.profile.distance for values in motion.profile.sample(np.array([time_s])))
        fraction, rate, rate_change = progress
        return JointState(start + fraction * (goal - start), rate * (goal - start), rate_change * (goal - start))

    return posture


def require_posture(trajectory: Trajectory, goal: Array) -> None:
    """Checks that a trajectory ends at the joint values of the goal.

    Raises:
        PlanningError: The joint values differ.
    """
    deviation = np.abs(trajectory.positions[-1] - goal)
    worst = int(deviation.argmax())
    if deviation[worst] > GOAL_TOLERANCE:
        raise PlanningError(
            ErrorCode.GOAL_CONSTRAINTS_VIOLATED,
            "the path ends at the goal pose, but in a different posture: "
            f"joint '{trajectory.joint_names[worst]}' is at {trajectory.positions[-1][worst]:.4f} instead "
            f"of {goal[worst]:.4f}; request a pose goal or use PTP",
        )
