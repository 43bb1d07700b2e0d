# SPDX-License-Identifier: BSD-3-Clause
"""Computes the lowest collision-free height of a hand over an object, and the opening for this height.

All coordinates are in a frame whose z axis points against the approach direction: upwards, if the hand approaches from
above. The object is represented by points on its surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.hand_motion_settings import HandMotionSettings

Array = npt.NDArray[np.float64]

CONTACT_DEPTH_M = 0.001
CLOSING_CLEARANCE_M = 0.002
"""Clearance between the object and all parts except the pads while the hand closes; covers the point spacing."""
HEIGHT_TOLERANCE_M = 0.0005
"""Tolerance for the comparison of heights."""
HEIGHT_ROUNDS = 4
"""Maximum number of iterations over heights per hand pose."""
COLUMN_M = 0.004
"""Cell size of the grid that keeps the highest point per cell: about the spacing of surface points."""
CLOSING_STEPS, OPENING_STEPS = 5, 8
"""Numbers of sampled openings below and above the opening that clears the object."""


@dataclass(frozen=True, slots=True)
class Passage:
    """Part of the object that passes between the pads during the approach.

    Attributes:
        middle: Midpoint of the touched points along the closing direction [m].
        width: Opening at which the pads touch the object [m].
        half_width: Maximum distance of a passing point from the midpoint along the closing direction [m].
        clearance: Clearance on each side [m].
    """

    middle: float
    width: float
    half_width: float
    clearance: float


def passage_between(
    touched: Array, passed: Array, gripper: GripperGeometry, settings: HandMotionSettings
) -> Passage | None:
    """Returns the passage of an object between the pads, or None if the maximum opening is too small.

    Args:
        touched: Coordinates of the touched points along the closing direction, shape (n,) [m].
        passed: Coordinates of the points that pass between the pads, shape (m,) [m].
        gripper: Geometry of the hand.
        settings: Clearances of the hand.
    """
    low, high = float(touched.min()), float(touched.max())
    middle = (low + high) / 2
    half_width = max(float(passed.max()) - middle, middle - float(passed.min()))
    clearance = min(settings.finger_clearance_m, gripper.max_opening / 2 - half_width)
    if clearance < min(settings.min_finger_clearance_m, settings.finger_clearance_m):
        return None
    return Passage(middle, high - low, half_width, clearance)


def highest_points(points: Array) -> Array:
    """Returns the highest point in each cell of a horizontal grid; `points` has the shape (n, 3) [m]."""
    order = np.argsort(-points[:, 2])
    _, first = np.unique(np.floor(points[order, :2] / COLUMN_M).astype(np.int64), axis=0, return_index=True)
    return points[order[first]]


def lowest_height(top: Array, passage: Passage, desired: float, gripper: GripperGeometry) -> tuple[float, float]:
    """Returns the lowest collision-free height of the hand, and the smallest opening that reaches this height.

    Args:
        top: Highest points of the object, relative to the midpoint between the pads, shape (n, 3) [m].
        passage: Part of the object between the pads.
        desired: Desired height of the grasp frame [m]; lower bound of the result.
        gripper: Geometry of the hand.

    Returns:
        Height without a collision during approach and closing [m], and opening during the approach [m].
    """
    needed = 2 * (passage.half_width + passage.clearance)
    closing = np.linspace(passage.width, needed, CLOSING_STEPS, endpoint=False)
    advancing = np.linspace(needed, gripper.max_opening, OPENING_STEPS)
    openings = np.concatenate([closing, advancing])
    while_closing = np.maximum.accumulate(
        gripper.lowest_heights(openings, top, CLOSING_CLEARANCE_M, with_pads=False, floor=desired)
    )
    # The openings include the clearance of the pads. Subtracting the contact depth absorbs rounding errors.
    while_advancing = gripper.lowest_heights(
        advancing, top, max(0.0, passage.clearance - CONTACT_DEPTH_M), with_pads=True, floor=desired
    )
    heights = np.maximum(while_closing[CLOSING_STEPS:], while_advancing)
    chosen = int(np.argmax(heights <= heights.min() + HEIGHT_TOLERANCE_M))
    return float(heights[chosen]), float(advancing[chosen])
