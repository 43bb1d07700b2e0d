# SPDX-License-Identifier: BSD-3-Clause
"""Finds from the shapes of a hand along which axes of its grasp frame it approaches and closes."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

NO_DISTANCE_M, ROUNDING = 1e-3, 1e-9


def hand_axes(finger_centres: Array, palm_centre: Array) -> Array:
    """Returns the axes of the hand in the grasp frame.

    The approach is the axis of the grasp frame that leads best from the palm to the fingers. The closing direction
    leads from one finger to the other, across the approach, and need not be an axis of the frame.

    Args:
        finger_centres: (k, 3) centres of the outermost links of the fingers, opened, in the grasp frame [m]; k >= 2.
        palm_centre: (3,) centre of what the fingers hang on [m].

    Returns:
        (3, 3) rotation with the columns closing, across and approach; closing is along a positive axis rather than
        along a negative one.

    Raises:
        ValueError: There are no two fingers apart from each other.
    """
    pairs = list(itertools.combinations(finger_centres, 2))
    if not pairs:
        raise ValueError(f"there are {len(finger_centres)} outermost finger links, at least 2 are needed")
    first, second = max(pairs, key=lambda pair: float(np.linalg.norm(pair[1] - pair[0])))
    ahead = (first + second) / 2 - palm_centre
    axis = int(np.argmax(np.abs(ahead)))
    approach = np.zeros(3)
    approach[axis] = np.copysign(1.0, ahead[axis])
    closing = second - first
    closing -= approach * (closing @ approach)
    distance = float(np.linalg.norm(closing))
    if distance < NO_DISTANCE_M:
        raise ValueError("the outermost finger links are never apart across the approach direction")
    closing /= distance * np.copysign(1.0, closing[int(np.argmax(np.abs(closing)))])
    closing[np.abs(closing) < ROUNDING] = 0.0
    return np.column_stack([closing, np.cross(approach, closing), approach])
