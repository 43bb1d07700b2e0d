# SPDX-License-Identifier: BSD-3-Clause
"""Checks a trajectory against the limits of its joints: positions and velocities, at its points and between them.

Between points the curve is sampled. A motion that is slightly too fast is accepted: the hardware enforces its limits,
and the joint arrives a little late.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from modular_framework_control.hardware_interface.joint_limit_parameters import POINT_MARGIN, JointLimits
from modular_framework_control.trajectory.joint_trajectory import POSITION, VELOCITY, Array, Spline, Track, parts

VELOCITY_SHARE = 1.05
"""Largest velocity as a multiple of the limit: time parameterisations overshoot by that much between their points."""
CURVE_MARGIN = 1e-2
"""How far the curve between points may go beyond a position limit, and how far a joint may lag behind in the first
segment [rad|m]."""
_MOST_FAULTS = 8
_NO_SPEED = "with it the joint may not move at all: correct it in robot_description or joint_limits"

# Chebyshev nodes, whose largest sample is at most 2 % (velocity) below the largest value of a quintic segment.
_NODES = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 33))
_POSITION_BASIS = _NODES[:, np.newaxis] ** np.arange(6)
_VELOCITY_BASIS = np.arange(6) * _NODES[:, np.newaxis] ** np.maximum(np.arange(6) - 1, 0)


class _Kind(Enum):
    POINT_POSITION = auto()
    POINT_VELOCITY = auto()
    CURVE_POSITION = auto()
    CURVE_VELOCITY = auto()


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of some joints; infinite where none is known.

    Attributes:
        lowest: smallest positions [rad|m], shape (joints,).
        highest: largest positions [rad|m], shape (joints,).
        fastest: largest velocities [rad/s|m/s], shape (joints,).
        braking: largest decelerations [rad/s^2|m/s^2], shape (joints,).
    """

    lowest: Array
    highest: Array
    fastest: Array
    braking: Array

    @classmethod
    def of(cls, limits: Sequence[JointLimits]) -> MotionLimits:
        """The limits of joints, in their order."""
        return cls(
            np.array([limit.min_position for limit in limits]),
            np.array([limit.max_position for limit in limits]),
            np.array([limit.max_velocity for limit in limits]),
            np.array([limit.max_acceleration for limit in limits]),
        )

    def of_joints(self, joints: Sequence[int]) -> MotionLimits:
        """Those of some of the joints, by index."""
        chosen = list(joints)
        return MotionLimits(self.lowest[chosen], self.highest[chosen], self.fastest[chosen], self.braking[chosen])

    def with_positions(self, positions: Array) -> MotionLimits:
        """Returns the limits widened to these positions, shape (joints,), so that a joint outside may move back."""
        return MotionLimits(
            np.fmin(self.lowest, positions), np.fmax(self.highest, positions), self.fastest, self.braking
        )


class LimitViolations:
    """All violations of limits by a trajectory. Points that are left out, and the segments before them, do not count.

    Args:
        names: the joints of the trajectory.
        limits: their limits.
        measured: positions of the joints [rad|m], shape (joints,).
    """

    def __init__(self, names: Sequence[str], limits: MotionLimits, measured: Array) -> None:
        self._names = tuple(names)
        self._limits = limits
        self._measured = measured
        self._found: list[tuple[_Kind, NDArray[np.int64], Array]] = []  # in each, points in ascending order

    def add(self, kind: _Kind, values: Array, beyond: NDArray[np.bool_], first_point: int) -> None:
        """Adds the values, shape (points, joints), where `beyond` is true; the first row belongs to `first_point`."""
        if beyond.any():
            indices: NDArray[np.int64] = np.argwhere(beyond) + (first_point, 0)
            self._found.append((kind, indices, values[beyond]))

    def merge(self) -> None:
        """Joins the violations of each kind: the control loop, which asks for the text, has no time for many parts."""
        kinds = {kind: [(indices, values) for other, indices, values in self._found if other is kind] for kind in _Kind}
        self._found = [
            (kind, np.concatenate([indices for indices, _ in found]), np.concatenate([values for _, values in found]))
            for kind, found in kinds.items()
            if found
        ]

    def text(self, first: int = 0, first_segment: int = 1) -> str:
        """Describes the violations in one text, of very many only the first few; "" if there are none.

        Args:
            first: the first point that counts.
            first_segment: the first point whose segment before it counts.
        """
        described: list[str] = []
        count = 0
        for kind, indices, values in self._found:
            begin = first if kind in (_Kind.POINT_POSITION, _Kind.POINT_VELOCITY) else first_segment
            skipped = bisect_left(indices[:, 0], begin)
            count += len(indices) - skipped
            described += [
                self._described(kind, int(indices[i, 0]), int(indices[i, 1]), float(values[i]))
                for i in range(skipped, min(len(indices), skipped + _MOST_FAULTS - len(described)))
            ]
        more = count - len(described)
        return "; ".join(described) + (f"; and {more} more" if more else "")

    def _described(self, kind: _Kind, point: int, joint: int, value: float) -> str:
        name, allowed, fastest = self._names[joint], self._range(joint), self._limits.fastest[joint]
        match kind:
            case _Kind.POINT_POSITION:
                return (
                    f"point {point}: position of joint '{name}' is {value:.6g}; {allowed}; give a position within them"
                )
            case _Kind.POINT_VELOCITY:
                return f"point {point}: velocity of joint '{name}' is {value:.6g}; its limit is {fastest:.6g}; " + (
                    "give a lower velocity" if fastest > 0.0 else _NO_SPEED
                )
            case _Kind.CURVE_POSITION:
                return (
                    f"on the way to point {point} joint '{name}' comes to {value:.6g}; {allowed}; give the points "
                    " other velocities, or points in between"
                )
            case _Kind.CURVE_VELOCITY:
                return (
                    f"on the way to point {point} joint '{name}' reaches the velocity {value:.6g}; its limit is "
                    f"{fastest:.6g}; " + ("give the point a later time_from_start" if fastest > 0.0 else _NO_SPEED)
                )

    def _range(self, joint: int) -> str:
        lowest, highest, measured = self._limits.lowest[joint], self._limits.highest[joint], self._measured[joint]
        outside = f" (it stands outside, at {measured:.6g})" if not lowest <= measured <= highest else ""
        return f"its limits are {lowest:.6g} to {highest:.6g}{outside}"


