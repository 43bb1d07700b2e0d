# SPDX-License-Identifier: BSD-3-Clause
"""Results of the arm commander. A result is true only on success and contains the reason of a failure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from moveit_msgs.msg import MoveItErrorCodes, RobotTrajectory


class PlanResult(NamedTuple):
    """Result of planning; true only for a plan.

    Attributes:
        trajectory: Planned trajectory; empty after a failure.
        success: Whether ``trajectory`` leads to the target.
        error_code: Value of moveit_msgs/MoveItErrorCodes.
        reason: Reason of a failure; "" on success.
    """

    trajectory: RobotTrajectory
    success: bool
    error_code: int
    reason: str

    def __bool__(self) -> bool:
        return self.success


@dataclass(frozen=True, slots=True)
class IkResult:
    """Result of inverse kinematics; true only with a solution.

    Attributes:
        joints: {joint: position [rad or m]} of the group; empty without a solution.
        error_code: Value of moveit_msgs/MoveItErrorCodes.
        reason: Reason of a failure; "" on success.
    """

    joints: dict[str, float]
    error_code: int
    reason: str

    def __bool__(self) -> bool:
        return bool(self.joints)


@dataclass(frozen=True, slots=True)
class ExecutionResult:
    """Result of a motion; true only if move_group reports success.

    Attributes:
        success: Whether the trajectory was executed.
        error_code: Value of moveit_msgs/MoveItErrorCodes.
        reason: Reason of a failure; "" on success.
    """

    success: bool
    error_code: int = MoveItErrorCodes.SUCCESS
    reason: str = ""

    def __bool__(self) -> bool:
        return self.success
