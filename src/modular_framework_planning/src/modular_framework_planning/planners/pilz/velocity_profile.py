# SPDX-License-Identifier: BSD-3-Clause
"""Trapezoidal velocity profiles with rounded corners, so that the acceleration is continuous.

A controller joins trajectory points by polynomials of position, velocity and acceleration. A plain trapezoid has jumps
of acceleration, and such a polynomial overshoots the limits there. Averaging the trapezoid over a short window keeps
distance and limits (an average never exceeds the averaged values) and makes it a chain of cubics, which a controller
follows exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array

ROUNDING_S = 0.004  # width of the averaging window: how long the acceleration takes to change
MAX_POINTS = 20_000  # of one motion
SHORTEST_GAP_S = 1.0e-4  # between two points of a trajectory


@dataclass(frozen=True, slots=True)
class TrapezoidalProfile:
    """Position along a path of some length over time, from rest to rest.

    Attributes:
        distance: length of the path, above 0.
        rise_s, cruise_s, fall_s: lengths of the trapezoid's phases.
        knots, positions, velocities, accelerations: the chain of cubics, one entry where the acceleration changes
            its slope.
    """

    distance: float
    rise_s: float
    cruise_s: float
    fall_s: float
    knots: Array
    positions: Array
    velocities: Array
    accelerations: Array

    @property
    def duration_s(self) -> float:
        """Length in time: the trapezoid's and the rounding's."""
        return float(self.knots[-1])

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Returns position, velocity and acceleration at times [s]; at rest before the start and after the end."""
        clipped = np.clip(times, 0.0, self.duration_s)
        piece = np.clip(np.searchsorted(self.knots, clipped, side="right") - 1, 0, len(self.knots) - 2)
        jerk = np.diff(self.accelerations)[piece] / np.diff(self.knots)[piece]
        t, v, a = clipped - self.knots[piece], self.velocities[piece], self.accelerations[piece]
        position = self.positions[piece] + t * (v + t * (0.5 * a + t * jerk / 6.0))
        return position, v + t * (a + 0.5 * t * jerk), a + t * jerk


def fastest_profile(distance: float, velocity: float, acceleration: float, deceleration: float) -> TrapezoidalProfile:
    """Returns the fastest profile within limits.

    Args:
        distance: length of the path, above 0.
        velocity: limit, above 0 [1/s].
        acceleration: limit, above 0 [1/s^2].
        deceleration: limit, above 0 [1/s^2].
    """
    peak = min(velocity, float(np.sqrt(2.0 * distance * acceleration * deceleration / (acceleration + deceleration))))
    rise, fall = peak / acceleration, peak / deceleration
    cruise = max(0.0, distance / peak - 0.5 * (rise + fall))
    corners = np.cumsum([0.0, rise, cruise, fall])
    knots = np.unique(np.concatenate([corners, corners + ROUNDING_S]))
    knots = knots[np.concatenate([[True], np.diff(knots) > 1e-9])]

    def speed(times: Array) -> Array:
        return np.interp(times, corners, [0.0, peak, peak, 0.0], left=0.0, right=0.0)

    accelerations = (speed(knots) - speed(knots - ROUNDING_S)) / ROUNDING_S
    accelerations[-1] = 0.0
    gaps = np.diff(knots)
    velocities = np.concatenate([[0.0], np.cumsum(0.5 * gaps * (accelerations[:-1] + accelerations[1:]))])
    steps = gaps * (velocities[:-1] + gaps * (2.0 * accelerations[:-1] + accelerations[1:]) / 6.0)
    positions = np.concatenate([[0.0], np.cumsum(steps)])
    scale = distance / positions[-1]
    velocities[-1] = 0.0
    return TrapezoidalProfile(
        distance, rise, cruise, fall, knots, positions * scale, velocities * scale, accelerations * scale
    )


def sample_times(duration_s: float, knots: Array, period_s: float) -> Array:
    """Returns the times of a trajectory's points: every period, every knot, the end; at least 0.1 ms apart.

    A knot takes the place of a period's point nearer than that, so points are at most a period and 0.1 ms apart.
    They are whole nanoseconds, as messages carry them.

    Raises:
        PlanningError: the motion is so slow that it would have more than 20,000 points.
    """
    if duration_s > MAX_POINTS * period_s:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"the motion would take {duration_s:.0f} s, which at one "
            f"point every {period_s} s is more than {MAX_POINTS} points; choose larger scaling "
            "factors",
        )
    regular = np.arange(0.0, duration_s, period_s)
    kept = np.unique(np.concatenate([[0.0, duration_s], knots[(knots > 0.0) & (knots < duration_s)]]))
    kept = kept[np.concatenate([[True], np.diff(kept) >= SHORTEST_GAP_S])]
    kept[-1] = duration_s
    near = np.abs(regular[:, None] - kept[None, :]).min(axis=1) < SHORTEST_GAP_S
    return np.round(np.sort(np.concatenate([kept, regular[~near]])), 9)
