# SPDX-License-Identifier: BSD-3-Clause
"""The three motions: PTP moves the joints synchronously, LIN moves a link along a line, CIRC along an arc."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.planners.pilz.cartesian_limits import CartesianLimits
from modular_framework_planning.planners.pilz.joint_motion import JointRates, JointState, Posture, at_rest, follow
from modular_framework_planning.planners.pilz.pose_path import PosePath, TimedPath, timed
from modular_framework_planning.planners.pilz.velocity_profile import fastest_profile, sample_times
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

SAME_POSITION = 1.0e-9  # [rad or m]
GOAL_TOLERANCE = 1.0e-4  # [rad or m] between the end of a line and the joint values that were asked for


@dataclass(frozen=True, slots=True)
class Pace:
    """Speed and sampling period of a motion.

    Attributes:
        velocity_scaling, acceleration_scaling: shares of the limits, in (0, 1].
        period_s: between two points of a trajectory.
    """

    velocity_scaling: float
    acceleration_scaling: float
    period_s: float


def standstill(joints: tuple[str, ...], values: Array) -> Trajectory:
    """Returns the trajectory of one point."""
    still = np.zeros((1, len(values)))
    return Trajectory(joints, np.zeros(1), values[None, :].copy(), still, still.copy())


def point_to_point(start: Array, goal: Array, rates: JointRates, pace: Pace) -> Trajectory:
    """Moves all joints with common phases under the strictest limits of any; the joint with the longest way leads."""
    change = goal - start
    lead = float(np.abs(change).max())
    if lead < SAME_POSITION:
        return standstill(rates.joints, start)
    profile = fastest_profile(
        lead,
        float(rates.velocity.min()) * pace.velocity_scaling,
        float(rates.acceleration.min()) * pace.acceleration_scaling,
        float(rates.deceleration.min()) * pace.acceleration_scaling,
    )
    times = sample_times(profile.duration_s, profile.knots, pace.period_s)
    position, velocity, acceleration = (values[:, None] / lead * change for values in profile.at(times))
    positions = start + position
    positions[-1], velocity[-1], acceleration[-1] = goal, 0.0, 0.0
    return Trajectory(rates.joints, times, positions, velocity, acceleration)


def along_path(
    path: PosePath, follower: PoseFollower, start: Array, limits: CartesianLimits, pace: Pace, goal: Array | None = None
) -> Trajectory:
    """Moves a link along a path.

    Args:
        path: of the follower's link.
        follower: inverse kinematics by continuation.
        start: joint values at the start of the path.
        limits: of the link.
        pace: how fast.
        goal: joint values the motion has to end at, where the goal was given by joints.

    Raises:
        PlanningError: a pose cannot be reached without a jump, a limit is broken, or the end is another posture than
            that of the goal.
    """
    motion = timed(path, limits, pace.velocity_scaling, pace.acceleration_scaling)
    if motion is None:
        trajectory = standstill(follower.group.joints, start)
    else:
        posture = None if goal is None else _towards(motion, start, goal)
        trajectory = follow(motion, follower, pace.period_s, at_rest(start), posture=posture)
    if goal is not None:
        require_posture(trajectory, goal)
    return trajectory


def _towards(motion: TimedPath, start: Array, goal: Array) -> Posture:
    """Returns the postures of a redundant arm whose end is given by joints."""

    def posture(time_s: float) -> JointState:
        shares = (float(values[0]) / motion.profile.distance for values in motion.profile.at(np.array([time_s])))
        share, speed, change = shares
        return JointState(start + share * (goal - start), speed * (goal - start), change * (goal - start))

    return posture


def require_posture(trajectory: Trajectory, goal: Array) -> None:
    """Checks that a motion ends at joint values.

    Raises:
        PlanningError: the same pose is reached with other joint values.
    """
    off = np.abs(trajectory.positions[-1] - goal)
    worst = int(off.argmax())
    if off[worst] > GOAL_TOLERANCE:
        raise PlanningError(
            ErrorCode.GOAL_CONSTRAINTS_VIOLATED,
            "the path ends at the goal's pose in another posture: "
            f"joint '{trajectory.joint_names[worst]}' at {trajectory.positions[-1][worst]:.4f} instead "
            f"of {goal[worst]:.4f}; give the goal as a pose, or move there by PTP",
        )
