# SPDX-License-Identifier: BSD-3-Clause
"""Results of the arm commander: each is true only on success, and has the reason otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from moveit_msgs.msg import MoveItErrorCodes, RobotTrajectory


class PlanResult(NamedTuple):
    """Outcome of planning; true only for a plan.

    Attributes:
        trajectory: The plan; without joint names when there is none.
        success: True when ``trajectory`` leads to the target.
        error_code: Value of moveit_msgs/MoveItErrorCodes.
        reason: Why there is no plan; empty with one.
    """

    trajectory: RobotTrajectory
    success: bool
    error_code: int
    reason: str

    def __bool__(self) -> bool:
        return self.success


@dataclass(frozen=True, slots=True)
class IkResult:
    """Outcome of inverse kinematics; true only with a solution.

    Attributes:
        joints: {joint: position} of the group; empty without a solution.
        error_code: Value of moveit_msgs/MoveItErrorCodes.
        reason: Why there is no solution; empty with one.
    """

    joints: dict[str, float]
    error_code: int
    reason: str

    def __bool__(self) -> bool:
        return bool(self.joints)


@dataclass(frozen=True, slots=True)
class ExecutionResult:
    """Outcome of a motion; true only when move_group reports success.

    Attributes:
        success: True when the trajectory was executed.
        error_code: Value of moveit_msgs/MoveItErrorCodes.
        reason: Why it was not; empty on success.
    """

    success: bool
    error_code: int = MoveItErrorCodes.SUCCESS
    reason: str = ""

    def __bool__(self) -> bool:
        return self.success
