# SPDX-License-Identifier: BSD-3-Clause
"""Joint trajectories and the piecewise polynomials that connect their points.

Between two points the curve is linear, cubic or quintic, by what both of them give: positions; positions and
velocities; positions, velocities and accelerations. The coefficients follow from the boundary conditions of each
segment.
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
SHORTEST_SEGMENT_S = 1e-6
ITEMS_AT_ONCE = 256
PAUSE_S = 1e-4
PAUSE_SHARE = 1.0


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


@dataclass(frozen=True, slots=True, eq=False)
class TrajectoryPoints:
    """The points of a trajectory as they were sent, not checked.

    Attributes:
        times_s: time of each point from the start of the trajectory [s], shape (points,).
        values: positions, velocities and accelerations of each point, 0 where none were sent, shape
            (points, 3, joints); values beyond the number of joint names are left out, and all values if points lack
            positions for certain.
        counts: numbers of positions, velocities and accelerations that were sent, shape (points, 3).
    """

    times_s: Array
    values: Array
    counts: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.times_s)


@dataclass(frozen=True, slots=True)
class JointTrajectory:
    """A trajectory as it was sent.

    Attributes:
        joint_names: the joints, in the order of the values of each point.
        points: in the order of time; none means "stop".
        stamp_s: when it starts [s of the controller's time]; 0 means at once.
    """

    joint_names: tuple[str, ...]
    points: TrajectoryPoints
    stamp_s: float = 0.0

    @classmethod
    def of_points(
        cls, joint_names: tuple[str, ...], points: Sequence[TrajectoryPoint], stamp_s: float = 0.0
    ) -> JointTrajectory:
        """A trajectory of few points, given one by one."""
        rows = [(point.positions, point.velocities, point.accelerations) for point in points]
        values = np.zeros((len(points), 3, len(joint_names)))
        for i, row in enumerate(rows):
            for kind, sent in enumerate(row):
                kept = sent[: len(joint_names)]
                values[i, kind, : len(kept)] = kept
        times_s = np.array([point.time_s for point in points], float)
        counts = np.array([[len(sent) for sent in row] for row in rows], np.int32).reshape(-1, 3)
        return cls(joint_names, TrajectoryPoints(times_s, values, counts), stamp_s)


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


def parts(count: int) -> Iterator[slice]:
    """Divides `count` items among slices, with a pause between two.

    A slice is short enough for one call of NumPy, in which the control loop cannot have the interpreter. A thread with
    real-time priority must pause: Linux stops real-time threads for 50 ms if they use a processor up for 0.95 s.
    """
    begun_s = time.monotonic()
    for begin in range(0, count, ITEMS_AT_ONCE):
        if begin > 0:
            time.sleep(PAUSE_S + PAUSE_SHARE * (time.monotonic() - begun_s))
            begun_s = time.monotonic()
        yield slice(begin, min(begin + ITEMS_AT_ONCE, count))


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
        self.times_s = points.times_s
        self.states = points.values
        self.orders = np.where(points.counts[:, VELOCITY] == 0, 1, np.where(points.counts[:, ACCELERATION] == 0, 3, 5))
        self.coefficients = np.empty((len(points) - 1, 6, len(trajectory.joint_names)))
        for part in parts(len(points) - 1):
            self._compute_segments(part, slice(part.start + 1, part.stop + 1))

    def _compute_segments(self, starts: slice, ends: slice) -> None:
        """Computes the coefficients of the segments between these points."""
        orders = np.minimum(self.orders[starts], self.orders[ends])
        durations_s = (self.times_s[ends] - self.times_s[starts])[:, np.newaxis]
        for order in (1, 3, 5):
            chosen = orders == order
            self.coefficients[starts][chosen] = segment_coefficients(
                self.states[starts][chosen], self.states[ends][chosen], durations_s[chosen], order
            )


@dataclass(frozen=True, slots=True)
class Track:
    """The motion of some joints of a controller: consecutive segments, then rest at the last position.

    The control loop makes tracks. So they copy nothing of a trajectory, which may be very long.

    Attributes:
        joints: indices of the joints in the controller.
        start_s: start of the first segment [s of the controller's time].
        ends_s: end of each segment [s after origin_s], shape (segments,).
        first: coefficients of the first segment, shape (6, columns).
        others: coefficients of the other segments, shape (segments - 1, 6, columns).
        end_position: where it ends, shape (columns,).
        origin_s: time of its time_from_start 0 [s].
        offset: added to the positions of `others`, shape (columns,).
        columns: those of `joints` in the arrays; None for all.
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
        """Rest at `position`, shape (joints,), from `time_s` on."""
        at_rest = np.zeros((6, len(joints)))
        at_rest[POSITION] = position
        return cls.one_segment(joints, time_s, time_s, at_rest, at_rest[POSITION])

    @classmethod
    def one_segment(
        cls, joints: Sequence[int], start_s: float, end_s: float, coefficients: Array, end_position: Array
    ) -> Track:
        """One segment with coefficients of shape (6, joints), from `start_s` to `end_s` [s]."""
        return cls(
            list(joints), start_s, np.array([end_s - start_s]), coefficients, coefficients[:0], end_position, start_s
        )

    def sample(self, time_s: float) -> Array:
        """Position, velocity and acceleration at `time_s`, shape (3, joints)."""
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
        """This track for its other joints; None when none is left."""
        kept = [i for i, joint in enumerate(self.joints) if joint not in joints]
        columns = kept if self.columns is None else [self.columns[i] for i in kept]
        return replace(self, joints=[self.joints[i] for i in kept], columns=columns) if kept else None


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
    ends_s = spline.times_s[first:]
    if first > 0 and _agrees(spline, first - 1, splice_s - origin_s, state, offset):
        bridge = spline.coefficients[first - 1].copy()
        bridge[POSITION] += offset
    else:
        target = spline.states[first].copy()
        target[POSITION] += offset
        bridge = segment_coefficients(state, target, origin_s + float(ends_s[0]) - splice_s, int(spline.orders[first]))
    end_position = spline.states[-1, POSITION] + offset
    return Track(list(joints), splice_s, ends_s, bridge, spline.coefficients[first:], end_position, origin_s, offset)


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
