# SPDX-License-Identifier: BSD-3-Clause
"""Angles of joints that turn without end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array


def short_way(gaps: Array, endless: NDArray[np.bool_]) -> Array:
    """Returns differences of joint positions [rad or m], those of joints without ends less their whole turns.

    Args:
        gaps: shape (..., joints) [rad or m].
        endless: whether a joint turns without end, shape (joints,).
    """
    return gaps - np.where(endless, 2.0 * np.pi * np.round(gaps / (2.0 * np.pi)), 0.0)
