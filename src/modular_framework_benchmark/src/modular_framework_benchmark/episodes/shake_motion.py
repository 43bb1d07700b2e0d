# SPDX-License-Identifier: BSD-3-Clause
"""Motion that shakes a held object: all joints of the arm oscillate together about their positions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modular_framework_benchmark.metrics.measurements import Array

FREQUENCY_HZ = 2.0
AMPLITUDE = 0.05
"""Maximum amplitude of a joint [rad or m], reduced if the joint's speed limit requires."""
MAX_SPEED_FRACTION = 0.5
"""Maximum fraction of a joint's speed limit."""
RAMP_S = 0.5
STEP_S = 0.02


def shake_motion(positions: Array, speed_limits: Array, duration_s: float) -> tuple[Array, Array, Array]:
    """Returns times, positions and velocities of a shake that starts and ends at rest at the given positions.

    A joint moves by A w(t) sin(2 pi f t), with the window w rising to 1 and falling to 0 within `RAMP_S`. With 2 Hz and
    0.05 rad, a point 0.8 m from a joint's axis is accelerated by up to 6 m/s^2.

    Args:
        positions: Joint positions, shape (joints,) [rad or m].
        speed_limits: Joint speed limits, shape (joints,) [rad/s or m/s].
        duration_s: Duration of the shake [s].

    Returns:
        Times, shape (n,) [s]; positions and velocities, shape (n, joints).
    """
    count = max(round(duration_s / STEP_S), 2)
    times = np.linspace(0.0, duration_s, count + 1)
    angular_frequency = 2.0 * np.pi * FREQUENCY_HZ
    ramp = min(RAMP_S, duration_s / 2.0)
    ramp_fraction = np.clip(np.minimum(times, duration_s - times) / ramp, 0.0, 1.0)
    window = ramp_fraction * ramp_fraction * (3.0 - 2.0 * ramp_fraction)
    amplitude = np.minimum(AMPLITUDE, MAX_SPEED_FRACTION * speed_limits / (angular_frequency + 1.5 / ramp))
    swing = window * np.sin(angular_frequency * times)
    speed = np.gradient(swing, times, edge_order=2)
    speed[[0, -1]] = 0.0
    return times, positions + swing[:, None] * amplitude, speed[:, None] * amplitude


def limits_in_order(joints: list[str], limits: Mapping[str, float]) -> Array:
    """Returns the speed limits of joints [rad/s or m/s]; 1 if unknown."""
    return np.array([limits.get(joint) or 1.0 for joint in joints])
