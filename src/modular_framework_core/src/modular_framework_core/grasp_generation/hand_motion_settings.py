# SPDX-License-Identifier: BSD-3-Clause
"""How a hand comes to a grasp and leaves it, and what it keeps clear of: the settings that grasp methods share."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class HandMotionSettings:
    """Limits of a usable motion of the hand; methods derive their own settings from it.

    Attributes:
        approach_distance_m: How far the hand advances to the grasp [m].
        lift_distance_m: How high it is lifted [m].
        finger_clearance_m: Room between the hand and the object on each side when the hand advances [m].
        min_finger_clearance_m: The least such room, with which a hand that opens no wider advances [m].
        tip_clearance_m: Smallest distance of the hand from the support [m].
        min_pad_overlap_m: Least length of the pads, along the approach, that must touch [m].
    """

    approach_distance_m: float = 0.10
    lift_distance_m: float = 0.15
    finger_clearance_m: float = 0.012
    min_finger_clearance_m: float = 0.003
    tip_clearance_m: float = 0.006
    min_pad_overlap_m: float = 0.008
