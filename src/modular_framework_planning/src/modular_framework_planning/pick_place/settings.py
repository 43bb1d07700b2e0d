# SPDX-License-Identifier: BSD-3-Clause
"""Settings of pick and place, under MoveIt's names."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PickPlaceSettings:
    """Parameters below ~pick_place.

    Attributes:
        max_attempted_states_per_pose: Maximum number of arm configurations tried per grasp or place location.
        cartesian_motion_step_size: Distance between poses solved on a straight line [m].
    """

    max_attempted_states_per_pose: int
    cartesian_motion_step_size: float
