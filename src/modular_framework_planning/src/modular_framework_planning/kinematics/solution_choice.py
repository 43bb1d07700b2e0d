# SPDX-License-Identifier: BSD-3-Clause
"""Chooses an inverse kinematics solution: the nearest free one; of equally near ones that with the most clearance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.inverse_kinematics import SAME_SOLUTION

SIMILAR = 0.1  # [rad]; distances from the seed that differ by less are decided by clearance


def first_free(candidates: list[Array], is_free: Callable[[Array], bool], most: int = 1) -> list[Array]:
    """Returns the first candidates that are free, in their order.

    A whole turn of a joint leads to the same posture, so each posture is checked once.
    """
    verdicts: dict[bytes, bool] = {}
    free: list[Array] = []
    for values in candidates:
        key = np.round(np.exp(1j * values), 4).tobytes()
        if key not in verdicts:
            verdicts[key] = is_free(values)
        if verdicts[key]:
            free.append(values)
            if len(free) >= most:
                break
    return free


def clearest(free: list[Array], seed: Array, clearance: Callable[[Array], float]) -> Array:
    """Returns, of free solutions ordered by distance from the seed, the nearest one.

    Of several that are about as near as it, the one furthest from obstacles is taken.
    """
    distances = [float(np.linalg.norm(values - seed)) for values in free]
    similar = [values for values, distance in zip(free, distances, strict=True) if distance <= distances[0] + SIMILAR]
    if len(similar) == 1 or distances[0] < SAME_SOLUTION:
        return free[0]
    return max(similar, key=clearance)
