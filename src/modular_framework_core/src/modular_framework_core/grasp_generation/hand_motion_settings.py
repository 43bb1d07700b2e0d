# SPDX-License-Identifier: BSD-3-Clause
"""Settings of approach, lift and clearances that all grasp methods share."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class HandMotionSettings:
    """Settings of the hand motion; grasp methods derive their own settings from this class.

    Attributes:
        approach_distance_m: Length of the approach [m].
        lift_distance_m: Height of the lift [m].
        finger_clearance_m: Clearance between finger and object on each side during the approach [m].
        min_finger_clearance_m: Minimum clearance if the gripper cannot open wider [m].
        tip_clearance_m: Minimum distance between the hand and the support [m].
        min_pad_overlap_m: Minimum length of the contact along the approach direction [m].
    """

    approach_distance_m: float = 0.10
    lift_distance_m: float = 0.15
    finger_clearance_m: float = 0.012
    min_finger_clearance_m: float = 0.003
    tip_clearance_m: float = 0.006
    min_pad_overlap_m: float = 0.008