def limit_violations(spline: Spline, names: Sequence[str], limits: MotionLimits, measured: Array) -> LimitViolations:
    """Finds the violations of limits by a trajectory, at its points and between them.

    Args:
        spline: the trajectory.
        names: its joints.
        limits: their limits.
        measured: positions of the joints [rad|m], shape (joints,); a joint outside its range may come back.
    """
    found = LimitViolations(names, limits, measured)
    limits = limits.with_positions(measured)
    for part in parts(len(spline.times_s)):
        positions, velocities = spline.states[part, POSITION], spline.states[part, VELOCITY]
        beyond = (positions < limits.lowest - POINT_MARGIN) | (positions > limits.highest + POINT_MARGIN)
        found.add(_Kind.POINT_POSITION, positions, beyond, part.start)
        found.add(_Kind.POINT_VELOCITY, velocities, np.abs(velocities) > VELOCITY_SHARE * limits.fastest, part.start)
    if np.isfinite(limits.fastest).any() or np.isfinite(limits.lowest).any() or np.isfinite(limits.highest).any():
        durations_s = np.diff(spline.times_s)
        for part in parts(len(durations_s)):
            ways = _SegmentExtremes(spline.coefficients[part], durations_s[part])
            too_fast = np.abs(ways.velocities) > VELOCITY_SHARE * limits.fastest
            found.add(_Kind.CURVE_VELOCITY, ways.velocities, too_fast, part.start + 1)
            _add_positions(found, ways, limits, part.start + 1)
    found.merge()
    return found


def first_segment_violations(
    track: Track, names: Sequence[str], limits: MotionLimits, measured: Array, point: int
) -> str:
    """Describes the violations in the segment from the present motion to the first point; "" if there are none.

    Args:
        track: the new motion, joined to the present one.
        names: its joints.
        limits: their limits.
        measured: positions of the joints [rad|m], shape (joints,).
        point: number of that point.
    """
    found = LimitViolations(names, limits, measured)
    limits = limits.with_positions(measured)
    duration_s = track.origin_s + float(track.ends_s[0]) - track.start_s
    ways = _SegmentExtremes(track.first[np.newaxis], np.array([duration_s]))
    speeds = np.abs(ways.velocities)
    late = (speeds - limits.fastest) * duration_s > CURVE_MARGIN
    found.add(_Kind.CURVE_VELOCITY, ways.velocities, late & (speeds > VELOCITY_SHARE * limits.fastest), point)
    _add_positions(found, ways, limits, point)
    return found.text(point, point)


def _add_positions(found: LimitViolations, ways: _SegmentExtremes, limits: MotionLimits, first_point: int) -> None:
    found.add(
        _Kind.CURVE_POSITION, ways.lowest, ways.overshoots & (ways.lowest < limits.lowest - CURVE_MARGIN), first_point
    )
    found.add(
        _Kind.CURVE_POSITION,
        ways.highest,
        ways.overshoots & (ways.highest > limits.highest + CURVE_MARGIN),
        first_point,
    )


class _SegmentExtremes:
    """Extremes of positions and velocities in polynomial segments.

    Args:
        coefficients: of shape (segments, 6, joints).
        durations_s: of the segments [s], shape (segments,).

    Attributes:
        lowest, highest: positions, shape (segments, joints).
        overshoots: whether one of them lies beyond both ends of the segment, shape (segments, joints).
        velocities: those largest in size, shape (segments, joints).
    """

    def __init__(self, coefficients: Array, durations_s: Array) -> None:
        scaled = coefficients * durations_s[:, np.newaxis, np.newaxis] ** np.arange(6)[:, np.newaxis]
        scaled = np.ascontiguousarray(scaled.transpose(2, 1, 0))  # one product a joint
        positions = _POSITION_BASIS @ scaled
        self.lowest: Array = positions.min(axis=1).T
        self.highest: Array = positions.max(axis=1).T
        begin, end = positions[:, 0].T, positions[:, -1].T
        self.overshoots = (self.lowest < np.minimum(begin, end)) | (self.highest > np.maximum(begin, end))
        velocities = _VELOCITY_BASIS @ scaled
        upper, lower = velocities.max(axis=1).T, velocities.min(axis=1).T
        self.velocities: Array = np.where(upper > -lower, upper, lower) / durations_s[:, np.newaxis]
