# SPDX-License-Identifier: BSD-3-Clause
"""Choice of an inverse kinematics solution by distance from the seed and by clearance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.inverse_kinematics import SAME_SOLUTION

SIMILAR_DISTANCE = 0.1  # solutions within this difference of seed distances are compared by clearance [rad]


def first_free(candidates: list[Array], is_free: Callable[[Array], bool], max_count: int = 1) -> list[Array]:
    """Returns the first free candidates.

    Candidates that differ by full rotations have the same posture, which is checked once.

    Args:
        candidates: Joint vectors in order of preference.
        is_free: Checks that a joint vector is free.
        max_count: Maximum number of returned candidates.
    """
    verdicts: dict[bytes, bool] = {}
    free: list[Array] = []
    for values in candidates:
        key = np.round(np.exp(1j * values), 4).tobytes()
        if key not in verdicts:
            verdicts[key] = is_free(values)
        if verdicts[key]:
            free.append(values)
            if len(free) >= max_count:
                break
    return free


def clearest(free: list[Array], seed: Array, clearance: Callable[[Array], float]) -> Array:
    """Returns the solution nearest to the seed; similarly near solutions are compared by clearance.

    Args:
        free: Free solutions, nearest to the seed first.
        seed: Joint vector of the seed.
        clearance: Returns the clearance of a solution.
    """
    distances = [float(np.linalg.norm(values - seed)) for values in free]
    similar = [
        values for values, distance in zip(free, distances, strict=True) if distance <= distances[0] + SIMILAR_DISTANCE
    ]
    if len(similar) == 1 or distances[0] < SAME_SOLUTION:
        return free[0]
    return max(similar, key=clearance)
