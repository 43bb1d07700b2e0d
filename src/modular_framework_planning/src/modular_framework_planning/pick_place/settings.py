# SPDX-License-Identifier: BSD-3-Clause
"""Settings of grasps and releases, under MoveIt's names."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PickPlaceSettings:
    """Parameters below ~pick_place.

    Attributes:
        max_attempted_states_per_pose: postures of the arm that are tried for one grasp or place.
        cartesian_motion_step_size: between the poses that are solved on a straight line [m].
    """

    max_attempted_states_per_pose: int
    cartesian_motion_step_size: float
