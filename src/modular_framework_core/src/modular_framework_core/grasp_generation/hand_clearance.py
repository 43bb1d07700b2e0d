# SPDX-License-Identifier: BSD-3-Clause
"""Finds how far a hand can advance over an object without touching it, and how wide it has to open for that.

Everything here is in a frame whose z points against the approach of the hand: for a hand from above, upwards. The
object is given by points on its surface.
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
"""Room between the object and what is not a pad when the pads touch it: the spacing error of surface points."""
HEIGHT_TOLERANCE_M = 0.0005
"""Heights that differ by less count as the same."""
HEIGHT_ROUNDS = 4
"""How often a height is tried before a place is given up."""
COLUMN_M = 0.004
"""Width of the columns in which only the highest point is kept: about the spacing of surface points."""
CLOSING_STEPS, OPENING_STEPS = 5, 8
"""Openings that are tried: below the width of the object, and above it."""


@dataclass(frozen=True, slots=True)
class Passage:
    """What passes between the pads while the hand advances.

    Attributes:
        middle: Middle of what the pads touch, along the closing direction [m].
        width: Opening at which the pads touch [m].
        half_width: Farthest the object reaches from the middle of the hand [m].
        clearance: Room to keep on each side [m].
    """

    middle: float
    width: float
    half_width: float
    clearance: float


def passage_between(
    touched: Array, passed: Array, gripper: GripperGeometry, settings: HandMotionSettings
) -> Passage | None:
    """Measures what passes between the pads; None where the hand does not open wide enough.

    Args:
        touched: (n,) positions of the points that the pads touch, along the closing direction [m].
        passed: (m,) those of the points that the hand has passed by then [m].
        gripper: Geometry of the hand.
        settings: The room that the hand keeps.
    """
    low, high = float(touched.min()), float(touched.max())
    middle = (low + high) / 2
    half_width = max(float(passed.max()) - middle, middle - float(passed.min()))
    clearance = min(settings.finger_clearance_m, gripper.max_opening / 2 - half_width)
    if clearance < min(settings.min_finger_clearance_m, settings.finger_clearance_m):
        return None
    return Passage(middle, high - low, half_width, clearance)


def highest_points(points: Array) -> Array:
    """Keeps the highest of the points (n, 3) in each small column along z: what the hand meets first."""
    order = np.argsort(-points[:, 2])
    _, first = np.unique(np.floor(points[order, :2] / COLUMN_M).astype(np.int64), axis=0, return_index=True)
    return points[order[first]]


def lowest_height(top: Array, passage: Passage, wanted: float, gripper: GripperGeometry) -> tuple[float, float]:
    """Chooses the opening with which the hand can advance to a wanted height, or else the farthest.

    Args:
        top: (n, 3) highest points of the object, from the middle of the hand [m].
        passage: What the pads have to pass.
        wanted: Height of the grasp frame that is wanted [m].
        gripper: Geometry of the hand.

    Returns:
        The least height at which the hand is clear all the time [m], and the opening to advance with [m].
    """
    needed = 2 * (passage.half_width + passage.clearance)
    closing = np.linspace(passage.width, needed, CLOSING_STEPS, endpoint=False)
    advancing = np.linspace(needed, gripper.max_opening, OPENING_STEPS)
    openings = np.concatenate([closing, advancing])
    while_closing = np.maximum.accumulate(
        gripper.lowest_heights(openings, top, CLOSING_CLEARANCE_M, with_pads=False, floor=wanted)
    )
    # The pads' own room is in the opening already; without the last bit, rounding would open the hand a step wider.
    while_advancing = gripper.lowest_heights(
        advancing, top, max(0.0, passage.clearance - CONTACT_DEPTH_M), with_pads=True, floor=wanted
    )
    heights = np.maximum(while_closing[CLOSING_STEPS:], while_advancing)
    chosen = int(np.argmax(heights <= heights.min() + HEIGHT_TOLERANCE_M))
    return float(heights[chosen]), float(advancing[chosen])
