# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of trajectory execution, under MoveIt's names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ExecutionSettings:
    """Parameters below ~trajectory_execution.

    Attributes:
        execution_duration_monitoring: whether a motion that takes too long is stopped.
        allowed_execution_duration_scaling, allowed_goal_duration_margin: too long is the planned time times the one,
            plus the other [s]; an entry of controller_list may set its own.
        execution_velocity_scaling: how many times as fast as planned motions are executed.
        allowed_start_tolerance: how far a joint may be from the first point [rad or m]; 0 switches the check off.
        joints_allowed_start_tolerance: the same for single joints.
        wait_for_trajectory_completion: whether to wait, when the controllers are done, until the joints stand still.
        controller_connection_timeout: how long a controller may take to answer [s].
    """

    execution_duration_monitoring: bool
    allowed_execution_duration_scaling: float
    allowed_goal_duration_margin: float
    execution_velocity_scaling: float
    allowed_start_tolerance: float
    joints_allowed_start_tolerance: Mapping[str, float]
    wait_for_trajectory_completion: bool
    controller_connection_timeout: float

    def start_tolerance(self, joint: str) -> float:
        """Returns the tolerance of a joint; 0 or less: any distance is allowed."""
        return self.joints_allowed_start_tolerance.get(joint, self.allowed_start_tolerance)
