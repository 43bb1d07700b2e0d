# SPDX-License-Identifier: BSD-3-Clause
"""Goals, result codes and state snapshots of trajectory controllers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

from modular_framework_control.realtime.goal_handle import RealtimeGoalHandle
from modular_framework_control.trajectory.joint_trajectory import Array, JointTrajectory
from modular_framework_control.trajectory.tolerances import JointTolerance


class TrajectoryErrorCode(IntEnum):
    """Result codes of control_msgs/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class GoalRejectedError(Exception):
    """A rejected goal, with its result code."""

    def __init__(self, code: TrajectoryErrorCode, reason: str) -> None:
        super().__init__(reason)
        self.code = code


TrajectoryGoalHandle = RealtimeGoalHandle[TrajectoryErrorCode]


@dataclass(frozen=True, slots=True)
class TrajectoryGoal:
    """The goal of an action client.

    Attributes:
        trajectory: Trajectory to follow.
        path_tolerance: Path tolerances by joint name.
        goal_tolerance: Goal tolerances by joint name.
        goal_time_tolerance_s: Goal time; positive replaces the default, 0 keeps the default, negative means 0.
    """

    trajectory: JointTrajectory
    path_tolerance: Mapping[str, JointTolerance] = field(default_factory=dict)
    goal_tolerance: Mapping[str, JointTolerance] = field(default_factory=dict)
    goal_time_tolerance_s: float = 0.0


@dataclass(frozen=True, slots=True)
class TrajectorySnapshot:
    """State of the controller in one cycle.

    Attributes:
        time_s: Time of the cycle.
        desired: Desired positions, velocities and accelerations, shape (3, joints).
        actual: Measured positions and velocities, shape (2, joints).
        error: Desired minus actual, shape (2, joints).
        elapsed_s: Current time_from_start of the trajectory.
    """

    time_s: float
    desired: Array
    actual: Array
    error: Array
    elapsed_s: float = 0.0
