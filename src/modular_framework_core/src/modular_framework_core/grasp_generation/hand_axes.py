# SPDX-License-Identifier: BSD-3-Clause
"""Determines the approach and closing directions of a hand in its grasp frame."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

MIN_DISTANCE_M, ROUNDING = 1e-3, 1e-9


def hand_axes(finger_centres: Array, palm_centre: Array) -> Array:
    """Returns the axes of the hand in the grasp frame.

    The approach direction is the axis of the grasp frame that is closest to the direction from the palm to the fingers.
    The closing direction is the direction between the fingers, projected perpendicular to the approach direction. It
    need not be an axis of the grasp frame.

    Args:
        finger_centres: Centres of the outermost links of the opened fingers in the grasp frame, shape (k, 3) [m];
            k >= 2.
        palm_centre: Centre of the palm in the grasp frame, shape (3,) [m].

    Returns:
        Rotation matrix with the columns closing, across and approach, shape (3, 3). The largest component of the
        closing direction is positive.

    Raises:
        ValueError: There are fewer than two fingers, or no distance between them.
    """
    pairs = list(itertools.combinations(finger_centres, 2))
    if not pairs:
        raise ValueError(f"there are {len(finger_centres)} outermost finger links; at least 2 are needed")
    first, second = max(pairs, key=lambda pair: float(np.linalg.norm(pair[1] - pair[0])))
    ahead = (first + second) / 2 - palm_centre
    axis = int(np.argmax(np.abs(ahead)))
    approach = np.zeros(3)
    approach[axis] = np.copysign(1.0, ahead[axis])
    closing = second - first
    closing -= approach * (closing @ approach)
    distance = float(np.linalg.norm(closing))
    if distance < MIN_DISTANCE_M:
        raise ValueError("the outermost finger links have no distance perpendicular to the approach direction")
    closing /= distance * np.copysign(1.0, closing[int(np.argmax(np.abs(closing)))])
    closing[np.abs(closing) < ROUNDING] = 0.0
    return np.column_stack([closing, np.cross(approach, closing), approach])
