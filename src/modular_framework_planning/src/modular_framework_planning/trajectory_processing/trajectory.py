# SPDX-License-Identifier: BSD-3-Clause
"""Joint trajectory of a group, and the curve that a controller interpolates between its points.

A JointTrajectoryController connects points with positions, velocities and accelerations by quintic polynomials. The
robot satisfies limits only if this curve does, not just its points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_curves import (
    bent_segments,
    curve_samples,
    curve_values,
    quintic_coefficients,
)

SAMPLE_PERIOD_S = 0.001  # typical period of a controller
STRAIGHT_TOLERANCE = 1.0e-5  # maximum distance of a straight curve from its chord [rad or m]


class CurveValues(NamedTuple):
    """Values of a curve at m times, each of shape (m, joints)."""

    positions: Array
    velocities: Array
    accelerations: Array
    jerks: Array


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A joint trajectory.

    Attributes:
        joint_names: Joint names, in the order of the columns.
        times: Strictly increasing times from 0, shape (n,) [s].
        positions, velocities, accelerations: Values at the times, shape (n, joints) [rad or m, per s, per s^2].
    """

    joint_names: tuple[str, ...]
    times: Array
    positions: Array
    velocities: Array
    accelerations: Array

    @property
    def duration_s(self) -> float:
        """Duration of the trajectory [s]."""
        return float(self.times[-1])

    @cached_property
    def coefficients(self) -> Array:
        """Coefficients of the polynomials between points, lowest power first, shape (n - 1, 6, joints)."""
        rows = (self.times, self.positions, self.velocities, self.accelerations)
        return quintic_coefficients(*(np.ascontiguousarray(item, dtype=float) for item in rows))

    def sample(self, times: Array) -> CurveValues:
        """Returns the values of the curve at times [s]."""
        if len(self.times) < 2:
            still = np.zeros((len(times), self.positions.shape[1]))
            return CurveValues(still + self.positions[0], still, still, still)
        return CurveValues(*self._values(times, 4))

    def positions_at(self, times: Array) -> Array:
        """Returns positions of the curve at times [s], shape (m, joints); needs at least two points."""
        return np.asarray(self._values(times, 1)[0])

    def _values(self, times: Array, orders: int) -> Array:
        sample_times = np.ascontiguousarray(times, dtype=float)
        return curve_values(np.ascontiguousarray(self.times, dtype=float), self.coefficients, sample_times, orders)

    def sample_times(self, period_s: float = SAMPLE_PERIOD_S) -> Array:
        """Returns uniform times from start to end, inclusive, with a spacing of at most `period_s`."""
        return np.linspace(0.0, self.duration_s, int(np.ceil(self.duration_s / period_s)) + 1)

    def curve(self, step: float) -> Array:
        """Samples positions along the curve, with joint steps of about `step` at most [rad or m]."""
        if len(self.times) < 2:
            return self.positions
        times, positions, velocities = (
            np.ascontiguousarray(item, dtype=float) for item in (self.times, self.positions, self.velocities)
        )
        return curve_samples(times, self.coefficients, positions, velocities, step)

    def chords(self, first: int = 0) -> list[Array]:
        """Returns the polylines through points, from index `first`, where the curve differs from the straight line.

        A controller that ignores velocities follows these polylines instead of the curve.
        """
        if len(self.times) < 2:
            return []
        times, positions = (np.ascontiguousarray(item, dtype=float) for item in (self.times, self.positions))
        is_bent = bent_segments(times, self.coefficients, positions, STRAIGHT_TOLERANCE)
        bent = first + np.flatnonzero(is_bent[first:])
        runs = np.split(bent, np.flatnonzero(np.diff(bent) > 1) + 1) if len(bent) else []
        return [self.positions[run[0] : run[-1] + 2] for run in runs]

    def with_slowdown(self, factor: float) -> Trajectory:
        """Returns the trajectory slowed by a factor; times are rounded to whole nanoseconds, as in messages."""
        times = np.round(self.times * factor, 9)
        positions, velocities, accelerations, _ = self.sample(times / factor)
        positions[0], positions[-1] = self.positions[0], self.positions[-1]
        velocities[[0, -1]], accelerations[[0, -1]] = self.velocities[[0, -1]], self.accelerations[[0, -1]]
        return Trajectory(self.joint_names, times, positions, velocities / factor, accelerations / factor**2)
