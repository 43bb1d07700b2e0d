# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory execution parameters, with MoveIt's names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ExecutionSettings:
    """Parameters below ~trajectory_execution.

    Attributes:
        execution_duration_monitoring: Whether a motion that exceeds its allowed duration is stopped.
        allowed_execution_duration_scaling, allowed_goal_duration_margin: Factor on the planned duration and additional
            time, which give the allowed duration [-, s]; an entry of controller_list can override both.
        execution_velocity_scaling: Speed of the execution relative to the plan.
        allowed_start_tolerance: Maximum distance of a joint from the first point [rad or m]; 0 for no check.
        joints_allowed_start_tolerance: Start tolerances, keyed by joint [rad or m].
        wait_for_trajectory_completion: Whether to wait until the joints stop after the controllers have finished.
        controller_connection_timeout: Timeout of a connection to a controller [s].
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
        """Returns the start tolerance of a joint; no check if it is 0 or less."""
        return self.joints_allowed_start_tolerance.get(joint, self.allowed_start_tolerance)
