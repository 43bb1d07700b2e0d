# SPDX-License-Identifier: BSD-3-Clause
"""Determines the approach and closing directions of a hand in its grasp frame."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

MIN_DISTANCE_M, ROUNDING = 1e-3, 1e-9


def hand_axes(ahead: Array, opening: Array) -> Array:
    """Returns the axes of the hand in the grasp frame.

    The approach direction is the axis of the grasp frame that is closest to the direction from the palm to the fingers.
    The closing direction is the relative motion of the fingers, projected perpendicular to the approach direction. It
    need not be an axis of the grasp frame.

    Args:
        ahead: Vector from the centre of the palm to the middle between the opened fingers, shape (3,) [m].
        opening: Motion of one finger relative to the other from closed to open, shape (3,) [m].

    Returns:
        Rotation matrix with the columns closing, across and approach, shape (3, 3). The largest component of the
        closing direction is positive.

    Raises:
        ValueError: The fingers do not move relative to each other perpendicular to the approach direction.
    """
    axis = int(np.argmax(np.abs(ahead)))
    approach = np.zeros(3)
    approach[axis] = np.copysign(1.0, ahead[axis])
    closing = opening - approach * (opening @ approach)
    distance = float(np.linalg.norm(closing))
    if distance < MIN_DISTANCE_M:
        raise ValueError("the fingers do not move relative to each other perpendicular to the approach direction")
    closing /= distance * np.copysign(1.0, closing[int(np.argmax(np.abs(closing)))])
    closing[np.abs(closing) < ROUNDING] = 0.0
    return np.column_stack([closing, np.cross(approach, closing), approach])
