# SPDX-License-Identifier: BSD-3-Clause
"""Blending of two motions without a stop, inside a sphere around their common point.

Both motions continue in their own time. The link pose is a weighted mean of the two poses, whose weight is a
fifth-order polynomial of time. Velocity and acceleration are therefore continuous at the sphere, and a mean of two
points inside the sphere stays inside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.planners.pilz.joint_motion import JointState, follow, state_at
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

SEARCH_PERIOD_S = 0.005
CROSSING_TOLERANCE_S = 1.0e-9
SAME_POSTURE = 1.0e-3  # [rad or m]
MIN_GAP_S = 1.0e-4  # minimum time between trajectory points where the pieces meet


@dataclass(frozen=True, slots=True, eq=False)
class Transition:
    """Link motion inside the blend sphere.

    Attributes:
        first, second: Trajectories to blend.
        follower: Kinematics of the blended link.
        first_start_s: Time of the first trajectory at the start of the transition.
        second_start_s: Time of the second trajectory at the start of the transition; negative if it starts later.
        duration_s: Duration of the transition.
    """

    first: Trajectory
    second: Trajectory
    follower: PoseFollower
    first_start_s: float
    second_start_s: float
    duration_s: float

    @property
    def knots(self) -> Array:
        """Times of the points of both trajectories within the transition [s]."""
        times = np.concatenate([self.first.times - self.first_start_s, self.second.times - self.second_start_s])
        inside = times[(times > 0.0) & (times < self.duration_s)]
        return np.sort(np.concatenate([[0.0], inside, [self.duration_s]]))

    def weight(self, time_s: float) -> tuple[float, float, float]:
        """Returns the weight of the second motion and its first two derivatives, which are 0 at both ends."""
        s = min(max(time_s / self.duration_s, 0.0), 1.0)
        complement = 1.0 - s
        return (
            s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
            30.0 * s * s * complement * complement / self.duration_s,
            60.0 * s * complement * (1.0 - 2.0 * s) / self.duration_s**2,
        )

    def pose(self, time_s: float) -> Transform:
        """Returns the link's pose in the planning frame."""
        first = self.follower.pose(state_at(self.first, time_s + self.first_start_s).positions)
        second = self.follower.pose(state_at(self.second, time_s + self.second_start_s).positions)
        weight = self.weight(time_s)[0]
        rotation_vector = pin.log3(first.rotation.T @ second.rotation)
        return pin.SE3(
            first.rotation @ pin.exp3(weight * rotation_vector),
            first.translation + weight * (second.translation - first.translation),
        )

    def posture(self, time_s: float) -> JointState:
        """Returns the weighted mean of both joint states, the preferred posture of a redundant arm."""
        first, second = (
            state_at(self.first, time_s + self.first_start_s),
            state_at(self.second, time_s + self.second_start_s),
        )
        weight, rate, rate_change = self.weight(time_s)
        offset, speed = second.positions - first.positions, second.velocities - first.velocities
        return JointState(
            first.positions + weight * offset,
            first.velocities + weight * speed + rate * offset,
            first.accelerations
            + weight * (second.accelerations - first.accelerations)
            + 2.0 * rate * speed
            + rate_change * offset,
        )


def _crossing(outside: Callable[[float], bool], times: Array) -> float | None:
    """Returns the time at which a motion leaves the sphere, or None.

    Args:
        outside: Checks whether the link is outside the sphere at a time [s].
        times: Search times [s], ordered outwards from the sphere's centre.
    """
    inner = float(times[0])
    for outer in (float(item) for item in times[1:]):
        if not outside(outer):
            inner = outer
            continue
        while abs(outer - inner) > CROSSING_TOLERANCE_S:
            middle = 0.5 * (inner + outer)
            inner, outer = (inner, middle) if outside(middle) else (middle, outer)
        return outer
    return None


def blend(
    first: Trajectory, second: Trajectory, radius: float, follower: PoseFollower, period_s: float
) -> tuple[Trajectory, Trajectory]:
    """Blends two trajectories.

    Args:
        first: Trajectory of a group.
        second: Trajectory of the same group that starts at the end of the first.
        radius: Radius of the sphere around the common point [m].
        follower: Kinematics of the blended link.
        period_s: Sampling period inside the sphere [s].

    Returns:
        The blended trajectory, and its part inside the sphere with times from 0.

    Raises:
        PlanningError: A motion stays inside the sphere, or the joints cannot follow the transition.
    """
    centre = follower.pose(first.positions[-1]).translation

    def outside(trajectory: Trajectory) -> Callable[[float], bool]:
        return lambda time_s: (
            float(np.linalg.norm(follower.pose(state_at(trajectory, time_s).positions).translation - centre)) >= radius
        )

    entry_s = _crossing(outside(first), first.sample_times(SEARCH_PERIOD_S)[::-1])
    exit_s = _crossing(outside(second), second.sample_times(SEARCH_PERIOD_S))
    if entry_s is None or exit_s is None:
        side = "before" if entry_s is None else "after"
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"blend_radius {radius} m: the motion {side} the blended "
            f"point stays within this radius; choose a smaller radius",
        )
    remaining_s = first.duration_s - entry_s
    blend_s = max(remaining_s, exit_s)
    transition = Transition(first, second, follower, entry_s, exit_s - blend_s, blend_s)
    start, end = state_at(first, entry_s), state_at(second, exit_s)
    middle = follow(transition, follower, period_s, start=start, end=end, posture=transition.posture)
    deviation = np.abs(middle.positions[-1] - end.positions)
    if deviation.max() > SAME_POSTURE:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            "blending: the arm would not arrive in the posture of the next motion; "
            f"joint '{first.joint_names[int(deviation.argmax())]}' is off by "
            f"{deviation.max():.3f}: choose a smaller blend_radius",
        )
    middle.positions[-1] = end.positions
    parts = [
        _part(first, first.times < entry_s - MIN_GAP_S, 0.0),
        _part(middle, np.ones(len(middle.times), dtype=bool), entry_s),
        _part(second, second.times > exit_s + MIN_GAP_S, entry_s + blend_s - exit_s),
    ]
    return concatenate_trajectories(parts), middle


def _part(trajectory: Trajectory, mask: NDArray[np.bool_], shift_s: float) -> Trajectory:
    return Trajectory(
        trajectory.joint_names,
        trajectory.times[mask] + shift_s,
        trajectory.positions[mask],
        trajectory.velocities[mask],
        trajectory.accelerations[mask],
    )


def concatenate_trajectories(parts: list[Trajectory]) -> Trajectory:
    """Joins pieces with consecutive times, rounded to whole nanoseconds."""
    times = np.round(np.concatenate([part.times for part in parts]), 9)
    return Trajectory(
        parts[0].joint_names,
        times,
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("positions", "velocities", "accelerations")
        ),
    )


def append_trajectory(first: Trajectory, second: Trajectory) -> Trajectory:
    """Returns the first trajectory followed by the second, with a stop in between."""
    mask = np.arange(len(second.times)) > 0
    return concatenate_trajectories([first, _part(second, mask, first.duration_s)])
