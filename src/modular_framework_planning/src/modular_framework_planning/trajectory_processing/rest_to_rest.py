# SPDX-License-Identifier: BSD-3-Clause
"""Duration of motions from rest to rest between two positions, which controllers interpolate by a cubic polynomial."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def shortest_cubic_s(
    distances: npt.ArrayLike, max_velocities: npt.ArrayLike, max_accelerations: npt.ArrayLike
) -> float:
    """Returns the shortest duration that keeps the limits of all joints [s].

    A cubic from rest to rest over a distance d in the time T has the highest velocity 1.5 d/T and acceleration 6 d/T^2.

    Args:
        distances: Distances, shape (n,) [rad or m].
        max_velocities: Velocity limits, shape (n,) [rad/s or m/s]; infinite for no limit.
        max_accelerations: Acceleration limits, shape (n,) [rad/s^2 or m/s^2]; infinite for no limit.
    """
    lengths, velocities, accelerations = map(np.asarray, (distances, max_velocities, max_accelerations))
    durations_s = np.maximum(1.5 * lengths / velocities, np.sqrt(6.0 * lengths / accelerations))
    return float(durations_s.max())
