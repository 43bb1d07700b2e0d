# SPDX-License-Identifier: BSD-3-Clause
"""Motion that shakes a held object: all joints of the arm oscillate together about their positions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from modular_framework_benchmark.metrics.measurements import Array
from modular_framework_urdf.joint_limits import JointLimits

FREQUENCY_HZ = 2.0
AMPLITUDE = 0.05
"""Maximum amplitude of a joint [rad or m], reduced if a limit of the joint requires."""
MAX_SPEED_FRACTION = 0.5
"""Maximum fraction of a joint's speed limit."""
RAMP_S = 0.5
STEP_S = 0.02
UNKNOWN_LIMITS = JointLimits(-np.inf, np.inf, velocity=1.0, acceleration=np.inf)


def shake_motion(
    positions: Array, limits: Mapping[str, JointLimits], joints: Sequence[str], duration_s: float
) -> tuple[Array, Array, Array]:
    """Returns times, positions and velocities of a shake that starts and ends at rest at the given positions.

    A joint moves by A w(t) sin(2 pi f t), with the window w rising to 1 and falling to 0 within `RAMP_S`. With 2 Hz and
    0.05 rad, a point 0.8 m from a joint's axis is accelerated by up to 6 m/s^2. The cubics that a controller runs
    through the points keep the limits.

    Args:
        positions: Joint positions, shape (joints,) [rad or m].
        limits: Limits by joint name; an unknown joint has UNKNOWN_LIMITS.
        joints: Joint names in the order of the positions.
        duration_s: Duration of the shake [s].

    Returns:
        Times, shape (n,) [s]; positions and velocities, shape (n, joints).
    """
    found = [limits.get(joint, UNKNOWN_LIMITS) for joint in joints]
    lower, upper, max_speeds, max_accelerations = np.array(
        [(each.lower, each.upper, each.velocity, each.acceleration) for each in found]
    ).T
    count = max(round(duration_s / STEP_S), 2)
    times = np.linspace(0.0, duration_s, count + 1)
    angular_frequency = 2.0 * np.pi * FREQUENCY_HZ
    ramp = min(RAMP_S, duration_s / 2.0)
    ramp_fraction = np.clip(np.minimum(times, duration_s - times) / ramp, 0.0, 1.0)
    window = ramp_fraction * ramp_fraction * (3.0 - 2.0 * ramp_fraction)
    swing = window * np.sin(angular_frequency * times)
    speed = np.gradient(swing, times, edge_order=2)
    speed[[0, -1]] = 0.0
    room = np.maximum(np.minimum(upper - positions, positions - lower), 0.0)
    of_speed = MAX_SPEED_FRACTION * max_speeds / (angular_frequency + 1.5 / ramp)
    of_acceleration = max_accelerations / _peak_acceleration(times, swing, speed)
    amplitude = np.minimum(np.minimum(AMPLITUDE, room), np.minimum(of_speed, of_acceleration))
    return times, positions + swing[:, None] * amplitude, speed[:, None] * amplitude


def _peak_acceleration(times: Array, positions: Array, velocities: Array) -> float:
    """Returns the largest acceleration of the cubics through positions with velocities, which is at a point.

    Args:
        times: Times, shape (n,) [s].
        positions: Positions, shape (n,) [m].
        velocities: Velocities, shape (n,) [m/s].
    """
    rates, starts = CubicHermiteSpline(times, positions, velocities).derivative(2).c
    return float(np.abs([starts, starts + rates * np.diff(times)]).max())
