# SPDX-License-Identifier: BSD-3-Clause
"""What becomes of a goal before a trajectory controller follows it: checked, and its curve computed.

That happens on the thread that brings the goal, so that the control loop has nothing left to refuse but what depends on
time.
"""
from __future__ import annotations

import math
from dataclasses import dataclass

from modular_framework_control.trajectory import Array, InvalidTrajectoryError, Spline
from modular_framework_control.trajectory_check import check_points, joint_faults
from modular_framework_control.trajectory_goal import (
    GoalRejectedError,
    TrajectoryErrorCode,
    TrajectoryGoal,
    TrajectoryTicket,
)
from modular_framework_control.trajectory_limits import Excesses, MotionLimits, excesses_of
from modular_framework_control.trajectory_tolerances import Tolerances, tolerances_of_goal


@dataclass(frozen=True, slots=True)
class TrajectoryOrder:
    """A checked goal.

    Attributes:
        joints: indices of its joints among the controller's.
        stamp_s: when it begins [s of the loop's time]; 0 for now.
        spline: its curve; None for "stop".
        tolerances: the ones it is watched with.
        ticket: of an action goal; None for a command.
        excesses: what it asks beyond the limits of the joints; None for "stop".
    """

    joints: tuple[int, ...]
    stamp_s: float
    spline: Spline | None
    tolerances: Tolerances
    ticket: TrajectoryTicket | None
    excesses: Excesses | None = None


@dataclass(frozen=True, slots=True)
class GoalRules:
    """What a goal is checked against.

    Attributes:
        joint_names: the controller's joints.
        tolerances: the controller's, where the goal has none of its own.
        limits: of the joints.
        allow_partial: whether the goal may leave joints out.
    """

    joint_names: tuple[str, ...]
    tolerances: Tolerances
    limits: MotionLimits
    allow_partial: bool


def order_of(goal: TrajectoryGoal, ticket: TrajectoryTicket | None, rules: GoalRules, here: Array) -> TrajectoryOrder:
    """Check a goal and compute its curve.

    Args:
        goal: as it was sent.
        ticket: of an action goal; None for a command, which may be empty to say "stop".
        rules: what it is checked against; what is beyond limits is noted in the order, as points that come too late do
            not count.
        here: positions of the controller's joints, shape (joints,).

    Raises:
        GoalRejectedError: it is malformed; says what is wrong with which point and joint.
    """
    trajectory, joint_names, tolerances = goal.trajectory, rules.joint_names, rules.tolerances
    if not trajectory.points and ticket is None:
        return TrajectoryOrder(tuple(range(len(joint_names))), 0.0, None, tolerances, None)
    faults = joint_faults(trajectory.joint_names, joint_names, rules.allow_partial)
    if faults:
        raise GoalRejectedError(TrajectoryErrorCode.INVALID_JOINTS, faults)
    joints = tuple(joint_names.index(name) for name in trajectory.joint_names)
    try:
        check_points(trajectory)
        if math.isnan(goal.goal_time_tolerance_s):
            raise InvalidTrajectoryError("goal_time_tolerance is not a number")
        own = tolerances_of_goal(tolerances, joint_names, joints, goal.path_tolerance, goal.goal_tolerance,
                                 goal.goal_time_tolerance_s)
    except InvalidTrajectoryError as error:
        raise GoalRejectedError(TrajectoryErrorCode.INVALID_GOAL, str(error)) from error
    if not trajectory.points:
        return TrajectoryOrder(joints, trajectory.stamp_s, None, own, ticket)
    spline = Spline(trajectory)
    excesses = excesses_of(spline, trajectory.joint_names, rules.limits.of_joints(joints), here[list(joints)])
    return TrajectoryOrder(joints, trajectory.stamp_s, spline, own, ticket, excesses)
