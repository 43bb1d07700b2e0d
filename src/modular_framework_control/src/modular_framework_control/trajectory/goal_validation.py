# SPDX-License-Identifier: BSD-3-Clause
"""Checks a goal of a trajectory controller and computes its curve.

This runs on the thread that received the goal, so that the control loop only has to check what depends on time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from modular_framework_control.trajectory.joint_trajectory import Array, InvalidTrajectoryError, Spline
from modular_framework_control.trajectory.motion_limits import LimitViolations, MotionLimits, limit_violations
from modular_framework_control.trajectory.point_checks import check_points, joint_faults
from modular_framework_control.trajectory.tolerances import Tolerances, tolerances_of_goal
from modular_framework_control.trajectory.trajectory_goal import (
    GoalRejectedError,
    TrajectoryErrorCode,
    TrajectoryGoal,
    TrajectoryGoalHandle,
)


@dataclass(frozen=True, slots=True)
class ValidatedGoal:
    """A checked goal.

    Attributes:
        joints: indices of its joints among the controller's.
        stamp_s: when it begins [s of the loop's time]; 0 for now.
        spline: its curve; None for "stop".
        tolerances: of its path and its end.
        goal_handle: of an action goal; None for a command.
        violations: of the limits of the joints; None for "stop".
    """

    joints: tuple[int, ...]
    stamp_s: float
    spline: Spline | None
    tolerances: Tolerances
    goal_handle: TrajectoryGoalHandle | None
    violations: LimitViolations | None = None


@dataclass(frozen=True, slots=True)
class GoalRules:
    """The rules that a goal is checked against.

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


def validate_goal(
    goal: TrajectoryGoal, goal_handle: TrajectoryGoalHandle | None, rules: GoalRules, measured: Array
) -> ValidatedGoal:
    """Checks a goal and computes its curve.

    Args:
        goal: as it was sent.
        goal_handle: of an action goal; None for a command, which may be empty to say "stop".
        rules: what it is checked against. Violations of limits are only noted, because they do not count at points that
            are already past when the goal is accepted.
        measured: positions of the controller's joints [rad|m], shape (joints,).

    Raises:
        GoalRejectedError: it is malformed; says what is wrong with which point and joint.
    """
    trajectory, joint_names, tolerances = goal.trajectory, rules.joint_names, rules.tolerances
    if not trajectory.points and goal_handle is None:
        return ValidatedGoal(tuple(range(len(joint_names))), 0.0, None, tolerances, None)
    faults = joint_faults(trajectory.joint_names, joint_names, rules.allow_partial)
    if faults:
        raise GoalRejectedError(TrajectoryErrorCode.INVALID_JOINTS, faults)
    joints = tuple(joint_names.index(name) for name in trajectory.joint_names)
    try:
        check_points(trajectory)
        if math.isnan(goal.goal_time_tolerance_s):
            raise InvalidTrajectoryError("goal_time_tolerance is not a number")
        own = tolerances_of_goal(
            tolerances, joint_names, joints, goal.path_tolerance, goal.goal_tolerance, goal.goal_time_tolerance_s
        )
    except InvalidTrajectoryError as error:
        raise GoalRejectedError(TrajectoryErrorCode.INVALID_GOAL, str(error)) from error
    if not trajectory.points:
        return ValidatedGoal(joints, trajectory.stamp_s, None, own, goal_handle)
    spline = Spline(trajectory)
    violations = limit_violations(
        spline, trajectory.joint_names, rules.limits.of_joints(joints), measured[list(joints)]
    )
    return ValidatedGoal(joints, trajectory.stamp_s, spline, own, goal_handle, violations)
