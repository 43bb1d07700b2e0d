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
        span = np.diff(self.times)[:, None]
        way = np.diff(self.positions, axis=0) / span
        v0, v1 = self.velocities[:-1], self.velocities[1:]
        a0, a1 = self.accelerations[:-1] * span, self.accelerations[1:] * span
        return np.stack(
            [
                self.positions[:-1],
                v0,
                0.5 * a0 / span,
                (10.0 * way - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1) / span**2,
                (-15.0 * way + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1) / span**3,
                (6.0 * way - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1) / span**4,
            ],
            axis=1,
        )

    def at(self, times: Array) -> tuple[Array, Array, Array, Array]:
        """Returns positions, velocities, accelerations and jerks of the curve at some times, shape (m, joints) each."""
        if len(self.times) < 2:
            still = np.zeros((len(times), self.positions.shape[1]))
            return still + self.positions[0], still, still, still
        t, (c0, c1, c2, c3, c4, c5) = self._pieces_at(times)
        return (
            c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
            2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
            6.0 * c3 + t * (24.0 * c4 + t * 60.0 * c5),
        )

    def positions_at(self, times: Array) -> Array:
        """Returns positions of the curve at some times, shape (m, joints); the motion has two points at least."""
        t, (c0, c1, c2, c3, c4, c5) = self._pieces_at(times)
        return c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))  # type: ignore[no-any-return]

    def _pieces_at(self, times: Array) -> tuple[Array, Array]:
        """Returns times since the point before, shape (m, 1), and the coefficients there, shape (6, m, joints)."""
        segment = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        since = (np.clip(times, self.times[0], self.times[-1]) - self.times[segment])[:, None]
        return since, np.moveaxis(self.coefficients[segment], 1, 0)

    def sample_times(self, period_s: float = SAMPLE_PERIOD_S) -> Array:
        """Returns even times from start to end, both included, at most `period_s` apart."""
        return np.linspace(0.0, self.duration_s, int(np.ceil(self.duration_s / period_s)) + 1)

    def curve(self, step: float) -> Array:
        """Returns positions along the curve, neighbours about `step` [rad or m, any joint] apart or nearer."""
        if len(self.times) < 2:
            return self.positions
        reach = np.maximum(
            np.abs(np.diff(self.positions, axis=0)).max(axis=1),
            np.diff(self.times)
            * np.maximum(np.abs(self.velocities[:-1]).max(axis=1), np.abs(self.velocities[1:]).max(axis=1)),
        )
        counts = np.maximum(1, np.ceil(reach / step)).astype(int)
        indices = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        times = np.repeat(self.times[:-1], counts) + indices * np.repeat(np.diff(self.times) / counts, counts)
        return np.vstack([self.positions_at(times), self.positions[-1:]])

    def chords(self, first: int = 0) -> list[Array]:
        """Returns polylines of points, from number `first` on, between which the curve leaves the straight line.

        A controller that ignores velocities moves straight from point to point.
        """
        if len(self.times) < 2:
            return []
        spans, ways = np.diff(self.times)[:, None], np.diff(self.positions, axis=0)
        lengths = np.maximum((ways**2).sum(axis=1), 1e-30)
        is_bent = np.zeros(len(spans), dtype=bool)
        _, c1, c2, c3, c4, c5 = np.moveaxis(self.coefficients, 1, 0)
        for share in (1.0 / 3.0, 2.0 / 3.0):
            t = share * spans
            offsets = t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
            along = ((offsets * ways).sum(axis=1) / lengths)[:, None] * ways
            is_bent |= np.abs(offsets - along).max(axis=1, initial=0.0) > STRAIGHT
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
