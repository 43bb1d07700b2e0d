# SPDX-License-Identifier: BSD-3-Clause
"""Joins two motions without a stop: inside a sphere around their common point the link passes from one to the other.

Both motions go on in their own time; the link's pose is a mean of the two poses whose weight moves smoothly (a
polynomial of fifth order) from the first to the second. The link enters and leaves the sphere with the velocity and
the acceleration of the motion it comes from or goes to, and as a mean of two points of a ball it stays inside.
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
SHORTEST_PIECE_S = 1.0e-4  # between two points where the pieces meet


@dataclass(frozen=True, slots=True, eq=False)
class Transition:
    """A link's motion inside the sphere.

    Attributes:
        first_from, second_from: times of the two trajectories at which the transition begins; the second's may be
            below 0, when it has to wait.
    """

    first: Trajectory
    second: Trajectory
    follower: PoseFollower
    first_from: float
    second_from: float
    duration_s: float

    @property
    def knots(self) -> Array:
        """Times at which either motion has a point."""
        times = np.concatenate([self.first.times - self.first_from, self.second.times - self.second_from])
        inside = times[(times > 0.0) & (times < self.duration_s)]
        return np.sort(np.concatenate([[0.0], inside, [self.duration_s]]))

    def weight(self, time_s: float) -> tuple[float, float, float]:
        """Returns the second motion's share and its first and second derivative, which are 0 at both ends."""
        s = min(max(time_s / self.duration_s, 0.0), 1.0)
        rest = 1.0 - s
        return (
            s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
            30.0 * s * s * rest * rest / self.duration_s,
            60.0 * s * rest * (1.0 - 2.0 * s) / self.duration_s**2,
        )

    def pose(self, time_s: float) -> Transform:
        """Returns the link's pose in the planning frame."""
        one = self.follower.pose(state_at(self.first, time_s + self.first_from).positions)
        other = self.follower.pose(state_at(self.second, time_s + self.second_from).positions)
        weight = self.weight(time_s)[0]
        turn = pin.log3(one.rotation.T @ other.rotation)
        return pin.SE3(
            one.rotation @ pin.exp3(weight * turn), one.translation + weight * (other.translation - one.translation)
        )

    def posture(self, time_s: float) -> JointState:
        """Returns the mean of the joints, for a redundant arm to keep near to."""
        one, other = state_at(self.first, time_s + self.first_from), state_at(self.second, time_s + self.second_from)
        weight, rate, change = self.weight(time_s)
        offset, speed = other.positions - one.positions, other.velocities - one.velocities
        return JointState(
            one.positions + weight * offset,
            one.velocities + weight * speed + rate * offset,
            one.accelerations
            + weight * (other.accelerations - one.accelerations)
            + 2.0 * rate * speed
            + change * offset,
        )


def _crossing(outside: Callable[[float], bool], times: Array) -> float | None:
    """Returns when a motion crosses the sphere, looking along times that begin inside; None where it stays inside."""
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
    """Joins two trajectories.

    Args:
        first: motion of a group.
        second: motion of the same group that starts where the first ends.
        radius: of the sphere around the common point [m].
        follower: of the link the radius belongs to.
        period_s: between two points in the sphere.

    Returns:
        The joined trajectory, and its part within the sphere with times from 0.

    Raises:
        PlanningError: a motion stays within the sphere, or the joints cannot follow the transition.
    """
    centre = follower.pose(first.positions[-1]).translation

    def outside(trajectory: Trajectory) -> Callable[[float], bool]:
        return lambda time_s: (
            float(np.linalg.norm(follower.pose(state_at(trajectory, time_s).positions).translation - centre)) >= radius
        )

    entry = _crossing(outside(first), first.sample_times(SEARCH_PERIOD_S)[::-1])
    leave = _crossing(outside(second), second.sample_times(SEARCH_PERIOD_S))
    if entry is None or leave is None:
        which = "before" if entry is None else "after"
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"blend_radius {radius} m: the motion {which} the blended "
            f"point stays within that distance of it; choose a radius shorter than the motion",
        )
    remaining = first.duration_s - entry
    duration = max(remaining, leave)
    transition = Transition(first, second, follower, entry, leave - duration, duration)
    start, end = state_at(first, entry), state_at(second, leave)
    middle = follow(transition, follower, period_s, start, end, transition.posture)
    off = np.abs(middle.positions[-1] - end.positions)
    if off.max() > SAME_POSTURE:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            "blending: the arm would arrive in another posture than the "
            f"next motion has; joint '{first.joint_names[int(off.argmax())]}' is off by "
            f"{off.max():.3f}: choose a smaller blend_radius",
        )
    middle.positions[-1] = end.positions
    parts = [
        _part(first, first.times < entry - SHORTEST_PIECE_S, 0.0),
        _part(middle, np.ones(len(middle.times), dtype=bool), entry),
        _part(second, second.times > leave + SHORTEST_PIECE_S, entry + duration - leave),
    ]
    return concatenated(parts), middle


def _part(trajectory: Trajectory, chosen: NDArray[np.bool_], shift_s: float) -> Trajectory:
    return Trajectory(
        trajectory.joint_names,
        trajectory.times[chosen] + shift_s,
        trajectory.positions[chosen],
        trajectory.velocities[chosen],
        trajectory.accelerations[chosen],
    )


def concatenated(parts: list[Trajectory]) -> Trajectory:
    """Joins pieces whose times are already right, to whole nanoseconds."""
    times = np.round(np.concatenate([part.times for part in parts]), 9)
    return Trajectory(
        parts[0].joint_names,
        times,
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("positions", "velocities", "accelerations")
        ),
    )


def appended(first: Trajectory, second: Trajectory) -> Trajectory:
    """Runs the second trajectory after the first has come to rest."""
    chosen = np.arange(len(second.times)) > 0
    return concatenated([first, _part(second, chosen, first.duration_s)])
