# SPDX-License-Identifier: BSD-3-Clause
"""Joint trajectories and the piecewise polynomials that connect their points.

Between two points the curve is linear, cubic or quintic, by what both of them give: positions; positions and
velocities; positions, velocities and accelerations. The coefficients follow from the boundary conditions of each
segment.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POSITION, VELOCITY, ACCELERATION = 0, 1, 2
SHORTEST_SEGMENT_S = 1e-6


class InvalidTrajectoryError(Exception):
    """A trajectory that cannot be followed; the message lists everything that is wrong with it."""


@dataclass(frozen=True, slots=True)
class TrajectoryPoint:
    """One point as it was sent.

    Attributes:
        time_s: time from the start of the trajectory [s].
        positions: one per joint [rad|m].
        velocities: one per joint [rad/s|m/s], or empty.
        accelerations: one per joint [rad/s^2|m/s^2], or empty.
    """

    time_s: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...] = ()
    accelerations: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class JointTrajectory:
    """A trajectory as it was sent.

    Attributes:
        joint_names: the joints, in the order of the values of each point.
        points: in the order of time; none means "stop".
        stamp_s: when it starts [s of the controller's time]; 0 means at once.
    """

    joint_names: tuple[str, ...]
    points: tuple[TrajectoryPoint, ...]
    stamp_s: float = 0.0


def segment_coefficients(start: Array, end: Array, duration_s: Array | float, order: int) -> Array:
    """Polynomial coefficients, lowest power first, of one segment, or of several at once, for all joints.

    Args:
        start: state (position, velocity, acceleration) at its beginning, shape (..., 3, joints).
        end: state at its end, shape (..., 3, joints).
        duration_s: length [s], positive; for several segments of shape (..., 1).
        order: 1, 3 or 5: how many boundary conditions are used.

    Returns:
        Coefficients of shape (..., 6, joints).
    """
    p0, v0, a0 = (start[..., row, :] for row in (POSITION, VELOCITY, ACCELERATION))
    p1, v1, a1 = (end[..., row, :] for row in (POSITION, VELOCITY, ACCELERATION))
    t = duration_s
    way = p1 - p0
    none = np.zeros_like(p0)
    if order == 1:
        rows = [p0, way / t, none, none, none, none]
    elif order == 3:
        rows = [p0, v0, (3.0 * way - t * (2.0 * v0 + v1)) / t**2, (t * (v0 + v1) - 2.0 * way) / t**3, none, none]
    else:
        rows = [
            p0,
            v0,
            0.5 * a0,
            (20.0 * way - t * (8.0 * v1 + 12.0 * v0) - t**2 * (3.0 * a0 - a1)) / (2.0 * t**3),
            (-30.0 * way + t * (14.0 * v1 + 16.0 * v0) + t**2 * (3.0 * a0 - 2.0 * a1)) / (2.0 * t**4),
            (12.0 * way - 6.0 * t * (v0 + v1) + t**2 * (a1 - a0)) / (2.0 * t**5),
        ]
    return np.stack(rows, axis=-2)


class Spline:
    """A checked trajectory with the coefficients of all segments between its points.

    Args:
        trajectory: at least one point, as `check_points` allows.

    Attributes:
        times_s: time of each point from the start [s], shape (points,).
        states: what each point gives, missing values 0, shape (points, 3, joints).
        orders: highest order each point allows: 1, 3 or 5, shape (points,).
        coefficients: of the segment from point i to point i + 1, shape (points - 1, 6, joints).
    """

    __slots__ = ("times_s", "states", "orders", "coefficients")

    def __init__(self, trajectory: JointTrajectory) -> None:
        points = trajectory.points
        none = (0.0,) * len(trajectory.joint_names)
        self.times_s = np.array([point.time_s for point in points])
        self.states = np.array(
            [(point.positions, point.velocities or none, point.accelerations or none) for point in points]
        )
        self.orders = np.array([1 if not point.velocities else 5 if point.accelerations else 3 for point in points])
        self.coefficients = np.zeros((len(points) - 1, 6, len(none)))
        durations_s = np.diff(self.times_s)[:, np.newaxis]
        orders = np.minimum(self.orders[:-1], self.orders[1:])
        for order in (1, 3, 5):
            chosen = orders == order
            self.coefficients[chosen] = segment_coefficients(
                self.states[:-1][chosen], self.states[1:][chosen], durations_s[chosen], order
            )


class Track:
    """The motion of some joints of a controller: consecutive segments, then rest at the last position.

    Args:
        joints: indices of the joints in the controller.
        starts_s: start of each segment [s of the controller's time].
        coefficients: of each segment, shape (segments, 6, joints).
        end_s: end of the last segment [s].
        end_position: where it ends, shape (joints,).
        origin_s: time of its time_from_start 0 [s].
    """

    __slots__ = ("joints", "end_s", "origin_s", "_starts_s", "_coefficients", "_end_position")

    def __init__(
        self,
        joints: Sequence[int],
        starts_s: Sequence[float],
        coefficients: Array,
        end_s: float,
        end_position: Array,
        origin_s: float,
    ) -> None:
        self.joints = list(joints)
        self.end_s = end_s
        self.origin_s = origin_s
        self._starts_s = list(starts_s)
        self._coefficients = coefficients
        self._end_position = end_position

    @classmethod
    def hold(cls, joints: Sequence[int], position: Array, time_s: float) -> Track:
        """Rest at `position`, shape (joints,), from `time_s` on."""
        return cls(joints, [], np.zeros((0, 6, len(joints))), time_s, position.copy(), time_s)

    def sample(self, time_s: float) -> Array:
        """Position, velocity and acceleration at `time_s`, shape (3, joints)."""
        if time_s > self.end_s or not self._starts_s:
            state = np.zeros((3, len(self.joints)))
            state[POSITION] = self._end_position
            return state
        i = max(0, bisect_right(self._starts_s, time_s) - 1)
        t = max(0.0, time_s - self._starts_s[i])
        t2 = t * t
        t3 = t2 * t
        basis = (
            (1.0, t, t2, t3, t2 * t2, t2 * t3),
            (0.0, 1.0, 2.0 * t, 3.0 * t2, 4.0 * t3, 5.0 * t2 * t2),
            (0.0, 0.0, 2.0, 6.0 * t, 12.0 * t2, 20.0 * t3),
        )
        sampled: Array = np.dot(basis, self._coefficients[i])
        return sampled

    def first_segment(self) -> tuple[Array, float]:
        """Coefficients of the first segment, shape (6, joints), and its duration [s]."""
        end_s = self._starts_s[1] if len(self._starts_s) > 1 else self.end_s
        return self._coefficients[0], end_s - self._starts_s[0]

    def without(self, joints: Sequence[int]) -> Track | None:
        """This track for its other joints; None when none is left."""
        kept = [i for i, joint in enumerate(self.joints) if joint not in joints]
        if not kept:
            return None
        return Track(
            [self.joints[i] for i in kept],
            self._starts_s,
            self._coefficients[:, :, kept],
            self.end_s,
            self._end_position[kept],
            self.origin_s,
        )


def splice(
    spline: Spline, joints: Sequence[int], origin_s: float, splice_s: float, state: Array, continuous: Sequence[bool]
) -> Track:
    """Joins a new trajectory to the present motion: from `state` at `splice_s` to the first point after it, and on.

    When a point lies exactly at `splice_s` and agrees with `state` in position and velocity, the trajectory is followed
    as sent; otherwise a segment of the order of the next point leads over to it.

    Args:
        spline: the new trajectory; it ends at least SHORTEST_SEGMENT_S after `splice_s`.
        joints: indices of its joints in the controller, in the order of its values.
        origin_s: time of its time_from_start 0 [s].
        splice_s: when it takes over [s].
        state: desired state of its joints at `splice_s`, shape (3, joints).
        continuous: which joints are continuous; they take the shorter direction.
    """
    first = int(np.searchsorted(spline.times_s, splice_s - origin_s, side="right"))
    offset = np.where(continuous, _whole_turns(state[POSITION], spline.states[first, POSITION]), 0.0)
    coefficients = spline.coefficients[max(0, first - 1) :]
    if offset.any():
        coefficients = coefficients.copy()
        coefficients[:, 0] += offset
    if not (first > 0 and _agrees(spline, first - 1, splice_s - origin_s, state, offset)):
        target = spline.states[first].copy()
        target[POSITION] += offset
        bridge = segment_coefficients(
            state, target, origin_s + float(spline.times_s[first]) - splice_s, int(spline.orders[first])
        )
        coefficients = np.concatenate([bridge[np.newaxis], coefficients[1 if first > 0 else 0 :]])
    knots_s = (origin_s + spline.times_s[first:]).tolist()
    return Track(
        joints, [splice_s, *knots_s[:-1]], coefficients, knots_s[-1], spline.states[-1, POSITION] + offset, origin_s
    )


def _whole_turns(position: Array, target: Array) -> Array:
    """Returns the multiple of 2 pi that brings `target` nearest to `position`; half a turn keeps its direction.

    Both of shape (joints,) [rad].
    """
    turns = (position - target) / (2.0 * math.pi)
    full_turns = np.where(np.abs(np.abs(turns) % 1.0 - 0.5) < 1e-9, np.trunc(turns), np.round(turns))
    return full_turns * (2.0 * math.pi)


def _agrees(spline: Spline, point: int, time_s: float, state: Array, offset: Array) -> bool:
    """Whether `state` at `time_s` is where the trajectory's own segment from `point` begins."""
    tolerance = 1e-6
    if abs(spline.times_s[point] - time_s) > 1e-9:
        return False
    velocity = spline.states[point, VELOCITY]
    return bool(
        np.all(np.abs(spline.states[point, POSITION] + offset - state[POSITION]) < tolerance)
        and np.all(np.abs(velocity - state[VELOCITY]) < tolerance)
    )
