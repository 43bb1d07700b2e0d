# SPDX-License-Identifier: BSD-3-Clause
"""Validation of trajectory goals, and computation of their splines.

Validation runs on the thread that receives the goal, so that the control loop only checks time-dependent rules.
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
    """A validated goal.

    Attributes:
        joints: Indices of the goal's joints in the controller.
        stamp_s: Start time [s of the control loop]; 0 for immediately.
        spline: Interpolated trajectory; None for "stop".
        tolerances: Path and goal tolerances.
        goal_handle: Handle of an action goal; None for a command.
        violations: Violations of joint limits; None for "stop".
    """

    joints: tuple[int, ...]
    stamp_s: float
    spline: Spline | None
    tolerances: Tolerances
    goal_handle: TrajectoryGoalHandle | None
    violations: LimitViolations | None = None


@dataclass(frozen=True, slots=True)
class GoalRules:
    """The rules for goals of a controller.

    Attributes:
        joint_names: Joints of the controller.
        tolerances: Default tolerances of the controller.
        limits: Limits of the joints.
        allow_partial: Whether a goal may leave joints out.
    """

    joint_names: tuple[str, ...]
    tolerances: Tolerances
    limits: MotionLimits
    allow_partial: bool


def validate_goal(
    goal: TrajectoryGoal, goal_handle: TrajectoryGoalHandle | None, rules: GoalRules, measured: Array
) -> ValidatedGoal:
    """Validates a goal and computes its spline.

    Limit violations are only recorded, because points in the past do not count when the goal is accepted later.

    Args:
        goal: Received goal.
        goal_handle: Handle of an action goal; None for a command, which may be empty for "stop".
        rules: Rules of the controller.
        measured: Measured positions of the controller's joints, shape (joints,) [rad|m].

    Raises:
        GoalRejectedError: The goal is malformed; the message names point and joint.
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
        goal_tolerances = tolerances_of_goal(
            tolerances,
            joint_names,
            joints,
            path=goal.path_tolerance,
            goal=goal.goal_tolerance,
            goal_time_s=goal.goal_time_tolerance_s,
        )
    except InvalidTrajectoryError as error:
        raise GoalRejectedError(TrajectoryErrorCode.INVALID_GOAL, str(error)) from error
    if not trajectory.points:
        return ValidatedGoal(joints, trajectory.stamp_s, None, goal_tolerances, goal_handle)
    spline = Spline(trajectory)
    violations = limit_violations(
        spline, trajectory.joint_names, rules.limits.of_joints(joints), measured[list(joints)]
    )
    return ValidatedGoal(joints, trajectory.stamp_s, spline, goal_tolerances, goal_handle, violations)
