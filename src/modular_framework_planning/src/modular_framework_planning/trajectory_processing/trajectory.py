# SPDX-License-Identifier: BSD-3-Clause
"""The timed motion of a group, as planners return it, and the curve that a controller interpolates between its points.

A JointTrajectoryController joins points that give positions, velocities and accelerations by quintic polynomials:
limits hold for the robot only if they hold along that curve, not just at the points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_curves import (
    bent_segments,
    curve_samples,
    curve_values,
    quintic_coefficients,
)

SAMPLE_PERIOD_S = 0.001  # of a controller
STRAIGHT = 1.0e-5  # [rad or m]; a curve that leaves its chord by less counts as straight


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Samples of a motion.

    Attributes:
        joint_names: joints, in the order of the columns.
        times: strictly increasing, the first is 0 [s], shape (n,).
        positions, velocities, accelerations: shape (n, joints) [rad or m, per s, per s^2].
    """

    joint_names: tuple[str, ...]
    times: Array
    positions: Array
    velocities: Array
    accelerations: Array

    @property
    def duration_s(self) -> float:
        """Length of the motion."""
        return float(self.times[-1])

    @cached_property
    def coefficients(self) -> Array:
        """The polynomials between the points, lowest power first, shape (n - 1, 6, joints)."""
        rows = (self.times, self.positions, self.velocities, self.accelerations)
        return quintic_coefficients(*(np.ascontiguousarray(item, dtype=float) for item in rows))

    def at(self, times: Array) -> tuple[Array, Array, Array, Array]:
        """Returns positions, velocities, accelerations and jerks of the curve at some times, shape (m, joints) each."""
        if len(self.times) < 2:
            still = np.zeros((len(times), self.positions.shape[1]))
            return still + self.positions[0], still, still, still
        positions, velocities, accelerations, jerks = self._values(times, 4)
        return positions, velocities, accelerations, jerks

    def positions_at(self, times: Array) -> Array:
        """Returns positions of the curve at some times, shape (m, joints); the motion has two points at least."""
        return np.asarray(self._values(times, 1)[0])

    def _values(self, times: Array, orders: int) -> Array:
        wanted = np.ascontiguousarray(times, dtype=float)
        return curve_values(np.ascontiguousarray(self.times, dtype=float), self.coefficients, wanted, orders)

    def sample_times(self, period_s: float = SAMPLE_PERIOD_S) -> Array:
        """Returns even times from start to end, both included, at most `period_s` apart."""
        return np.linspace(0.0, self.duration_s, int(np.ceil(self.duration_s / period_s)) + 1)

    def curve(self, step: float) -> Array:
        """Returns positions along the curve, neighbours about `step` [rad or m, any joint] apart or nearer."""
        if len(self.times) < 2:
            return self.positions
        times, positions, velocities = (
            np.ascontiguousarray(item, dtype=float) for item in (self.times, self.positions, self.velocities)
        )
        return curve_samples(times, self.coefficients, positions, velocities, step)

    def chords(self, first: int = 0) -> list[Array]:
        """Returns polylines of points, from number `first` on, between which the curve leaves the straight line.

        A controller that ignores velocities moves straight from point to point.
        """
        if len(self.times) < 2:
            return []
        times, positions = (np.ascontiguousarray(item, dtype=float) for item in (self.times, self.positions))
        is_bent = bent_segments(times, self.coefficients, positions, STRAIGHT)
        bent = first + np.flatnonzero(is_bent[first:])
        runs = np.split(bent, np.flatnonzero(np.diff(bent) > 1) + 1) if len(bent) else []
        return [self.positions[run[0] : run[-1] + 2] for run in runs]

    def slowed(self, factor: float) -> Trajectory:
        """Returns the same curve run `factor` times slower; its times are whole nanoseconds, as messages carry them."""
        times = np.round(self.times * factor, 9)
        positions, velocities, accelerations, _ = self.at(times / factor)
        positions[0], positions[-1] = self.positions[0], self.positions[-1]
        velocities[[0, -1]], accelerations[[0, -1]] = self.velocities[[0, -1]], self.accelerations[[0, -1]]
        return Trajectory(self.joint_names, times, positions, velocities / factor, accelerations / factor**2)
