# SPDX-License-Identifier: BSD-3-Clause
"""Check of a trajectory against the position and velocity limits of its joints, at and between its points.

Segments are sampled between points. Slightly excessive velocities are accepted, because the hardware enforces its
limits and the joint only arrives a little late.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from modular_framework_control.hardware_interface.joint_limit_parameters import GOAL_TOLERANCE, JointLimits
from modular_framework_control.trajectory.joint_trajectory import POSITION, VELOCITY, Array, Spline, Track, chunks

MAX_VELOCITY_FACTOR = 1.05
"""Maximum velocity as a multiple of the limit; time parameterizations overshoot by this factor between points."""
CURVE_MARGIN = 1e-2
"""Tolerance for positions between points beyond a limit, and for the lag of a joint in the first segment [rad|m]."""
_MAX_FAULTS = 8
_ZERO_LIMIT = "this limit forbids any motion: correct it in robot_description or joint_limits"

# At Chebyshev nodes, the maximum sample is at most 2 % (velocity) below the maximum of a quintic segment.
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
    """Limits of joints; infinite if unknown.

    Attributes:
        min_positions: Minimum positions, shape (joints,) [rad|m].
        max_positions: Maximum positions, shape (joints,) [rad|m].
        max_velocities: Maximum velocities, shape (joints,) [rad/s|m/s].
        max_decelerations: Maximum decelerations, shape (joints,) [rad/s^2|m/s^2].
    """

    min_positions: Array
    max_positions: Array
    max_velocities: Array
    max_decelerations: Array

    @classmethod
    def of(cls, limits: Sequence[JointLimits]) -> MotionLimits:
        """Returns the limits of joints as arrays."""
        return cls(
            np.array([limit.min_position for limit in limits]),
            np.array([limit.max_position for limit in limits]),
            np.array([limit.max_velocity for limit in limits]),
            np.array([limit.max_acceleration for limit in limits]),
        )

    def of_joints(self, joints: Sequence[int]) -> MotionLimits:
        """Returns the limits of the joints with these indices."""
        chosen = list(joints)
        return MotionLimits(
            self.min_positions[chosen],
            self.max_positions[chosen],
            self.max_velocities[chosen],
            self.max_decelerations[chosen],
        )

    def with_positions(self, positions: Array) -> MotionLimits:
        """Returns the limits widened to include positions, shape (joints,), so that joints outside may move back."""
        return MotionLimits(
            np.fmin(self.min_positions, positions),
            np.fmax(self.max_positions, positions),
            self.max_velocities,
            self.max_decelerations,
        )


class LimitViolations:
    """All limit violations of a trajectory.

    Args:
        names: Joints of the trajectory.
        limits: Limits of these joints.
        measured: Measured positions of these joints, shape (joints,) [rad|m].
    """

    def __init__(self, names: Sequence[str], limits: MotionLimits, measured: Array) -> None:
        self._names = tuple(names)
        self._limits = limits
        self._measured = measured
        self._found: list[tuple[_Kind, NDArray[np.int64], Array]] = []  # each with points in ascending order

    def add(self, kind: _Kind, values: Array, beyond: NDArray[np.bool_], first_point: int) -> None:
        """Adds violations.

        Args:
            kind: Kind of the violations.
            values: Values at consecutive points, shape (points, joints).
            beyond: Whether each value violates a limit, shape (points, joints).
            first_point: Index of the point of the first row.
        """
        if beyond.any():
            indices: NDArray[np.int64] = np.argwhere(beyond) + (first_point, 0)
            self._found.append((kind, indices, values[beyond]))

    def merge(self) -> None:
        """Joins the violations of each kind, so that the control loop can compute the text quickly."""
        kinds = {kind: [(indices, values) for other, indices, values in self._found if other is kind] for kind in _Kind}
        self._found = [
            (kind, np.concatenate([indices for indices, _ in found]), np.concatenate([values for _, values in found]))
            for kind, found in kinds.items()
            if found
        ]

    def text(self, first: int = 0, first_segment: int = 1) -> str:
        """Returns a description of the first few violations, or "".

        Args:
            first: Index of the first point that counts.
            first_segment: Index of the end point of the first segment that counts.
        """
        described: list[str] = []
        count = 0
        for kind, indices, values in self._found:
            begin = first if kind in (_Kind.POINT_POSITION, _Kind.POINT_VELOCITY) else first_segment
            skipped = bisect_left(indices[:, 0], begin)
            count += len(indices) - skipped
            described += [
                self._describe_violation(kind, int(indices[i, 0]), int(indices[i, 1]), float(values[i]))
                for i in range(skipped, min(len(indices), skipped + _MAX_FAULTS - len(described)))
            ]
        omitted = count - len(described)
        return "; ".join(described) + (f"; and {omitted} more" if omitted else "")

    def _describe_violation(self, kind: _Kind, point: int, joint: int, value: float) -> str:
        name, allowed, max_velocities = self._names[joint], self._range(joint), self._limits.max_velocities[joint]
        match kind:
            case _Kind.POINT_POSITION:
                return (
                    f"point {point}: position of joint '{name}' is {value:.6g}; {allowed}; give a position within the "
                    "limits"
                )
            case _Kind.POINT_VELOCITY:
                return (
                    f"point {point}: velocity of joint '{name}' is {value:.6g}; its limit is {max_velocities:.6g}; "
                    + ("give a lower velocity" if max_velocities > 0.0 else _ZERO_LIMIT)
                )
            case _Kind.CURVE_POSITION:
                return (
                    f"on the way to point {point}, joint '{name}' reaches {value:.6g}; {allowed}; change the "
                    "velocities of the points, or add points between them"
                )
            case _Kind.CURVE_VELOCITY:
                return (
                    f"on the way to point {point}, joint '{name}' reaches the velocity {value:.6g}; its limit is "
                    f"{max_velocities:.6g}; "
                    + ("give the point a later time_from_start" if max_velocities > 0.0 else _ZERO_LIMIT)
                )

    def _range(self, joint: int) -> str:
        min_positions, max_positions, measured = (
            self._limits.min_positions[joint],
            self._limits.max_positions[joint],
            self._measured[joint],
        )
        outside = (
            f" (the joint is outside, at {measured:.6g})" if not min_positions <= measured <= max_positions else ""
        )
        return f"its limits are {min_positions:.6g} to {max_positions:.6g}{outside}"


def limit_violations(spline: Spline, names: Sequence[str], limits: MotionLimits, measured: Array) -> LimitViolations:
    """Finds the limit violations of a trajectory, at and between its points.

    Args:
        spline: Trajectory.
        names: Joints of the trajectory.
        limits: Limits of these joints.
        measured: Measured positions, shape (joints,) [rad|m]; a joint outside its range may move back.
    """
    violations = LimitViolations(names, limits, measured)
    limits = limits.with_positions(measured)
    for chunk in chunks(len(spline.times_s)):
        positions, velocities = spline.states[chunk, POSITION], spline.states[chunk, VELOCITY]
        beyond = (positions < limits.min_positions - GOAL_TOLERANCE) | (
            positions > limits.max_positions + GOAL_TOLERANCE
        )
        violations.add(_Kind.POINT_POSITION, positions, beyond, chunk.start)
        violations.add(
            _Kind.POINT_VELOCITY,
            velocities,
            np.abs(velocities) > MAX_VELOCITY_FACTOR * limits.max_velocities,
            chunk.start,
        )
    if (
        np.isfinite(limits.max_velocities).any()
        or np.isfinite(limits.min_positions).any()
        or np.isfinite(limits.max_positions).any()
    ):
        durations_s = np.diff(spline.times_s)
        for chunk in chunks(len(durations_s)):
            extremes = _SegmentExtremes(spline.coefficients[chunk], durations_s[chunk])
            too_fast = np.abs(extremes.velocities) > MAX_VELOCITY_FACTOR * limits.max_velocities
            violations.add(_Kind.CURVE_VELOCITY, extremes.velocities, too_fast, chunk.start + 1)
            _add_positions(violations, extremes, limits, chunk.start + 1)
    violations.merge()
    return violations


def first_segment_violations(
    track: Track, names: Sequence[str], limits: MotionLimits, measured: Array, point: int
) -> str:
    """Returns a description of the violations in the segment from the current motion to the first point, or "".

    Args:
        track: New motion, joined to the current motion.
        names: Joints of the motion.
        limits: Limits of these joints.
        measured: Measured positions, shape (joints,) [rad|m].
        point: Index of the first point.
    """
    violations = LimitViolations(names, limits, measured)
    limits = limits.with_positions(measured)
    duration_s = track.origin_s + float(track.ends_s[0]) - track.start_s
    extremes = _SegmentExtremes(track.first[np.newaxis], np.array([duration_s]))
    speeds = np.abs(extremes.velocities)
    late = (speeds - limits.max_velocities) * duration_s > CURVE_MARGIN
    violations.add(
        _Kind.CURVE_VELOCITY, extremes.velocities, late & (speeds > MAX_VELOCITY_FACTOR * limits.max_velocities), point
    )
    _add_positions(violations, extremes, limits, point)
    return violations.text(point, point)


def _add_positions(
    violations: LimitViolations, extremes: _SegmentExtremes, limits: MotionLimits, first_point: int
) -> None:
    violations.add(
        _Kind.CURVE_POSITION,
        extremes.min_positions,
        extremes.overshoots & (extremes.min_positions < limits.min_positions - CURVE_MARGIN),
        first_point,
    )
    violations.add(
        _Kind.CURVE_POSITION,
        extremes.max_positions,
        extremes.overshoots & (extremes.max_positions > limits.max_positions + CURVE_MARGIN),
        first_point,
    )


class _SegmentExtremes:
    """Extreme positions and velocities in polynomial segments.

    Args:
        coefficients: Polynomial coefficients, shape (segments, 6, joints).
        durations_s: Durations of the segments, shape (segments,).

    Attributes:
        min_positions, max_positions: Extreme positions, shape (segments, joints).
        overshoots: Whether an extreme position lies beyond both ends of the segment, shape (segments, joints).
        velocities: Velocities of maximum magnitude, shape (segments, joints).
    """

    def __init__(self, coefficients: Array, durations_s: Array) -> None:
        scaled = coefficients * durations_s[:, np.newaxis, np.newaxis] ** np.arange(6)[:, np.newaxis]
        scaled = np.ascontiguousarray(scaled.transpose(2, 1, 0))  # one matrix product per joint
        positions = _POSITION_BASIS @ scaled
        self.min_positions: Array = positions.min(axis=1).T
        self.max_positions: Array = positions.max(axis=1).T
        begin, end = positions[:, 0].T, positions[:, -1].T
        self.overshoots = (self.min_positions < np.minimum(begin, end)) | (self.max_positions > np.maximum(begin, end))
        velocities = _VELOCITY_BASIS @ scaled
        upper, lower = velocities.max(axis=1).T, velocities.min(axis=1).T
        self.velocities: Array = np.where(upper > -lower, upper, lower) / durations_s[:, np.newaxis]
