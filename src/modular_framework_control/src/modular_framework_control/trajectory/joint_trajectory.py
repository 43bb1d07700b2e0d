# SPDX-License-Identifier: BSD-3-Clause
"""Joint trajectories and their interpolation by piecewise polynomials.

A segment is linear, cubic or quintic if both of its points give positions; positions and velocities; or positions,
velocities and accelerations. Its coefficients follow from these boundary conditions.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POSITION, VELOCITY, ACCELERATION = 0, 1, 2
MIN_SEGMENT_S = 1e-6
CHUNK_SIZE = 256
PAUSE_S = 1e-4
PAUSE_FRACTION = 1.0


class InvalidTrajectoryError(Exception):
    """A trajectory that cannot be followed; the message lists all faults."""


@dataclass(frozen=True, slots=True)
class TrajectoryPoint:
    """A received point, not validated.

    Attributes:
        time_s: Time from the start of the trajectory.
        positions: Position per joint [rad|m].
        velocities: Velocity per joint [rad/s|m/s], or empty.
        accelerations: Acceleration per joint [rad/s^2|m/s^2], or empty.
    """

    time_s: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...] = ()
    accelerations: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class TrajectoryPoints:
    """The received points of a trajectory, not validated.

    Attributes:
        times_s: Time of each point from the start of the trajectory, shape (points,).
        values: Positions, velocities and accelerations of each point, 0 if missing, shape (points, 3, joints). Values
            beyond the number of joint names are left out; all values are left out if the message is too small for all
            positions.
        counts: Received numbers of positions, velocities and accelerations, shape (points, 3).
    """

    times_s: Array
    values: Array
    counts: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.times_s)


@dataclass(frozen=True, slots=True)
class JointTrajectory:
    """A received trajectory, not validated.

    Attributes:
        joint_names: Joints, in the order of the values of each point.
        points: Points in the order of time; empty for "stop".
        stamp_s: Start time [s of the controller's time]; 0 for immediately.
    """

    joint_names: tuple[str, ...]
    points: TrajectoryPoints
    stamp_s: float = 0.0

    @classmethod
    def of_points(
        cls, joint_names: tuple[str, ...], points: Sequence[TrajectoryPoint], stamp_s: float = 0.0
    ) -> JointTrajectory:
        """Returns a trajectory of single points.

        Args:
            joint_names: Joints, in the order of the values of each point.
            points: Points in the order of time.
            stamp_s: Start time [s of the controller's time]; 0 for immediately.
        """
        rows = [(point.positions, point.velocities, point.accelerations) for point in points]
        values = np.zeros((len(points), 3, len(joint_names)))
        for i, row in enumerate(rows):
            for kind, sent in enumerate(row):
                values_used = sent[: len(joint_names)]
                values[i, kind, : len(values_used)] = values_used
        times_s = np.array([point.time_s for point in points], float)
        counts = np.array([[len(sent) for sent in row] for row in rows], np.int32).reshape(-1, 3)
        return cls(joint_names, TrajectoryPoints(times_s, values, counts), stamp_s)


def segment_coefficients(start: Array, end: Array, duration_s: Array | float, order: int) -> Array:
    """Computes the polynomial coefficients of one or several segments.

    Args:
        start: State (position, velocity, acceleration) at the start, shape (..., 3, joints).
        end: State at the end, shape (..., 3, joints).
        duration_s: Positive duration [s]; for several segments shape (..., 1).
        order: Order of the polynomial, 1, 3 or 5.

    Returns:
        Coefficients, lowest power first, shape (..., 6, joints).
    """
    p0, v0, a0 = (start[..., row, :] for row in (POSITION, VELOCITY, ACCELERATION))
    p1, v1, a1 = (end[..., row, :] for row in (POSITION, VELOCITY, ACCELERATION))
    t = duration_s
    distance = p1 - p0
    zeros = np.zeros_like(p0)
    if order == 1:
        rows = [p0, distance / t, zeros, zeros, zeros, zeros]
    elif order == 3:
        rows = [
            p0,
            v0,
            (3.0 * distance - t * (2.0 * v0 + v1)) / t**2,
            (t * (v0 + v1) - 2.0 * distance) / t**3,
            zeros,
            zeros,
        ]
    else:
        rows = [
            p0,
            v0,
            0.5 * a0,
            (20.0 * distance - t * (8.0 * v1 + 12.0 * v0) - t**2 * (3.0 * a0 - a1)) / (2.0 * t**3),
            (-30.0 * distance + t * (14.0 * v1 + 16.0 * v0) + t**2 * (3.0 * a0 - 2.0 * a1)) / (2.0 * t**4),
            (12.0 * distance - 6.0 * t * (v0 + v1) + t**2 * (a1 - a0)) / (2.0 * t**5),
        ]
    return np.stack(rows, axis=-2)


def chunks(count: int) -> Iterator[slice]:
    """Yields slices of `count` items and pauses between them.

    A slice is small enough for one NumPy call, during which the control loop cannot get the interpreter. The pauses are
    for threads with real-time priority: Linux throttles them for 50 ms if they occupy a processor for 0.95 s.
    """
    start_s = time.monotonic()
    for begin in range(0, count, CHUNK_SIZE):
        if begin > 0:
            time.sleep(PAUSE_S + PAUSE_FRACTION * (time.monotonic() - start_s))
            start_s = time.monotonic()
        yield slice(begin, min(begin + CHUNK_SIZE, count))


class Spline:
    """A validated trajectory with the coefficients of all segments.

    Args:
        trajectory: Trajectory with at least one point that passed `check_points`.

    Attributes:
        times_s: Time of each point from the start, shape (points,).
        states: Positions, velocities and accelerations of each point, 0 if missing; shape (points, 3, joints).
        orders: Maximum polynomial order at each point, 1, 3 or 5; shape (points,).
        coefficients: Coefficients of the segment from point i to point i + 1, shape (points - 1, 6, joints).
    """

    __slots__ = ("times_s", "states", "orders", "coefficients")

    def __init__(self, trajectory: JointTrajectory) -> None:
        points = trajectory.points
        self.times_s = points.times_s
        self.states = points.values
        self.orders = np.where(points.counts[:, VELOCITY] == 0, 1, np.where(points.counts[:, ACCELERATION] == 0, 3, 5))
        self.coefficients = np.empty((len(points) - 1, 6, len(trajectory.joint_names)))
        for chunk in chunks(len(points) - 1):
            self._compute_segments(chunk, slice(chunk.start + 1, chunk.stop + 1))

    def _compute_segments(self, starts: slice, ends: slice) -> None:
        """Computes the coefficients of the segments between these points."""
        orders = np.minimum(self.orders[starts], self.orders[ends])
        durations_s = (self.times_s[ends] - self.times_s[starts])[:, np.newaxis]
        for order in (1, 3, 5):
            mask = orders == order
            self.coefficients[starts][mask] = segment_coefficients(
                self.states[starts][mask], self.states[ends][mask], durations_s[mask], order
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """The motion of some joints of a controller: consecutive segments, then rest at the last position.

    Tracks are created in the control loop and therefore only reference a trajectory, which may be very long.

    Attributes:
        joints: Indices of the joints in the controller.
        start_s: Start of the first segment [s of the controller's time].
        ends_s: End of each segment [s after origin_s], shape (segments,).
        first: Coefficients of the first segment, shape (6, columns).
        others: Coefficients of the other segments, shape (segments - 1, 6, columns).
        end_position: Final position, shape (columns,).
        origin_s: Time at which time_from_start is 0.
        offset: Offset of the positions of `others`, shape (columns,).
        columns: Columns of `joints` in the arrays; None for all columns.
        end_s: End of the last segment.
    """

    joints: list[int]
    start_s: float
    ends_s: Array
    first: Array
    others: Array
    end_position: Array
    origin_s: float
    offset: Array | float = 0.0
    columns: list[int] | None = None
    end_s: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "end_s", self.origin_s + float(self.ends_s[-1]))

    @classmethod
    def hold(cls, joints: Sequence[int], position: Array, time_s: float) -> Track:
        """Returns a track that rests at a position.

        Args:
            joints: Indices of the joints in the controller.
            position: Position, shape (joints,) [rad|m].
            time_s: Start time.
        """
        at_rest = np.zeros((6, len(joints)))
        at_rest[POSITION] = position
        return cls.one_segment(joints, time_s, time_s, at_rest, at_rest[POSITION])

    @classmethod
    def one_segment(
        cls, joints: Sequence[int], start_s: float, end_s: float, coefficients: Array, end_position: Array
    ) -> Track:
        """Returns a track with one segment.

        Args:
            joints: Indices of the joints in the controller.
            start_s: Start time.
            end_s: End time.
            coefficients: Polynomial coefficients, shape (6, joints).
            end_position: Final position, shape (joints,) [rad|m].
        """
        return cls(
            joints=list(joints),
            start_s=start_s,
            ends_s=np.array([end_s - start_s]),
            first=coefficients,
            others=coefficients[:0],
            end_position=end_position,
            origin_s=start_s,
        )

    def sample(self, time_s: float) -> Array:
        """Returns position, velocity and acceleration at `time_s`, shape (3, joints)."""
        if time_s > self.end_s:
            state = np.zeros((3, len(self.end_position)))
            state[POSITION] = self.end_position
        else:
            i = min(bisect_right(self.ends_s, time_s - self.origin_s), len(self.ends_s) - 1)
            t = max(0.0, time_s - (self.origin_s + float(self.ends_s[i - 1]) if i > 0 else self.start_s))
            t2 = t * t
            t3 = t2 * t
            basis = (
                (1.0, t, t2, t3, t2 * t2, t2 * t3),
                (0.0, 1.0, 2.0 * t, 3.0 * t2, 4.0 * t3, 5.0 * t2 * t2),
                (0.0, 0.0, 2.0, 6.0 * t, 12.0 * t2, 20.0 * t3),
            )
            state = np.dot(basis, self.first if i == 0 else self.others[i - 1])
            if i > 0:
                state[POSITION] += self.offset
        return state if self.columns is None else state[:, self.columns]

    def without(self, joints: Sequence[int]) -> Track | None:
        """Returns the track without the given joints; None if no joint remains."""
        remaining = [i for i, joint in enumerate(self.joints) if joint not in joints]
        columns = remaining if self.columns is None else [self.columns[i] for i in remaining]
        return replace(self, joints=[self.joints[i] for i in remaining], columns=columns) if remaining else None


def splice(
    spline: Spline, joints: Sequence[int], *, origin_s: float, splice_s: float, state: Array, continuous: Sequence[bool]
) -> Track:
    """Joins a new trajectory to the current motion.

    The track starts at `state` and leads to the first point after `splice_s` with a segment of this point's order. If a
    point at `splice_s` agrees with `state` in position and velocity, the trajectory's own segment is used instead.

    Args:
        spline: New trajectory, which ends at least MIN_SEGMENT_S after `splice_s`.
        joints: Indices of the trajectory's joints in the controller.
        origin_s: Time at which time_from_start is 0.
        splice_s: Time of the transition to the new trajectory.
        state: Desired state of the joints at `splice_s`, shape (3, joints).
        continuous: Whether each joint is continuous; continuous joints take the shorter direction.
    """
    first = int(np.searchsorted(spline.times_s, splice_s - origin_s, side="right"))
    offset = np.where(continuous, _whole_turns(state[POSITION], spline.states[first, POSITION]), 0.0)
    ends_s = spline.times_s[first:]
    if first > 0 and _is_consistent(spline, first - 1, splice_s - origin_s, state, offset):
        bridge = spline.coefficients[first - 1].copy()
        bridge[POSITION] += offset
    else:
        target = spline.states[first].copy()
        target[POSITION] += offset
        bridge = segment_coefficients(state, target, origin_s + float(ends_s[0]) - splice_s, int(spline.orders[first]))
    end_position = spline.states[-1, POSITION] + offset
    return Track(
        joints=list(joints),
        start_s=splice_s,
        ends_s=ends_s,
        first=bridge,
        others=spline.coefficients[first:],
        end_position=end_position,
        origin_s=origin_s,
        offset=offset,
    )


def _whole_turns(position: Array, target: Array) -> Array:
    """Returns the multiple of 2 pi that brings `target` nearest to `position`; a difference of pi keeps its sign.

    Both arrays have shape (joints,) [rad].
    """
    turns = (position - target) / (2.0 * math.pi)
    full_turns = np.where(np.abs(np.abs(turns) % 1.0 - 0.5) < 1e-9, np.trunc(turns), np.round(turns))
    return full_turns * (2.0 * math.pi)


def _is_consistent(spline: Spline, point: int, time_s: float, state: Array, offset: Array) -> bool:
    """Returns whether `state` at `time_s` is the start of the trajectory's own segment from `point`."""
    tolerance = 1e-6
    if abs(spline.times_s[point] - time_s) > 1e-9:
        return False
    velocity = spline.states[point, VELOCITY]
    return bool(
        np.all(np.abs(spline.states[point, POSITION] + offset - state[POSITION]) < tolerance)
        and np.all(np.abs(velocity - state[VELOCITY]) < tolerance)
    )
