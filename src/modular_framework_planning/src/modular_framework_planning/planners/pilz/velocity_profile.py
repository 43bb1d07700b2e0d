# SPDX-License-Identifier: BSD-3-Clause
"""Trapezoidal velocity profiles with rounded corners, so that the acceleration is continuous.

A controller interpolates position, velocity and acceleration of trajectory points by polynomials, which overshoot the
limits at the acceleration jumps of a plain trapezoid. A moving average of the trapezoid keeps the distance and the
limits. Its position is a cubic spline, which a controller follows exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array

ROUNDING_S = 0.004  # width of the averaging window, which is the duration of a change of acceleration
MAX_POINTS = 20_000  # maximum number of points of a motion
MIN_GAP_S = 1.0e-4  # minimum time between two points of a trajectory


class ProfileValues(NamedTuple):
    """Values of a profile at m times, each of shape (m,)."""

    position: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrapezoidalProfile:
    """Position along a path over time, from rest to rest.

    Attributes:
        distance: Path length, above 0.
        rise_s, cruise_s, fall_s: Durations of the phases of the trapezoid.
        knots: Knots of the cubic spline, at the changes of jerk [s].
        positions, velocities, accelerations: Values of the spline at the knots.
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
        """Duration of the trapezoid and the rounding [s]."""
        return float(self.knots[-1])

    def sample(self, times: Array) -> ProfileValues:
        """Returns the values at times [s]; times outside the profile are clipped."""
        clipped = np.clip(times, 0.0, self.duration_s)
        piece = np.clip(np.searchsorted(self.knots, clipped, side="right") - 1, 0, len(self.knots) - 2)
        jerk = np.diff(self.accelerations)[piece] / np.diff(self.knots)[piece]
        t, v, a = clipped - self.knots[piece], self.velocities[piece], self.accelerations[piece]
        position = self.positions[piece] + t * (v + t * (0.5 * a + t * jerk / 6.0))
        return ProfileValues(position, v + t * (a + 0.5 * t * jerk), a + t * jerk)


def fastest_profile(distance: float, velocity: float, acceleration: float, deceleration: float) -> TrapezoidalProfile:
    """Returns the fastest profile within limits.

    Args:
        distance: Path length, above 0.
        velocity: Velocity limit, above 0.
        acceleration: Acceleration limit, above 0.
        deceleration: Deceleration limit, above 0.
    """
    peak = min(velocity, float(np.sqrt(2.0 * distance * acceleration * deceleration / (acceleration + deceleration))))
    rise, fall = peak / acceleration, peak / deceleration
    cruise = max(0.0, distance / peak - 0.5 * (rise + fall))
    breakpoints = np.cumsum([0.0, rise, cruise, fall])
    knots = np.unique(np.concatenate([breakpoints, breakpoints + ROUNDING_S]))
    knots = knots[np.concatenate([[True], np.diff(knots) > 1e-9])]

    def speed_at(times: Array) -> Array:
        return np.interp(times, breakpoints, [0.0, peak, peak, 0.0], left=0.0, right=0.0)

    accelerations = (speed_at(knots) - speed_at(knots - ROUNDING_S)) / ROUNDING_S
    accelerations[-1] = 0.0
    gaps = np.diff(knots)
    velocities = np.concatenate([[0.0], np.cumsum(0.5 * gaps * (accelerations[:-1] + accelerations[1:]))])
    steps = gaps * (velocities[:-1] + gaps * (2.0 * accelerations[:-1] + accelerations[1:]) / 6.0)
    positions = np.concatenate([[0.0], np.cumsum(steps)])
    scale = distance / positions[-1]
    velocities[-1] = 0.0
    return TrapezoidalProfile(
        distance=distance,
        rise_s=rise,
        cruise_s=cruise,
        fall_s=fall,
        knots=knots,
        positions=positions * scale,
        velocities=velocities * scale,
        accelerations=accelerations * scale,
    )


def sample_times(duration_s: float, knots: Array, period_s: float) -> Array:
    """Returns the times of trajectory points: periodic times, knots and the end, in whole nanoseconds.

    The minimum spacing of points is 0.1 ms: a knot replaces a periodic time that is closer.

    Args:
        duration_s: Duration of the motion [s].
        knots: Times that must be included [s].
        period_s: Sampling period [s].

    Raises:
        PlanningError: The motion would have more than 20,000 points.
    """
    if duration_s > MAX_POINTS * period_s:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"the motion would take {duration_s:.0f} s; at a sampling "
            f"period of {period_s} s it would exceed {MAX_POINTS} points; choose larger scaling "
            "factors",
        )
    regular = np.arange(0.0, duration_s, period_s)
    fixed = np.unique(np.concatenate([[0.0, duration_s], knots[(knots > 0.0) & (knots < duration_s)]]))
    fixed = fixed[np.concatenate([[True], np.diff(fixed) >= MIN_GAP_S])]
    fixed[-1] = duration_s
    is_close = np.abs(regular[:, None] - fixed[None, :]).min(axis=1) < MIN_GAP_S
    return np.round(np.sort(np.concatenate([fixed, regular[~is_close]])), 9)
