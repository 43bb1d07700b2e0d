# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of a link motion to a joint trajectory within the joint limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.pose_follower import LinkMotion, PoseFollower
from modular_framework_planning.planners.pilz.velocity_profile import sample_times
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

CHECK_PERIOD_S = 0.01  # period of the joint limit checks
MAX_CHECKS = 4000
DIFFERENCE_STEP_S = 1.0e-5  # step of the numeric derivatives of a pose
LIMIT_TOLERANCE = 1.0e-3  # tolerance, as a fraction of a limit


@dataclass(frozen=True, slots=True, eq=False)
class JointState:
    """Joint state of a group, with arrays of shape (joints,) [rad or m, per s, per s^2]."""

    positions: Array
    velocities: Array
    accelerations: Array


Posture = Callable[[float], JointState]  # preferred joint state at a time [s]


def at_rest(positions: Array) -> JointState:
    """Returns a joint state at rest."""
    return JointState(positions, np.zeros_like(positions), np.zeros_like(positions))


def state_at(trajectory: Trajectory, time_s: float) -> JointState:
    """Returns the joint state of a trajectory at a time; before and after the trajectory, the joints are at rest."""
    if not 0.0 <= time_s <= trajectory.duration_s:
        return at_rest(trajectory.positions[0 if time_s < 0.0 else -1])
    return JointState(*(rows[0] for rows in trajectory.sample(np.array([time_s]))[:3]))


class PoseMotion(Protocol):
    """Pose of a link over time."""

    @property
    def duration_s(self) -> float:
        """Duration of the motion [s]."""

    @property
    def knots(self) -> Array:
        """Times at which the jerk can change, in ascending order [s]."""

    def pose(self, time_s: float) -> Transform:
        """Returns the link pose in the planning frame."""


@dataclass(frozen=True, slots=True, eq=False)
class JointRateLimits:
    """Velocity, acceleration and deceleration limits of the joints of a group [rad or m, per s or per s^2]."""

    joints: tuple[str, ...]
    velocity: Array
    acceleration: Array
    deceleration: Array

    @classmethod
    def of(cls, model: RobotModel, group: JointGroup) -> JointRateLimits:
        """Returns the limits of a group."""
        return cls(
            group.joints,
            model.max_velocity[group.indices],
            model.max_acceleration[group.indices],
            model.max_deceleration[group.indices],
        )

    def require(self, time_s: float, velocities: Array, accelerations: Array) -> None:
        """Checks a sample against the limits.

        Args:
            time_s: Time of the sample, for the error message [s].
            velocities: Joint velocities, shape (joints,).
            accelerations: Joint accelerations, shape (joints,).

        Raises:
            PlanningError: Names the joint that exceeds its limit most.
        """
        braking = velocities * accelerations < 0.0
        allowed = np.where(braking, self.deceleration, self.acceleration)
        for quantity, unit, values, limits in (
            ("velocity", "1/s", velocities, self.velocity),
            ("acceleration", "1/s^2", accelerations, allowed),
        ):
            excess = np.abs(values) / limits
            worst = int(excess.argmax())
            if excess[worst] > 1.0 + LIMIT_TOLERANCE:
                raise PlanningError(
                    ErrorCode.INVALID_MOTION_PLAN,
                    f"joint '{self.joints[worst]}' would need {quantity} {abs(values[worst]):.3f} {unit} at "
                    f"{time_s:.3f} s; its limit is {limits[worst]:.3f}: lower max_{quantity}_scaling_factor or avoid "
                    "singular postures",
                )


def link_motion(motion: PoseMotion, time_s: float) -> LinkMotion:
    """Returns the velocity and acceleration of a link by central differences."""
    step = DIFFERENCE_STEP_S
    before, now, after = (motion.pose(time_s + shift) for shift in (-step, 0.0, step))
    rotation_before = now.rotation @ pin.log3(before.rotation.T @ now.rotation)
    rotation_after = now.rotation @ pin.log3(now.rotation.T @ after.rotation)
    step_before, step_after = now.translation - before.translation, after.translation - now.translation
    velocity = np.concatenate([step_before + step_after, rotation_before + rotation_after]) / (2.0 * step)
    return LinkMotion(velocity, np.concatenate([step_after - step_before, rotation_after - rotation_before]) / step**2)


def follow(
    motion: PoseMotion,
    follower: PoseFollower,
    period_s: float,
    *,
    start: JointState,
    end: JointState | None = None,
    posture: Posture | None = None,
) -> Trajectory:
    """Returns the joint trajectory that follows a link motion.

    Args:
        motion: Motion of the follower's link.
        follower: Kinematics of the link.
        period_s: Sampling period of the trajectory [s].
        start: Joint state at the start.
        end: Joint velocities and accelerations at the end; None for a stop.
        posture: Preferred posture of a redundant arm.

    Raises:
        PlanningError: A pose cannot be reached without a jump, or a joint limit would be exceeded.
    """
    limits = JointRateLimits.of(follower.model, follower.group)
    points = sample_times(motion.duration_s, motion.knots, period_s)
    max_gap_s = max(CHECK_PERIOD_S, motion.duration_s / MAX_CHECKS)
    state, rows = start, [start]
    for low, high in zip(points[:-1], points[1:], strict=True):
        count = int(np.ceil((high - low) / max_gap_s))
        for time_s in low + (high - low) * np.arange(1, count + 1) / count:
            state = _advance(motion, follower, state, time_s=float(time_s), gap_s=(high - low) / count, posture=posture)
            limits.require(time_s, state.velocities, state.accelerations)
        rows.append(state)
    rows[-1] = JointState(state.positions, end.velocities, end.accelerations) if end else at_rest(state.positions)
    return Trajectory(
        follower.group.joints,
        points,
        *(np.array([getattr(row, name) for row in rows]) for name in ("positions", "velocities", "accelerations")),
    )


def _advance(
    motion: PoseMotion,
    follower: PoseFollower,
    state: JointState,
    *,
    time_s: float,
    gap_s: float,
    posture: Posture | None,
) -> JointState:
    guess = state.positions + gap_s * (state.velocities + 0.5 * gap_s * state.accelerations)
    target = posture(time_s) if posture else None
    try:
        values = follower.solve(guess, motion.pose(time_s), target.positions if target else None)
    except PlanningError as error:
        raise PlanningError(error.code, f"{error.reason} (after {time_s:.3f} of {motion.duration_s:.3f} s)") from error
    velocities, accelerations = follower.joint_rates(
        values, link_motion(motion, time_s), (target.velocities, target.accelerations) if target else None
    )
    return JointState(values, velocities, accelerations)
