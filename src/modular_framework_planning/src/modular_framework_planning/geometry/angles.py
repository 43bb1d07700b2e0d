# SPDX-License-Identifier: BSD-3-Clause
"""Angle differences of continuous joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array


def shortest_difference(differences: Array, continuous: NDArray[np.bool_]) -> Array:
    """Returns joint position differences, with full rotations of continuous joints removed [rad or m].

    Args:
        differences: Joint position differences, shape (..., joints) [rad or m].
        continuous: Whether each joint is continuous, shape (joints,).
    """
    return differences - np.where(continuous, 2.0 * np.pi * np.round(differences / (2.0 * np.pi)), 0.0)
